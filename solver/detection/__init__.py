"""Who does touch, inferred from many photographs. Stands on contacts."""
