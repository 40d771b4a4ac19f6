"""Compilation of kernels before they are called: in processes of their own, or for a wheel."""
