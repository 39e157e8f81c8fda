"""Shading by a distribution that looks at all points of a picture: reuse between neighbours.

What a `samplers.lighting.PictureDistribution` may ask of the picture, in kernels over any points in
any order, sixteen at a time; and the shading of the samples that it gives.
"""

import threading
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.given_samples import refusal
from renderer.monte_carlo import BATCH, NO_DENSITY, NO_SAMPLES, SampleSplit
from renderer.packet.embree import DIR_X, LANES, T_FAR, new_valid, occluded, query_arguments
from renderer.packet.estimate import shade_points
from renderer.packet.lane_samples import NUMBERS_SIZE, packet_numbers
from renderer.packet.lanes import aim_each, face_lights, fill_packet, lane_materials
from renderer.packet.layout import BLUE, GREEN, PDF, RED, ZERO, Numbers, new_packets
from renderer.packet.reflectance import draw_packet, reflect, reflect_ward
from renderer.rays import RayCount
from renderer.surface import FIRST_STREAM, given_by
from renderer.view import View
from samplers.compiled import inner, kernel
from samplers.environment import EnvironmentMap
from samplers.lighting import PictureDistribution, SurfaceSamples
from samplers.threads import block_of, for_blocks

POINT_BLOCK = 1024
"""Points that a thread shades at once, at least."""


@kernel
def _new_room(materials):
    """A packet, and sixteen points as it takes them."""
    vectors = np.empty((4, LANES, 3), np.float32)
    return (
        new_packets(1)[0], lane_materials(materials), vectors, np.empty(LANES, np.int32),
        np.empty((LANES, 3), np.float32),
    )  # fmt: skip


@inner
def _gather(points, index, first, used, room):
    """Fill the packet with points index[first] …, the last one in spare lanes; see fill_packet."""
    packet, lanes, vectors, material, _ = room
    for k in range(LANES):
        i = index[first + min(k, used - 1)]
        for axis in range(3):
            vectors[0, k, axis] = points.position[i, axis]
            vectors[1, k, axis] = points.normal[i, axis]
            vectors[2, k, axis] = points.geometric[i, axis]
            vectors[3, k, axis] = points.toward_eye[i, axis]
        material[k] = points.material[i]
    return fill_packet(
        packet, 0, used, vectors[0], vectors[1], vectors[2], vectors[3], material, lanes
    )


@inner
def _aim_at(direction, first, used, room):
    packet, _, _, _, way = room
    for k in range(LANES):
        for axis in range(3):
            way[k, axis] = direction[first + min(k, used - 1), axis]
    aim_each(packet, way, 0)


@kernel
def _reflect_at(points, index, direction, reflected, pdf):
    room = _new_room(points.materials)
    packet, material = room[0], room[3]
    for first in range(0, len(index), LANES):
        used = min(LANES, len(index) - first)
        ward = _gather(points, index, first, used, room)
        _aim_at(direction, first, used, room)
        face_lights(packet)
        reflect(packet)
        if ward:
            reflect_ward(packet, 0, used, material, points.materials)
        for k in range(used):
            reflected[first + k, 0] = packet[RED * LANES + k]
            reflected[first + k, 1] = packet[GREEN * LANES + k]
            reflected[first + k, 2] = packet[BLUE * LANES + k]
            pdf[first + k] = packet[PDF * LANES + k]


@kernel
def _draw_at(points, index, u, direction):
    room, numbers = _new_room(points.materials), np.zeros(NUMBERS_SIZE, np.float32)
    packet, material = room[0], room[3]
    for first in range(0, len(index), LANES):
        used = min(LANES, len(index) - first)
        ward = _gather(points, index, first, used, room)
        for k in range(used):
            for axis in range(3):
                numbers[axis * LANES + k] = u[first + k, axis]
        draw_packet(packet, ward, 0, used, material, points.materials, numbers)
        for k in range(used):
            for axis in range(3):
                direction[first + k, axis] = packet[(DIR_X + axis) * LANES + k]


@kernel
def _sees(scene, points, index, direction, asked, seen):
    room, valid, arguments = _new_room(points.materials), new_valid(), query_arguments(False)
    packet, traced = room[0], 0
    for first in range(0, len(index), LANES):
        used, marked = min(LANES, len(index) - first), 0
        for k in range(LANES):
            here = k < used and asked[first + min(k, used - 1)]
            valid[k] = -1 if here else 0
            marked += 1 if here else 0
        if marked > 0:
            _gather(points, index, first, used, room)
            _aim_at(direction, first, used, room)
            occluded(scene, valid, packet, arguments)
        for k in range(used):
            seen[first + k] = valid[k] != 0 and packet[T_FAR * LANES + k] >= ZERO
        traced += marked
    return traced


def _read_only(array: NDArray) -> NDArray:
    """The same memory, which others share, to be read alone."""
    seen = array.view()
    seen.flags.writeable = False
    return seen


@dataclass(frozen=True, eq=False)
class ViewPicture:
    """A view as `samplers.lighting.Picture`.

    traced : numbers of rays, of which each call adds one
    """

    _view: View
    seed: int
    traced: list[int] = field(default_factory=list)
    _lock: Any = field(default_factory=threading.Lock, repr=False)

    @property
    def width(self) -> int:
        return self._view.width

    @property
    def height(self) -> int:
        return self._view.height

    @property
    def normal(self) -> NDArray[np.float32]:
        return _read_only(self._view.normal)

    @property
    def depth(self) -> NDArray[np.float32]:
        return _read_only(self._view.depth)

    @property
    def pixel(self) -> NDArray[np.int32]:
        return _read_only(self._view.pixel)

    @property
    def by_pixel(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        def find() -> tuple[NDArray[np.int64], NDArray[np.int64]]:
            count = np.bincount(self.pixel, minlength=self.width * self.height)
            bounds = np.concatenate([[0], np.cumsum(count)])
            return _read_only(np.argsort(self.pixel, kind="stable")), _read_only(bounds)

        return self._view.kept("by pixel", find)

    def numbers(self, stream: int, start: int, stop: int, count: int) -> NDArray[np.float32]:
        packets, view = -(-(stop - start) // LANES), self._view
        u = np.empty((count * packets * LANES, 3), np.float32)
        packet_numbers(
            (start, stop), view.pixel, view.subpixel, view.subpixels, 0, count, self.seed,
            FIRST_STREAM + stream, True, u,
        )  # fmt: skip
        return u.reshape(count, packets * LANES, 3)[:, : stop - start]

    def reflect_at(
        self, point: NDArray[np.int64], direction: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        reflected, pdf = np.empty((len(point), 3), np.float32), np.empty(len(point), np.float32)
        _reflect_at(self._view.points, point, direction, reflected, pdf)
        return reflected, pdf

    def draw_at(self, point: NDArray[np.int64], u: NDArray[np.float32]) -> NDArray[np.float32]:
        direction = np.empty((len(point), 3), np.float32)
        _draw_at(self._view.points, point, u, direction)
        return direction

    def sees(
        self, point: NDArray[np.int64], direction: NDArray[np.float32], asked: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        seen = np.empty(len(point), np.bool_)
        traced = _sees(self._view.embree.handle, self._view.points, point, direction, asked, seen)
        with self._lock:
            self.traced.append(traced)
        return seen


def shade_picture(
    view: View, environment: EnvironmentMap, lighting: PictureDistribution, seed: int
) -> tuple[NDArray[np.float32], RayCount]:
    """Radiance (n, 3) of the view's points by the distribution's samples at all of them.

    seed : chooses the random numbers
    Raises EnvlightError where the distribution gives other samples than it promised, as
    `renderer.surface.shade_surface` does.
    """
    total, number = np.zeros((len(view), 3)), 0
    picture, traced = ViewPicture(view, seed), 0
    for samples in lighting.sample_picture(picture) if len(view) else ():
        number += len(samples.direction)
        if number > lighting.count:
            raise refusal(
                lighting, f"{number} samples at a point", f"at most {lighting.count}, its count"
            )
        radiance, shadow = _shade(view, environment, lighting, samples, seed)
        total += len(samples.direction) * radiance.astype(np.float64)
        traced += shadow
    shadow = traced + sum(picture.traced)
    rays = RayCount(shadow=shadow, skipped=max(0, lighting.count * len(view) - shadow))
    return (total / max(1, number)).astype(np.float32), rays


def _shade(
    view: View,
    environment: EnvironmentMap,
    lighting: PictureDistribution,
    samples: SurfaceSamples,
    seed: int,
) -> tuple[NDArray[np.float32], int]:
    """Mean radiance (n, 3) of the points by samples (k, n), and the rays traced."""
    out, counts = np.zeros((len(view), 3), np.float32), []

    def shade(start: int, stop: int) -> None:
        # Lanes that are left over in the last packet repeat the last point.
        rows = np.minimum(np.arange(start, start + -(-(stop - start) // LANES) * LANES), stop - 1)
        radiance = None if samples.radiance is None else samples.radiance[:, rows]
        here = SurfaceSamples(
            samples.direction[:, rows], samples.weight[:, rows], radiance, samples.shadowed
        )
        given = given_by(lighting, here, len(rows))
        traced, _ = shade_points(
            view.embree.handle, view.points, (start, stop), environment.radiance, NO_DENSITY,
            given, SampleSplit(len(here.direction), 0), NO_SAMPLES, Numbers(seed), out,
        )  # fmt: skip
        counts.append(traced)

    step = max(POINT_BLOCK, BATCH // max(1, len(samples.direction)) // LANES * LANES)
    for_blocks(shade, len(view), block_of(len(view), step) // LANES * LANES)
    return out, sum(counts)
