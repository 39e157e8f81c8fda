"""Experiments over grids of cells, their store, and the command line."""
