"""Stored results of earlier versions and of this one."""
