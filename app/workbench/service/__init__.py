"""The local server of the page and the endpoints that it serves; the page itself, in page/, is plain files."""
