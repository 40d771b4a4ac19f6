"""Convex programs for contact forces from measured sliding, and friction estimated from the motion."""
