"""Plain implementations of the compiled kernels, from the equations, without regard to speed."""
