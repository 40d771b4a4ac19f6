"""What is there and how it moved: grains, walls, packing, motion, holes. Touches nothing but arrays."""
