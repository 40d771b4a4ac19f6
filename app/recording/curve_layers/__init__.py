"""What is drawn as curves and plots, a file for each."""
