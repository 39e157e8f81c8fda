"""Sixteen shading points side by side: Embree, reflectance, random numbers, look-ups."""
