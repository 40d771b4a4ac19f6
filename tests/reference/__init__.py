"""Plain twins of the compiled kernels, implemented from the equations, and the comparisons with them."""
