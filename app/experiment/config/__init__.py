"""The experiment file: its sections, the meaning of every key, and the validation of their values."""
