"""Sums over every texel of a map: what it is, and what a lighting makes of it.

Sums that judge a lighting are in extended precision where the machine has it, and by formulas of
their own, so that they share no rounding with what they judge. Integrals over a texel are exact for
a radiance that is constant over it.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers import (
    DirectionalLights,
    DiscLights,
    EnvironmentMap,
    LayeredLights,
    Lighting,
    SurfaceDistribution,
)
from samplers.sphere import direction_from_uv

TEXELS = 1 << 20
"""Texels handled at once."""
PLATES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], np.float64)
"""Normals of six plates: the faces of a cube."""
CAP_POINTS = 1024
SAMPLES, REPETITIONS = 64, 256
"""Samples of a distribution in an estimate, and estimates whose mean square error is taken."""


def texel_solid_angle(height: int) -> NDArray[np.longdouble]:
    """Solid angle in sr of a texel of each row of H × 2H texels, (H,).

    cos θ₁ − cos θ₂ is written as 2 sin²(θ₂/2) − 2 sin²(θ₁/2), and mirrored below the equator.
    """
    edge = np.arange(height + 1, dtype=np.longdouble) * (np.longdouble(math.pi) / height)
    band = np.diff(2.0 * np.sin(0.5 * edge) ** 2)
    band[(height + 1) // 2 :] = band[: height // 2][::-1]
    return band * (np.longdouble(math.pi) / height)


def _row_blocks(height: int, width: int) -> list[slice]:
    rows = max(1, TEXELS // width)
    return [slice(start, min(start + rows, height)) for start in range(0, height, rows)]


def total_flux(radiance: NDArray[np.float32]) -> NDArray[np.float64]:
    """∫ L dω per channel, (3,), summed in extended precision."""
    height, width = radiance.shape[:2]
    solid_angle = texel_solid_angle(height)
    total = np.zeros(3, np.longdouble)
    for rows in _row_blocks(height, width):
        total += solid_angle[rows] @ radiance[rows].sum(axis=1, dtype=np.longdouble)
    return total.astype(np.float64)


def _facing(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """∫ max(0, sin) from 0 to the angle."""
    turn = np.floor(angle / (2.0 * math.pi))
    return 2.0 * turn + 1.0 - np.cos(np.minimum(angle - 2.0 * math.pi * turn, math.pi))


def map_irradiance(radiance: NDArray[np.float32]) -> NDArray[np.float64]:
    """∫ L max(0, n·ω) dω on the six plates, (6, 3)."""
    height, width = radiance.shape[:2]
    theta = np.arange(height + 1) * (math.pi / height)
    phi = np.arange(width + 1) * (2.0 * math.pi / width)
    # x = sin φ sin θ and z = −cos φ sin θ: each horizontal plate sees a shifted half of a sine.
    shifts = (0.0, math.pi, 0.5 * math.pi, -0.5 * math.pi)
    across = np.stack([np.diff(_facing(phi - shift)) for shift in shifts])
    level = np.diff(0.5 * (theta - np.sin(theta) * np.cos(theta)))
    up = np.diff(0.5 * np.sin(np.minimum(theta, 0.5 * math.pi)) ** 2) * (2.0 * math.pi / width)
    result = np.zeros((6, 3))
    for rows in _row_blocks(height, width):
        part = radiance[rows].astype(np.float64)
        sums = part.sum(axis=1)
        result[2] += up[rows] @ sums
        result[3] += up[::-1][rows] @ sums
        result[[0, 1, 4, 5]] += np.einsum("kc,rcj,r->kj", across, part, level[rows], optimize=True)
    return result


def irradiance_error(
    lighting: Lighting, environment: EnvironmentMap, truth: NDArray[np.float64]
) -> float:
    """Error of the irradiance (6, 3) on the plates: root mean square over that of the truth.

    A distribution gives estimates from 64 samples of its own, each over its density.
    """
    size = float(np.sqrt(np.mean(truth**2)))
    if size == 0.0:
        return float("nan")
    estimate = _irradiance(lighting, environment)
    return float(np.sqrt(np.mean(((estimate - truth) / size) ** 2)))


def _irradiance(lighting: Lighting, environment: EnvironmentMap) -> NDArray[np.float64]:
    match lighting:
        case DirectionalLights():
            return np.maximum(PLATES @ lighting.direction.T, 0.0) @ lighting.irradiance
        case LayeredLights():
            return _irradiance(lighting.direct, environment) + _irradiance(
                lighting.indirect, environment
            )
        case DiscLights():
            return _disc_irradiance(lighting) + map_irradiance(lighting.ambient.radiance)
        case SurfaceDistribution():
            return np.full((len(PLATES), 3), np.nan)  # it has no light without a surface
    u = np.random.default_rng(0).random((SAMPLES * REPETITIONS, 3), np.float32)
    direction, pdf = lighting.sample(u)
    value = environment.lookup(direction) / pdf[:, None].astype(np.float64)
    cosine = np.maximum(direction.astype(np.float64) @ PLATES.T, 0.0)
    estimate = np.einsum(
        "rsp,rsc->rpc",
        cosine.reshape(REPETITIONS, SAMPLES, len(PLATES)),
        value.reshape(REPETITIONS, SAMPLES, 3),
    )
    return estimate / SAMPLES


def _disc_irradiance(lights: DiscLights) -> NDArray[np.float64]:
    """Irradiance (6, 3) by the discs, by points of a spiral in each."""
    k = np.arange(CAP_POINTS) + 0.5
    turn = k * (math.pi * (3.0 - math.sqrt(5.0)))
    result = np.zeros((6, 3))
    for centre, irradiance, half_angle in zip(
        lights.direction, lights.irradiance, lights.half_angle, strict=True
    ):
        theta = 2.0 * np.arcsin(np.sqrt(k / CAP_POINTS) * math.sin(0.5 * half_angle))
        axis = np.eye(3)[np.argmin(np.abs(centre))]
        tangent = np.cross(axis, centre)
        tangent /= np.linalg.norm(tangent)
        side = np.outer(np.cos(turn), tangent) + np.outer(np.sin(turn), np.cross(centre, tangent))
        direction = np.cos(theta)[:, None] * centre + np.sin(theta)[:, None] * side
        cosine = np.maximum(direction @ PLATES.T, 0.0).mean(axis=0)
        result += np.outer(cosine, irradiance)
    return result


def unreached_flux(environment: EnvironmentMap, mass: NDArray[np.float64]) -> float:
    """Share of the map's flux in texels of which a distribution never draws: their mass is 0."""
    solid_angle = texel_solid_angle(environment.height)
    reached = total = np.longdouble(0.0)
    for rows in _row_blocks(environment.height, environment.width):
        flux = environment.luminance[rows] * solid_angle[rows, None]
        total += flux.sum(dtype=np.longdouble)
        reached += flux[mass[rows] > 0.0].sum(dtype=np.longdouble)
    return float(1.0 - reached / total) if total > 0.0 else 0.0


@dataclass(frozen=True, eq=False)
class Probes:
    """Random places of a map of `height` rows, as many in each texel as in any other.

    u, v : (n,) off every edge and centre of a texel, where densities step
    solid_angle : (n,) in sr, of the texel that each lies in
    """

    u: NDArray[np.float64]
    v: NDArray[np.float64]
    solid_angle: NDArray[np.float64]

    @classmethod
    def of(cls, height: int, count: int) -> "Probes":
        rng = np.random.default_rng(2)
        v, u = rng.random(count), rng.random(count)
        row = (v * height).astype(int)
        return cls(u, v, texel_solid_angle(height).astype(np.float64)[row])

    def directions(self, turn: float = 0.0) -> NDArray[np.float32]:
        """Directions (n, 3), turned by a share of a full turn."""
        return direction_from_uv(self.u + turn, self.v).astype(np.float32)
