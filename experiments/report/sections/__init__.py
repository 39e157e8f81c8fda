"""Sections that experiments over a grid choose from."""
