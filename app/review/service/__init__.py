"""The page's other half: a local server, who may speak to it, one session, its picture, what a click means.
Stands on judging; the page itself, in page/, is plain files."""
