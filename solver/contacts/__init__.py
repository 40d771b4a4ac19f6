"""Who may touch whom, and how bodies move against one another there. Depends on bodies."""
