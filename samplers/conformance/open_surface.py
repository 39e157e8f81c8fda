"""A white diffuse surface in the open: where distributions that see the surface are checked."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers.lighting import SurfaceDistribution, SurfaceSamples


@dataclass(frozen=True, eq=False)
class OpenSurface:
    """`samplers.lighting.Surface` in plain NumPy: Lambert's, albedo 1, seen along its normals.

    normal : (p, 3) float32, unit
    """

    normal: NDArray[np.float32]

    @classmethod
    def turned(cls, points: int) -> "OpenSurface":
        """Normals in all directions, the same for the same number of points."""
        normal = np.random.default_rng(0).normal(size=(points, 3))
        return cls((normal / np.linalg.norm(normal, axis=1, keepdims=True)).astype(np.float32))

    @property
    def position(self) -> NDArray[np.float32]:
        return np.zeros_like(self.normal)

    @property
    def toward_eye(self) -> NDArray[np.float32]:
        return self.normal

    @property
    def material(self) -> NDArray[np.int32]:
        return np.zeros(len(self.normal), np.int32)

    def reflect(
        self, direction: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """f_r · n·l and pdf are both n·l / π."""
        cosine = np.maximum((direction * self.normal).sum(axis=-1), 0.0) / np.float32(math.pi)
        return np.repeat(cosine[..., None], 3, axis=-1), cosine

    def draw(self, u: NDArray[np.float32]) -> NDArray[np.float32]:
        """The normal plus a point that is uniform on the unit sphere, made unit."""
        z, phi = 1.0 - 2.0 * u[..., 0].astype(np.float64), 2.0 * math.pi * u[..., 1]
        sine = np.sqrt(np.maximum(1.0 - z * z, 0.0))
        point = np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=-1) + self.normal
        length = np.linalg.norm(point, axis=-1, keepdims=True)
        unit = np.where(length > 1e-6, point / np.maximum(length, 1e-6), self.normal)
        return unit.astype(np.float32)


def samples_of(
    lighting: SurfaceDistribution, surface: OpenSurface, rng: np.random.Generator
) -> SurfaceSamples:
    """Samples at the surface by independent random numbers."""
    points = len(surface.normal)
    numbers = [rng.random((count, points, 3), np.float32) for count in lighting.draws]
    return lighting.sample_at(surface, numbers)
