"""What forces that are known already tell of positions: errors of rods, and the first photograph once more."""
