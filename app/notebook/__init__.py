"""What Python gets: runs as tables. The promised face, `import rodsight`, hands these names on; nothing imports it."""
