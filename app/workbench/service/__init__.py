"""The page's other half: a local server and the questions that it answers.
Stands on everything that the workbench can do; the page itself, in page/, is plain files."""
