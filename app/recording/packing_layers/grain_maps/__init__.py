"""Maps of the grains, each coloured by one quantity."""
