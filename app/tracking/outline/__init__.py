"""Tracking of discs by their rims: x and y without rotation."""
