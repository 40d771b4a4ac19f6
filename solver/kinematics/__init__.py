"""Kinematics of a packing from its tracks: fluctuations about the mean field, local strain, density, shear bands."""
