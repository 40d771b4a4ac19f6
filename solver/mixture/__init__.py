"""The motion estimate and the position-only estimate of the same forces, combined."""
