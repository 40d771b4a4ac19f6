"""What the subjects of the command study do. Depends on the studies, the pipeline and the terminal."""
