"""The blueprint: tabs, their views and their layout."""
