"""One file per family of commands, each a thin layer over the stages."""
