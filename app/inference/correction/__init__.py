"""Corrections before contacts are found: boundary, noise, calibration, radii, friction, unseen grains."""
