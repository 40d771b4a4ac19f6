"""Diagnosis: which error of the input, or which physics, explains what contradicts the forces."""
