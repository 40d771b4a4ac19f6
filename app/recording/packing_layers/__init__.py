"""The layers drawn over the packing, one file each."""
