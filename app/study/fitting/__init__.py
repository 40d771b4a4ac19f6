"""Fits of the constants of the assessment on scenarios with known forces."""
