"""Mechanics of a granular packing: contacts, contact forces, statistics. Arrays in, arrays out."""
