"""From photographs to tracks. Stands on experiment and results; knows no forces."""

DETECTIONS = "detections.csv"  # in a run's folder: the rods of the first photograph as they were found
PICTURES = "pictures"  # stage that keeps photographs as recordings show them
