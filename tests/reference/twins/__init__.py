"""The plain twins: loops and arithmetic from the equations, as slow as they need to be."""
