"""Pictures: what an image is, what part of it is used, and how a file is read."""
