"""The viewer: opened in a window, served to a browser, run without a screen for pictures."""
