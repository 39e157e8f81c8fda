"""A frame whose +Z points to a light: USD and Blender lights shine along their −Z."""

import numpy as np
from numpy.typing import NDArray

UP_TO_Z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""From +Y up to +Z up: (x, y, z) becomes (x, −z, y)."""


def frame_towards(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation matrix (3, 3) whose columns are the images of x, y and z; z goes to `direction`."""
    z = direction / np.linalg.norm(direction)
    helper = np.eye(3)[int(np.abs(z).argmin())]
    x = np.cross(helper, z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


def quaternion(rotation: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Unit quaternion (w, x, y, z) of a rotation matrix."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(rotation).as_quat().tolist()
    return w, x, y, z
