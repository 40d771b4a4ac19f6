"""What other programs know of photographs: frames of videos, calibrated lenses, rods that were segmented."""
