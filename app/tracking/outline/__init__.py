"""Discs followed by their rims, whatever is or changes within them: x and y, no rotation. Uses registration's poses."""
