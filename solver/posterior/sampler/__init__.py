"""The Gibbs sampler of a frame's posterior: its data, its conditional draws, the sweeps of a chain."""
