"""Shading by a distribution that looks at the surface before it draws: resampling, for one.

    radiance = (1/k) Σ L(ω) · f_r(ω) · n·ω · visibility(ω) · weight(ω)

over the k samples that the distribution gives for a shading point.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from renderer.packet.embree import LANES, T_FAR, new_valid, occluded, query_arguments
from renderer.packet.lane_samples import look_up, packet_numbers, store_packets
from renderer.packet.lanes import aim_each, face_lights, packets_of
from renderer.packet.layout import BLUE, FACING, GREEN, PDF, RED, ZERO
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

    view: View
    points: tuple[int, int]

    @cached_property
    def packets(self) -> tuple[NDArray[np.float32], bool]:
        """The points as packets, and whether any follows Ward's model."""
        view = self.view
        surface = (view.position, view.normal, view.geometric, view.toward_eye)
        found: tuple[NDArray[np.float32], bool] = packets_of(
            self.points, *surface, view.material, view.materials
        )
        return found

    @cached_property
    def _index(self) -> NDArray[np.int64]:
        start, stop = self.points
        return np.minimum(np.arange(start, start + len(self.packets[0]) * LANES), stop - 1)

    @property
    def position(self) -> NDArray[np.float32]:
        return self.view.position[self._index]

    @property
    def normal(self) -> NDArray[np.float32]:
        return self.view.normal[self._index]

    @property
    def toward_eye(self) -> NDArray[np.float32]:
        return self.view.toward_eye[self._index]

    @property
    def material(self) -> NDArray[np.int32]:
        return self.view.material[self._index]

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
        view = self.view
        _reflect_all(
            packets, ward, self.points, view.material, view.materials, rows, reflected, pdf
        )
        return reflected.reshape(direction.shape), pdf.reshape(direction.shape[:2])

    def draw(self, u: NDArray[np.float32]) -> NDArray[np.float32]:
        rows, (packets, ward) = self._rows(u), self.packets
        direction, view = np.empty_like(rows), self.view
        draw(packets, ward, self.points, view.material, view.materials, rows, len(u), direction)
        return direction.reshape(u.shape)


@kernel
def _gather(
    scene, packets, ward, points, material, materials, environment, direction, weight, radiance,
    shadowed, total,
):  # fmt: skip
    """Add the samples' light to `total` (packets, 48); returns the rays traced.

    direction : (rows, 3); weight : (rows,), divided by the number of samples
    radiance : (rows, 3), or (0, 3) for the map's
    """
    valid, arguments = new_valid(), query_arguments(False)
    texel, light = np.empty(2 * LANES, np.int32), np.empty(3 * LANES)
    traced = 0
    for b in range(len(packets)):
        packet, start = packets[b], points[0] + b * LANES
        for s in range(len(weight) // (len(packets) * LANES)):
            first = (s * len(packets) + b) * LANES
            aim_each(packet, direction, first)
            if face_lights(packet) == 0:
                continue
            reflect(packet)
            if ward:
                reflect_ward(packet, start, points[1], material, materials)
            if len(radiance) == 0:
                look_up(packet, environment, texel, light)
            else:
                for k in range(LANES):
                    for channel in range(3):
                        light[channel * LANES + k] = radiance[first + k, channel]
            marked = 0
            for k in range(LANES):
                scale = weight[first + k]
                light[k] *= packet[RED * LANES + k] * scale
                light[LANES + k] *= packet[GREEN * LANES + k] * scale
                light[2 * LANES + k] *= packet[BLUE * LANES + k] * scale
                carries = (
                    (light[k] != 0.0) | (light[LANES + k] != 0.0) | (light[2 * LANES + k] != 0.0)
                )
                facing = packet[FACING * LANES + k] != ZERO
                used = facing & carries & (k < points[1] - start)
                valid[k] = -1 if used else 0
                marked += 1 if used else 0
            for k in range(LANES):
                packet[T_FAR * LANES + k] = ZERO
            if shadowed and marked > 0:
                occluded(scene, valid, packet, arguments)
                traced += marked
            for k in range(LANES):
                if (valid[k] != 0) & (packet[T_FAR * LANES + k] >= ZERO):
                    total[b, k] += light[k]
                    total[b, LANES + k] += light[LANES + k]
                    total[b, 2 * LANES + k] += light[2 * LANES + k]
    return traced


def _rows_of(samples: SurfaceSamples, points: int) -> tuple[NDArray, NDArray, NDArray]:
    """Direction, weight and radiance as the kernel takes them, checked."""
    direction = np.ascontiguousarray(samples.direction, np.float32)
    shape = direction.shape
    if len(shape) != 3 or shape[0] == 0 or shape[1:] != (points, 3):
        raise EnvlightError(f"lighting: samples have shape {shape}, wanted (k, {points}, 3)")
    weight = np.array(samples.weight, np.float64) / shape[0]
    if weight.shape != shape[:2]:
        raise EnvlightError(f"lighting: weights have shape {weight.shape}, wanted {shape[:2]}")
    if not (weight >= 0.0).all():
        raise EnvlightError("lighting: a weight is negative or NaN")
    radiance = np.empty((0, 3), np.float32)
    if samples.radiance is not None:
        if samples.radiance.shape != shape:
            raise EnvlightError(
                f"lighting: radiances have shape {samples.radiance.shape}, wanted {shape}"
            )
        radiance = np.ascontiguousarray(samples.radiance, np.float32).reshape(-1, 3)
    return direction.reshape(-1, 3), weight.reshape(-1), radiance


def shade_surface(
    view: View, environment: EnvironmentMap, lighting: SurfaceDistribution, seed: int
) -> tuple[NDArray[np.float32], RayCount]:
    """Radiance (n, 3) of the view's points by the distribution's samples at each.

    seed : chooses the scrambling of the low-discrepancy points
    Raises EnvlightError where the distribution returns arrays of other shapes than it promised.
    """
    out = np.zeros((len(view), 3), np.float32)
    counts: list[RayCount] = []
    draws = tuple(lighting.draws)

    def shade(start: int, stop: int) -> None:
        surface = PacketSurface(view, (start, stop))
        packets, ward = surface.packets
        points, numbers = len(packets) * LANES, []
        for stream, count in enumerate(draws, FIRST_STREAM):
            u = np.empty((count * points, 3), np.float32)
            packet_numbers(
                (start, stop), view.pixel, view.subpixel, view.subpixels, 0, count, seed, stream,
                False, u,
            )  # fmt: skip
            numbers.append(u.reshape(count, points, 3))
        samples = lighting.sample_at(surface, numbers)
        direction, weight, radiance = _rows_of(samples, points)
        total = np.zeros((len(packets), 3 * LANES))
        traced = _gather(
            view.embree.handle, packets, ward, (start, stop), view.material, view.materials,
            environment.radiance, direction, weight, radiance, samples.shadowed, total,
        )  # fmt: skip
        store_packets(total, (start, stop), out)
        rays = (stop - start) * len(samples.direction) if samples.shadowed else 0
        counts.append(RayCount(shadow=traced, skipped=rays - traced))

    step = BATCH // max(1, sum(draws))
    step = max(LEAST_POINTS, min(MOST_POINTS, step)) // LANES * LANES
    for_blocks(shade, len(view), step)
    return out, sum(counts, RayCount())
