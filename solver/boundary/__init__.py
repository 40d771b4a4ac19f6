"""Corrections of the measured boundary: rigid bars, walls that continue beyond their ends, the camera's motion."""
