"""What functions of the room take and give."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Point = tuple[float, float, float]
Shade = Callable[[Array, float], Array]
"""Radiance (n, 3) from unit directions (n, 3), given the angular width of a sample in radians."""
