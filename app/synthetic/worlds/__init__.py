"""Worlds: simulated truths, and experiment folders that depart from them as those of laboratories do."""
