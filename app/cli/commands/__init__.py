"""One file per group of commands, which call the stages."""
