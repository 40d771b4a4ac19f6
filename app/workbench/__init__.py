"""The workbench: one local page on which an experiment is set up, mended, run, inspected and reviewed.
Whatever is done on it is an ordinary file of the experiment's folder; it computes nothing that a command would not."""
