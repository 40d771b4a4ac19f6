"""Grains, walls, packing and their motion between photographs; depends on no other folder of the solver."""
