"""A test that still goes on: photographs are waited for, tracked and solved as they come.
What it finds is provisional; the ordinary run, with all photographs at hand, replaces it."""
