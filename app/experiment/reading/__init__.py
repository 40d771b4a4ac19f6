"""Tables and other input files as they are read."""
