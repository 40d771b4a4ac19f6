"""Reports on the calibration of intervals, trust and status against simulated truth."""
