"""Words that the project does not use, and a test that finds them."""
