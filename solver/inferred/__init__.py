"""What no photograph shows, inferred from what it shows: rods that were never seen, rotations that nobody measured."""
