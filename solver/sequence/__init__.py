"""Frames in order: solved by both methods, judged, reported. Depends on all the other rooms."""
