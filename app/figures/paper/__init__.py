"""Figures as the paper shows them, from the data of a run and recorded forces."""
