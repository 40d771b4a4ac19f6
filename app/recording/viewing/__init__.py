"""The viewer: opened, served to a browser, driven without a screen for pictures."""
