"""Shading by a distribution that looks at the surface before it draws: resampling, for one.

    radiance = (1/k) Σ L(ω) · f_r(ω) · n·ω · visibility(ω) · weight(ω)

over the k samples that the distribution gives for a shading point.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from renderer.given_samples import refusal, require_good, require_shape
from renderer.monte_carlo import NO_DENSITY, NO_SAMPLES, SampleSplit, is_independent
from renderer.packet.embree import LANES
from renderer.packet.estimate import shade_points
from renderer.packet.lane_samples import packet_numbers
from renderer.packet.lanes import aim_each, face_lights, packets_of
from renderer.packet.layout import BLUE, GREEN, PDF, RED, Given, Numbers
from renderer.packet.reflectance import draw, reflect, reflect_ward
from renderer.rays import RayCount
from renderer.view import View
from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.lighting import SurfaceDistribution, SurfaceSamples
from samplers.threads import for_blocks

BATCH = 1 << 15
"""Random points handled at once by a thread: the arrays between the stages stay in its cache."""
LEAST_POINTS, MOST_POINTS = 64, 4096
FIRST_STREAM = 4096
"""The distribution's sequences are this stream and those after it."""


@kernel
def _reflect_all(packets, ward, points, material, materials, direction, reflected, pdf):
    for b in range(len(packets)):
        packet, start = packets[b], points[0] + b * LANES
        for s in range(len(direction) // (len(packets) * LANES)):
            first = (s * len(packets) + b) * LANES
            aim_each(packet, direction, first)
            face_lights(packet)
            reflect(packet)
            if ward:
                reflect_ward(packet, start, points[1], material, materials)
            for k in range(LANES):
                reflected[first + k, 0] = packet[RED * LANES + k]
                reflected[first + k, 1] = packet[GREEN * LANES + k]
                reflected[first + k, 2] = packet[BLUE * LANES + k]
                pdf[first + k] = packet[PDF * LANES + k]


@dataclass(frozen=True, eq=False)
class PacketSurface:
    """The points points[0] … points[1] of a view as `samplers.lighting.Surface`.

    Lanes that are left over in the last packet repeat the last point.
    """

    _view: View
    points: tuple[int, int]

    @cached_property
    def packets(self) -> tuple[NDArray[np.float32], bool]:
        """The points as packets, and whether any follows Ward's model."""
        view = self._view
        found: tuple[NDArray[np.float32], bool] = packets_of(
            self.points, *view.surface, view.material, view.materials
        )
        return found

    @cached_property
    def _index(self) -> NDArray[np.int64]:
        start, stop = self.points
        return np.minimum(np.arange(start, start + len(self.packets[0]) * LANES), stop - 1)

    @property
    def position(self) -> NDArray[np.float32]:
        return self._view.position[self._index]

    @property
    def normal(self) -> NDArray[np.float32]:
        return self._view.normal[self._index]

    @property
    def toward_eye(self) -> NDArray[np.float32]:
        return self._view.toward_eye[self._index]

    @property
    def material(self) -> NDArray[np.int32]:
        return self._view.material[self._index]

    def _rows(self, array: NDArray) -> NDArray[np.float32]:
        """Samples (k, p, 3) as rows (k · p, 3)."""
        points = len(self.packets[0]) * LANES
        if array.ndim != 3 or array.shape[1:] != (points, 3):
            raise EnvlightError(f"surface: samples of shape {array.shape}, wanted (k, {points}, 3)")
        return np.ascontiguousarray(array, np.float32).reshape(-1, 3)

    def reflect(
        self, direction: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        rows, (packets, ward) = self._rows(direction), self.packets
        reflected, pdf = np.empty_like(rows), np.empty(len(rows), np.float32)
        view = self._view
        _reflect_all(
            packets, ward, self.points, view.material, view.materials, rows, reflected, pdf
        )
        return reflected.reshape(direction.shape), pdf.reshape(direction.shape[:2])

    def draw(self, u: NDArray[np.float32]) -> NDArray[np.float32]:
        rows, (packets, ward) = self._rows(u), self.packets
        direction, view = np.empty_like(rows), self._view
        draw(packets, ward, self.points, view.material, view.materials, rows, len(u), direction)
        return direction.reshape(u.shape)


def given_by(lighting: SurfaceDistribution, samples: SurfaceSamples, points: int) -> Given:
    """The samples as the kernel takes them, checked.

    What a weight divides by is the number of samples and the density.
    """
    direction = np.ascontiguousarray(samples.direction, np.float32)
    number = len(direction)
    if not 0 < number <= lighting.count:
        raise refusal(
            lighting, f"{number} samples at a point", f"1 to {lighting.count}, its count, is wanted"
        )
    require_shape(lighting, "directions", direction, (number, points, 3))
    weight = np.asarray(samples.weight, np.float64)
    require_shape(lighting, "weights", weight, (number, points))
    radiance = np.empty((0, 3), np.float32)
    if samples.radiance is not None:
        given = np.asarray(samples.radiance)
        require_shape(lighting, "radiances", given, direction.shape)
        radiance = np.ascontiguousarray(given, np.float32).reshape(-1, 3)
    direction, weight = direction.reshape(-1, 3), np.ascontiguousarray(weight).reshape(-1)
    require_good(lighting, direction, weight, radiance, "weight")
    density = np.divide(1.0, weight, out=np.zeros(len(weight)), where=weight > 0.0)
    return Given(direction, density, radiance, bool(samples.shadowed))


def shade_surface(
    view: View, environment: EnvironmentMap, lighting: SurfaceDistribution, seed: int
) -> tuple[NDArray[np.float32], RayCount]:
    """Radiance (n, 3) of the view's points by the distribution's samples at each.

    seed : chooses the scrambling of the low-discrepancy points
    Raises EnvlightError where the distribution gives other samples than it promised: too many, of
    other shapes, not of unit length, negative or not finite.
    """
    out = np.zeros((len(view), 3), np.float32)
    counts: list[RayCount] = []
    draws = tuple(lighting.draws)

    def shade(start: int, stop: int) -> None:
        surface = PacketSurface(view, (start, stop))
        points, numbers = -(-(stop - start) // LANES) * LANES, []
        for stream, count in enumerate(draws, FIRST_STREAM):
            u = np.empty((count * points, 3), np.float32)
            packet_numbers(
                (start, stop), view.pixel, view.subpixel, view.subpixels, 0, count, seed, stream,
                is_independent(lighting), u,
            )  # fmt: skip
            numbers.append(u.reshape(count, points, 3))
        samples = lighting.sample_at(surface, numbers)
        given = given_by(lighting, samples, points)
        traced, _ = shade_points(
            view.embree.handle, view.points, (start, stop), environment.radiance, NO_DENSITY,
            given, SampleSplit(len(samples.direction), 0), NO_SAMPLES, Numbers(seed), out,
        )  # fmt: skip
        rays = (stop - start) * len(samples.direction) if samples.shadowed else 0
        counts.append(RayCount(shadow=traced, skipped=rays - traced))

    step = BATCH // max(1, sum(draws))
    step = max(LEAST_POINTS, min(MOST_POINTS, step)) // LANES * LANES
    for_blocks(shade, len(view), step)
    return out, sum(counts, RayCount())
