"""One method: nonlinear Gauss-Seidel on one interval. Stands on detection and statistics."""
