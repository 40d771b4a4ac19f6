"""Two witnesses of the same forces, the motion and the positions, heard together.

Stands on convex and posterior.
"""
