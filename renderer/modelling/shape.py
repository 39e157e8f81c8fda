"""Shapes: vertices and triangles without normals, and how they move, join and mirror.

Builders make shapes in float64, scenes move and merge them, and `normals.shade` turns the result
into a mesh at the very end; so no transform has to care for normals.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

OFF_GRID = 0.381966
"""Keeps the bounds of welding cells away from simple fractions of a size, where vertices like to
be and rounding errors would put twins into two cells."""
Matrix = NDArray[np.float64]
IDENTITY = np.eye(3)
AXES = {"x": 0, "y": 1, "z": 2}


@dataclass(frozen=True, eq=False)
class Shape:
    """Triangles without normals.

    vertex : (n, 3) float64
    triangle : (m, 3) int64, counter-clockwise seen from outside
    """

    vertex: NDArray[np.float64]
    triangle: NDArray[np.int64]

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> "Shape":
        return Shape(self.vertex + np.array([x, y, z]), self.triangle)

    def scaled(self, x: float, y: float | None = None, z: float | None = None) -> "Shape":
        """Scaled along the axes, by `x` where `y` or `z` is missing. A mirror keeps outside out."""
        factor = np.array([x, x if y is None else y, x if z is None else z])
        mirrored = np.prod(factor) < 0.0
        return Shape(self.vertex * factor, self.triangle[:, ::-1] if mirrored else self.triangle)

    def turned(self, axis: Literal["x", "y", "z"], degrees: float) -> "Shape":
        """Turned about an axis through the origin, right-handed."""
        angle = np.radians(degrees)
        first, second = (AXES[axis] + 1) % 3, (AXES[axis] + 2) % 3
        vertex = self.vertex.copy()
        a, b = self.vertex[:, first], self.vertex[:, second]
        vertex[:, first] = np.cos(angle) * a - np.sin(angle) * b
        vertex[:, second] = np.sin(angle) * a + np.cos(angle) * b
        return Shape(vertex, self.triangle)

    def placed(self, matrix: Matrix) -> "Shape":
        """Moved by an affine matrix (4, 4). A mirror keeps outside out."""
        mirrored = np.linalg.det(matrix[:3, :3]) < 0.0
        vertex = self.vertex @ matrix[:3, :3].T + matrix[:3, 3]
        return Shape(vertex, self.triangle[:, ::-1] if mirrored else self.triangle)

    def resting(self, height: float = 0.0) -> "Shape":
        """Moved up or down until its lowest point is at `height` exactly."""
        vertex = self.vertex.copy()
        vertex[:, 1] += height - vertex[:, 1].min()
        return Shape(vertex, self.triangle)


def affine(linear: ArrayLike = IDENTITY, offset: ArrayLike = (0.0, 0.0, 0.0)) -> Matrix:
    """A matrix (4, 4) of a linear map (3, 3) and what is added to it."""
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = linear, offset
    return result


def rotation(degrees: float, axis: ArrayLike) -> Matrix:
    """A turn (3, 3) about an axis of any length through the origin, right-handed."""
    from scipy.spatial.transform import Rotation

    unit = np.asarray(axis, np.float64) / np.linalg.norm(axis)
    return np.asarray(Rotation.from_rotvec(np.radians(degrees) * unit).as_matrix())


def look_at(eye: ArrayLike, target: ArrayLike, up: ArrayLike) -> Matrix:
    """From a frame to the world (4, 4): +Z is from eye to target, +X is up × +Z, +Y is upward."""
    ahead = np.subtract(target, eye).astype(np.float64)
    side = np.cross(np.asarray(up, np.float64), ahead)
    if not (side.any() and np.isfinite(side).all()):
        raise ValueError("up points along the view")
    side, ahead = side / np.linalg.norm(side), ahead / np.linalg.norm(ahead)
    return affine(np.stack([side, np.cross(ahead, side), ahead], axis=1), eye)


def merge(*shapes: Shape) -> Shape:
    """All triangles in one shape; vertices are not welded."""
    start = np.cumsum([0] + [len(shape.vertex) for shape in shapes[:-1]])
    return Shape(
        np.concatenate([shape.vertex for shape in shapes]),
        np.concatenate(
            [shape.triangle + first for shape, first in zip(shapes, start, strict=True)]
        ),
    )


def weld(shape: Shape, tolerance: float = 1e-7) -> Shape:
    """One vertex where several coincide; triangles that lose an edge by it are dropped.

    tolerance : of a position, relative to the longest side of the shape's bounding box
    """
    low = shape.vertex.min(axis=0)
    size = float((shape.vertex.max(axis=0) - low).max()) or 1.0
    cell = np.floor((shape.vertex - low) / (tolerance * size) + OFF_GRID).astype(np.int64)
    order = np.lexsort(cell.T)
    fresh = np.ones(len(order), bool)
    fresh[1:] = (cell[order[1:]] != cell[order[:-1]]).any(axis=1)
    index = np.empty(len(order), np.int64)
    index[order] = np.cumsum(fresh) - 1
    triangle = index[shape.triangle]
    a, b, c = triangle.T
    kept = triangle[(a != b) & (b != c) & (c != a)]
    used, compact = np.unique(kept, return_inverse=True)
    return Shape(shape.vertex[order[fresh]][used], compact.reshape(-1, 3))
