"""Tracking of the frame's bars by correlation, and detection of the walls' inner edges."""
