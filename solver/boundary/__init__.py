"""What was measured of the boundary, made what it must have been: rigid bars that meet, seen by one camera."""
