"""Splines through photographs: their coefficients, their values and projections, eight numbers at a time."""
