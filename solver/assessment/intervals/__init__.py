"""Standard deviations and intervals of forces, of statistics and of the scale of all forces."""
