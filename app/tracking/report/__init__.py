"""The tracking report: a page with the quality of the tracks."""
