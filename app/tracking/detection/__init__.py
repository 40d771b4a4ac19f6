"""The grains of the first photograph: circles, and the rims that they are measured by."""
