"""What is drawn over the packing, a file for each layer."""
