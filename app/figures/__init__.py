"""Figures for papers, drawn from results with matplotlib: light, at column width, with units and scale bars.

They show what is stored and compute no mechanics; the viewer's recording knows nothing of them.
"""
