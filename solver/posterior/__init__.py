"""A second estimator: a posterior over contacts, forces and centre errors, from positions alone.

Stands on detection.
"""
