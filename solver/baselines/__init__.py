"""Forces that need no motion: what every estimator has to beat. Touches contacts and the convex program."""
