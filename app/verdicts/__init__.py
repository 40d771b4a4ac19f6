"""Reviewers' verdicts on contacts and frames, and their conversion for the solver. Depends on experiment."""
