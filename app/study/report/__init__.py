"""Whether intervals, trust and status hold, as figures and as a page. Stands on the worlds."""
