"""What people said of contacts and frames, and how it reaches the solver. Stands on experiment."""
