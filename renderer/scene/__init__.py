"""Scenes: meshes with materials, seen by a camera."""

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from renderer.scene.materials import Material
from samplers.errors import EnvlightError


@dataclass(frozen=True, eq=False, repr=False)
class Mesh:
    """Triangles with normals at their vertices.

    vertex : (n, 3) float32
    normal : (n, 3) float32, unit; interpolated over each triangle
    triangle : (m, 3) int32, indices of vertices, counter-clockwise seen from outside
    """

    vertex: NDArray[np.float32]
    normal: NDArray[np.float32]
    triangle: NDArray[np.int32]

    def __post_init__(self) -> None:
        for name, dtype in (("vertex", np.float32), ("normal", np.float32), ("triangle", np.int32)):
            array = np.ascontiguousarray(getattr(self, name), dtype)
            if array.ndim != 2 or array.shape[1] != 3:
                raise EnvlightError(f"mesh: {name} has shape {array.shape}, wanted (n, 3)")
            object.__setattr__(self, name, array)
        if not (np.isfinite(self.vertex).all() and np.isfinite(self.normal).all()):
            raise EnvlightError("mesh: a vertex or normal is NaN or infinite; clean the mesh")
        if len(self.triangle) == 0:
            raise EnvlightError("mesh: it has no triangles; give a surface, not points")
        if self.triangle.min() < 0 or self.triangle.max() >= len(self.vertex):
            raise EnvlightError("mesh: a triangle names a vertex that does not exist")
        if len(self.normal) != len(self.vertex):
            raise EnvlightError("mesh: as many normals as vertices are needed")


@dataclass(frozen=True, eq=False)
class Object:
    """A mesh of one material."""

    name: str
    mesh: Mesh
    material: Material


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    eye, target : positions; up : any vector not along the view
    field_of_view : vertical, in degrees
    """

    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    field_of_view: float = 40.0
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("eye", "target", "up"):
            value = np.asarray(getattr(self, name), np.float64)
            if value.shape != (3,) or not np.isfinite(value).all():
                raise EnvlightError(
                    f"camera: {name} is {getattr(self, name)}; give three finite numbers"
                )
            object.__setattr__(self, name, tuple(value.tolist()))
        if not 0.0 < self.field_of_view < 180.0:
            raise EnvlightError(
                f"camera: a field of view of {self.field_of_view}; give degrees between 0 and 180"
            )
        forward = np.subtract(self.target, self.eye)
        if not np.linalg.norm(forward) > 0.0:
            raise EnvlightError("camera: eye and target are the same point; move one of them")
        size = np.linalg.norm(forward) * np.linalg.norm(self.up)
        if not np.linalg.norm(np.cross(forward, self.up)) > 1e-6 * size:
            raise EnvlightError("camera: up points along the view or is zero; turn it aside")


@dataclass(frozen=True, eq=False)
class Scene:
    """Objects and the camera that sees them."""

    name: str
    objects: tuple[Object, ...]
    camera: Camera

    def __post_init__(self) -> None:
        if not self.objects:
            raise EnvlightError(f"scene '{self.name}': it has no objects")
        names = sorted(item.name for item in self.objects)
        twice = [name for k, name in enumerate(names[1:]) if name == names[k]]
        if twice:
            raise EnvlightError(
                f"scene '{self.name}': two objects are called '{twice[0]}'; rename one"
            )

    def __repr__(self) -> str:
        return f"Scene({self.name!r}, {len(self.objects)} objects)"

    @cached_property
    def digest(self) -> str:
        """Hash of the geometry, the materials and the camera, in hexadecimal."""
        hasher = hashlib.blake2b(digest_size=16)
        hasher.update(repr(self.camera).encode())
        for item in self.objects:
            hasher.update(repr(item.material).encode())
            for array in (item.mesh.vertex, item.mesh.normal, item.mesh.triangle):
                hasher.update(repr(array.shape).encode())
                hasher.update(array.data)
        return hasher.hexdigest()
