"""Campaigns: a table of experiments and settings, run in processes or on a cluster, with one report."""
