"""Constant errors of centres, radii, walls and scale, found from gaps. Depends on bodies."""
