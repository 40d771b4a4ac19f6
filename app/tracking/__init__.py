"""From photographs to tracks. Stands on experiment and results; knows no forces."""
