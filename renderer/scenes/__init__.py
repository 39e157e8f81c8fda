"""The built-in scenes, one file each, modelled from code."""
