"""Sensitivity of the inferred forces to uncertain inputs: inputs are varied and sequences solved again."""
