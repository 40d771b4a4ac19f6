"""Robust standard deviation: what half of the values determine, whatever the others are."""

from __future__ import annotations

NORMAL_MEDIAN = 0.6745  # median of |N(0, 1)|
SD_OVER_MAD = 1.4826  # its reciprocal: standard deviation over the median absolute deviation of a normal distribution
