"""Experiments over grids of measurements, their store, and the command line."""
