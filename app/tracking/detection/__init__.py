"""Detection of the grains of the first photograph: candidate circles, and their measurement by their rims."""
