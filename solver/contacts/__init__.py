"""Who may touch whom, and how bodies move against one another there. Stands on bodies."""
