"""Figures for papers, drawn from results with matplotlib: light, at column width, with units and scale bars.

They show stored quantities and compute no mechanics; they are independent of the recording.
"""
