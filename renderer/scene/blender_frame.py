"""Blender's frame: +Z up, and its equirectangular maps.

Blender's texture has u = ½ − atan2(y, x) / 2π. A map of this project has u = φ / 2π with x = sin φ
and y = cos φ in that frame, so the look-up is turned by +90° about Z: atan2 is then π − φ.
"""

import math

import numpy as np

UP_TO_Z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""From +Y up to +Z up: (x, y, z) becomes (x, −z, y)."""
MAP_TURN = 0.5 * math.pi
"""About +Z, from a direction to where Blender's map has what ours has there."""
