"""Patches of one photograph found again in another, to hundredths of a pixel."""
