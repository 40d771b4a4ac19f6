"""The blueprint: tabs, views and their layout."""
