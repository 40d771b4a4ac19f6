"""Which pairs are worth a person's look, in which order, and what their verdicts say of contact detection.
Stands on results and verdicts; knows no page."""
