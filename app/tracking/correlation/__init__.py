"""Correlation of patches between two photographs, accurate to hundredths of a pixel."""
