"""Constant errors of centres, radii, walls and scale, found from gaps. Stands on bodies."""
