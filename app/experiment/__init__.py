"""An experiment on disk, read and checked. Touches tracks and the solver, no stage."""
