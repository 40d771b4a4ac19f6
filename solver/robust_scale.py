"""Robust standard deviation: what half of the values determine, whatever the others are."""

from __future__ import annotations

SD_OVER_MAD = 1.4826  # standard deviation over the median absolute deviation of a normal distribution
