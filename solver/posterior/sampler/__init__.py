"""The sampler of a frame's posterior: what it reads and writes, its draws, the sweeps of a chain."""
