"""Following of a running test: photographs are tracked and solved as they arrive.

The results are provisional; the ordinary run with all photographs replaces them.
"""
