"""Read and check an experiment on disk. Depends on tracks and the solver, on no processing stage."""
