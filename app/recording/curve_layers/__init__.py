"""The curves and plots, one file each."""
