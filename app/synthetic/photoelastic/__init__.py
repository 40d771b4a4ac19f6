"""Synthetic photoelastic tests: their photographs with fringes, and the files of a program that has read them."""
