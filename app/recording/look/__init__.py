"""Common parts of all drawings: entity paths, scene, canvas, colours, widths, texts and axes."""
