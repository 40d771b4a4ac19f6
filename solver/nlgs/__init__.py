"""Nonlinear Gauss-Seidel on one interval."""
