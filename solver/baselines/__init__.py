"""Motion-free force estimates, the baselines for every estimator that uses the motion."""
