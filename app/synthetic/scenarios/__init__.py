"""Scenarios: simulated tests, and experiment folders that depart from them as those of laboratories do."""
