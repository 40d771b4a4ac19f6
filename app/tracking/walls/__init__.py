"""The bars of the frame, followed as grains are."""
