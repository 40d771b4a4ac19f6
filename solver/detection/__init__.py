"""Detection of contacts from a window of photographs; depends on contacts."""
