"""The other method: convex programs that read the sliding, and the friction that the motion shows. Stands on nlgs."""
