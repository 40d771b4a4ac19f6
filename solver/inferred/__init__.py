"""Quantities that were not measured: rods that no photograph shows, rotations without texture."""
