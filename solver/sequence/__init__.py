"""Frames in order: solved by both methods, judged, reported. Stands on all the other rooms."""
