"""The experiment file: its sections, what every key means, and what of it is refused."""
