"""The running process and its files: errors, progress, signals, locks, atomic writes, kernel cache, version."""
