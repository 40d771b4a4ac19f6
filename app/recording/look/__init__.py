"""What every drawing shares: entity paths, scene, canvas, colours, widths, texts, axes, legends."""
