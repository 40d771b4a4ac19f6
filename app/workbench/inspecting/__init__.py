"""What a run has found so far, for the page's own drawing: stored numbers put into pixels, nothing computed anew.
Knows no page."""
