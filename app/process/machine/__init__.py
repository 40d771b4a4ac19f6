"""What this machine provides: a browser, memory, a level of the processor."""
