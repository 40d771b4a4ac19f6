"""The Python interface: runs as tables. `import rodsight` exports these names."""
