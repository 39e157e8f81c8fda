"""Lights of a sampler as files for other programs: JSON, CSV, USD and a Blender script."""
