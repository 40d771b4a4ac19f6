"""The shipped documentation: pages of app/docs as HTML for reading offline, and lists generated from the code."""
