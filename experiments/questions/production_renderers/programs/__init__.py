"""What runs in the renderers' own Python: a program for each, which imports nothing of ours.

A written scene's folder holds `session.py` and, as `render.py`, the program of its renderer.
"""
