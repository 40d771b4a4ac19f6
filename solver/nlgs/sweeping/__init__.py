"""Sweeps as compiled loops: the law of a contact, the order of contacts, grains eight at a time."""
