"""From photographs to tracks: detection, correlation and tracking of grains and walls."""

DETECTIONS = "detections.csv"  # in a run's folder: the detected rods of the first photograph
PICTURES = "pictures"  # stage that stores the JPEG copies of photographs
