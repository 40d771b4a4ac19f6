"""Assessment of a solved frame: status, expected correlation, trust, penalties and intervals of its forces."""
