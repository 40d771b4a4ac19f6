"""Errors of the tables of rods and walls: names, jumps, lost poses, rotations, times of the walls."""
