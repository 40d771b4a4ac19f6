"""A circle measured in a photograph: its edges, the profile of its rim, and the fit through both."""
