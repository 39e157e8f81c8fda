"""A white diffuse surface in the open: where what samplers make of a map is checked."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers.environment import EnvironmentMap
from samplers.lighting import (
    LightDistribution,
    PictureDistribution,
    SurfaceDistribution,
    SurfaceSamples,
)
from samplers.sphere import pixel_directions

TEXEL_PARTS = 8
"""Points along each side of a texel by which its irradiance is summed."""
NORMALS_AT_ONCE = 16


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


PICTURE_WIDTH = 16


@dataclass(frozen=True, eq=False)
class OpenPicture:
    """`samplers.lighting.Picture` of such surfaces, a pixel each, sixteen in a row."""

    normal: NDArray[np.float32]
    rng: np.random.Generator

    @property
    def width(self) -> int:
        return PICTURE_WIDTH

    @property
    def height(self) -> int:
        return -(-len(self.normal) // PICTURE_WIDTH)

    @property
    def depth(self) -> NDArray[np.float32]:
        return np.ones(len(self.normal), np.float32)

    @property
    def pixel(self) -> NDArray[np.int32]:
        return np.arange(len(self.normal), dtype=np.int32)

    @property
    def by_pixel(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        points, pixels = len(self.normal), self.width * self.height
        return np.arange(points), np.minimum(np.arange(pixels + 1), points)

    def numbers(self, stream: int, start: int, stop: int, count: int) -> NDArray[np.float32]:
        return self.rng.random((count, stop - start, 3), np.float32)

    def reflect_at(
        self, point: NDArray[np.int64], direction: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        return OpenSurface(self.normal[point]).reflect(direction)

    def draw_at(self, point: NDArray[np.int64], u: NDArray[np.float32]) -> NDArray[np.float32]:
        return OpenSurface(self.normal[point]).draw(u)

    def sees(
        self, point: NDArray[np.int64], direction: NDArray[np.float32], asked: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        return asked.copy()


def samples_of(
    lighting: SurfaceDistribution, surface: OpenSurface, rng: np.random.Generator
) -> SurfaceSamples:
    """Samples at the surface by independent random numbers."""
    points = len(surface.normal)
    numbers = [rng.random((count, points, 3), np.float32) for count in lighting.draws]
    return lighting.sample_at(surface, numbers)


def allowed_irradiance_error(count: int) -> float:
    """Share by which the irradiance of an open plane may be off under `count` > 6 lights.

    A light that stands for a region within the angle α around it gives a plane at most 1 / cos α of
    what the region does: max(0, n · ω) is convex, so the region gives no less than its mean
    direction would, and that is no shorter than cos α. Over all normals a light gives on average
    what its region does, a fourth of its flux; so where some planes get too much, others get too
    little, and as much is allowed of that. Of a sphere that is lit evenly each light has 4π / count
    sr. Regions differ in size, by 2 where they are halved, and in shape: none should need a cap of
    more than three times that, sin²(α/2) = 3 / count; where light is in fewer places, less will do.
    Hence cos α = 1 − 6 / count.
    """
    return 6.0 / (count - 6.0)


def irradiance_of(environment: EnvironmentMap, normal: NDArray[np.floating]) -> NDArray[np.float64]:
    """Irradiance (p, 3) of open surfaces with normals (p, 3): a sum over the map's texels.

    Each texel is cut into `TEXEL_PARTS`².
    """
    radiance = environment.radiance.repeat(TEXEL_PARTS, axis=0).repeat(TEXEL_PARTS, axis=1)
    fine = EnvironmentMap(radiance)
    flux = (radiance * fine.row_solid_angle[:, None, None]).reshape(-1, 3)
    way = pixel_directions(fine.height).reshape(-1, 3)
    parts = np.array_split(normal.astype(np.float64), -(-len(normal) // NORMALS_AT_ONCE))
    return np.concatenate([np.maximum(part @ way.T, 0.0) @ flux for part in parts])


def reflected(
    lighting: LightDistribution | SurfaceDistribution,
    environment: EnvironmentMap,
    surface: OpenSurface,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Estimates (p, 3) of the radiance that the surface reflects, by independent random numbers."""
    if isinstance(lighting, SurfaceDistribution):
        if not isinstance(lighting, PictureDistribution):
            return _shone(samples_of(lighting, surface, rng), environment, surface).mean(0)
        batches = lighting.sample_picture(OpenPicture(surface.normal, rng))
        return np.concatenate([_shone(one, environment, surface) for one in batches]).mean(0)
    return _by_both_techniques(lighting, environment, surface, rng)


def _shone(
    samples: SurfaceSamples, environment: EnvironmentMap, surface: OpenSurface
) -> NDArray[np.float64]:
    """What each sample adds to the radiance that the surface reflects, (k, p, 3)."""
    light = samples.radiance
    if light is None:
        light = _radiance(environment, samples.direction)
    return light * surface.reflect(samples.direction)[0] * samples.weight[..., None]


def _by_both_techniques(
    lighting: LightDistribution,
    environment: EnvironmentMap,
    surface: OpenSurface,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Half of the samples of the light, the odd one among them, half of the BRDF; power heuristic.

    Σ over techniques i of mean over its samples of L f cos / p_i · (n_i p_i)² / Σ_j (n_j p_j)².
    """
    points, total = len(surface.normal), np.zeros((len(surface.normal), 3))
    number = (lighting.count - lighting.count // 2, lighting.count // 2)
    for own, count in enumerate(number):
        if count == 0:
            continue
        u = rng.random((count, points, 3), np.float32)
        way = surface.draw(u) if own else lighting.sample(u.reshape(-1, 3))[0].reshape(u.shape)
        value, brdf = surface.reflect(way)
        light = lighting.pdf(np.ascontiguousarray(way.reshape(-1, 3))).reshape(brdf.shape)
        pdf = np.stack([light, brdf]).astype(np.float64)
        share = (np.array(number)[:, None, None] * pdf) ** 2
        weight = np.divide(
            share[own], share.sum(0) * pdf[own], out=np.zeros(brdf.shape), where=pdf[own] > 0.0
        )
        total += (_radiance(environment, way) * value * weight[..., None]).mean(0)
    return total


def _radiance(environment: EnvironmentMap, direction: NDArray[np.float32]) -> NDArray[np.float32]:
    return environment.lookup(direction.reshape(-1, 3)).reshape(direction.shape)
