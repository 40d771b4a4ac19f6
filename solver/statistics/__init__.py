"""Statistics of given contact forces; depends on contacts."""
