"""A page that shows how well tracking went."""
