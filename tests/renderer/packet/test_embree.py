"""Rays meet triangles where geometry says, slip through no seam, and leave idle lanes alone."""

import gc

import numpy as np
import pytest
from numpy.typing import NDArray

from renderer import scenes
from renderer.modelling import box, sphere
from renderer.packet.embree import (
    DIR_X,
    HIT_TRIANGLE,
    HIT_U,
    HIT_V,
    LANES,
    NO_HIT,
    ORG_X,
    T_FAR,
    EmbreeScene,
    aligned_rows,
    intersect,
    new_hit_packet,
    new_valid,
    occluded,
    query_arguments,
)
from samplers.compiled import kernel

RAYS = 1 << 17


@kernel
def shoot(scene, usual, origin, direction, lanes, coherent=False):
    """Triangle, barycentrics, distance and any-hit of rays traced `lanes` to a packet."""
    count = len(origin)
    triangle, found = np.empty(count, np.int32), np.empty((count, 3), np.float32)
    blocked = np.empty(count, np.bool_)
    packet, shadow, valid = new_hit_packet(), new_hit_packet(), new_valid()
    arguments = query_arguments(coherent)
    for first in range(0, count, lanes):
        used = min(lanes, count - first)
        for k in range(LANES):
            valid[k] = -1 if k < used else 0
        for k in range(used):
            for axis in range(3):
                packet[ORG_X + axis, k] = shadow[ORG_X + axis, k] = origin[first + k, axis]
                packet[DIR_X + axis, k] = shadow[DIR_X + axis, k] = direction[first + k, axis]
        intersect(scene, usual, valid, packet, arguments)
        occluded(scene, valid, shadow.reshape(-1), arguments)
        for k in range(used):
            triangle[first + k] = packet.view(np.int32)[HIT_TRIANGLE, k]
            found[first + k, 0], found[first + k, 1] = packet[HIT_U, k], packet[HIT_V, k]
            found[first + k, 2] = packet[T_FAR, k]
            blocked[first + k] = shadow[T_FAR, k] < 0.0
    return triangle, found, blocked


@kernel
def idle_lanes(scene):
    """T_FAR of a packet whose rays all would hit, with only lane 2 valid."""
    packet, valid = new_hit_packet(), new_valid()
    packet[ORG_X + 2, :], packet[DIR_X + 2, :] = 1.0, -1.0
    valid[:] = 0
    valid[2] = -1
    occluded(scene, valid, packet.reshape(-1), query_arguments(False))
    return packet[T_FAR].copy()


@kernel
def addresses():
    return aligned_rows(1).ctypes.data, new_hit_packet().ctypes.data


def ball() -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    shape = sphere(1.0, 12)
    return shape.vertex.astype(np.float32), shape.triangle.astype(np.int32)


@pytest.mark.parametrize("lanes", [1, 3, 8, 16])
def test_hits_agree_with_brute_force(lanes: int) -> None:
    rng = np.random.default_rng(lanes)
    vertex = rng.uniform(-1.0, 1.0, (60, 3)).astype(np.float32)
    triangle = np.arange(60, dtype=np.int32).reshape(20, 3)
    scene = EmbreeScene(vertex, triangle)
    origin = rng.uniform(-2.0, 2.0, (501, 3)).astype(np.float32)
    direction = (rng.uniform(-1.0, 1.0, (501, 3)) - origin).astype(np.float32)
    hit, found, blocked = shoot(scene.handle, scene.usual, origin, direction, lanes)

    a, e, f = vertex[::3].astype(float), vertex[1::3] - vertex[::3], vertex[2::3] - vertex[::3]
    p = np.cross(direction[:, None].astype(float), f)
    det = (p * e).sum(-1)
    s = origin[:, None] - a
    u = (s * p).sum(-1) / det
    q = np.cross(s, e)
    v = (direction[:, None] * q).sum(-1) / det
    t = (q * f).sum(-1) / det
    inside = np.minimum(np.minimum(u, v), 1.0 - u - v)
    distance = np.where((inside >= 0.0) & (t >= 0.0), t, np.inf)
    nearest = distance.argmin(axis=1)
    # Rays within 1e-4 of an edge or of their origin may go either way in float32.
    clear = (np.abs(inside).min(axis=1) > 1e-4) & (np.abs(t).min(axis=1) > 1e-4)
    assert clear.sum() > 400
    met = np.isfinite(distance.min(axis=1))
    np.testing.assert_array_equal(hit[clear], np.where(met, nearest, NO_HIT)[clear])
    np.testing.assert_array_equal(blocked[clear], met[clear])
    both = clear & met
    rows = np.arange(501)
    # A float32 quotient of sums of products of lengths up to 4: 2⁻²⁴ over the least determinant.
    tolerance = 64.0 * 2.0**-24 * 4.0**3 / np.abs(det[rows, nearest])
    wanted = np.stack([u, v, t], axis=-1)[rows, nearest]
    assert (np.abs(found - wanted)[both] <= tolerance[both, None]).all()


def closed(name: str) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """A mesh without a rim: every edge is of two triangles."""
    if name == "sphere":
        return ball()
    if name == "fine sphere":
        shape = sphere(1.0, 48)
    elif name == "box":
        shape = box((2.0, 1.0, 3.0)).moved(0.1, -0.2, 0.3)
    else:
        scene, _, part = name.partition("/")
        (mesh,) = (item.mesh for item in scenes.make(scene).objects if item.name == part)
        return mesh.vertex, mesh.triangle
    return shape.vertex.astype(np.float32), shape.triangle.astype(np.int32)


CLOSED = ["sphere", "fine sphere", "box", "three-boxes/tall", "glossy/block", "glossy/ball"]


def from_inside(vertex: NDArray, count: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """Origins in the middle half of the box around a convex mesh."""
    low, high = vertex.min(axis=0), vertex.max(axis=0)
    place = rng.uniform(0.25, 0.75, (count, 3))
    return (low + (high - low) * place).astype(np.float32)


def escapes(scene: EmbreeScene, origin: NDArray, direction: NDArray) -> int:
    """How often neither kind of query, coherent or not, one to a packet or sixteen, meets a hit."""
    missed = 0
    for coherent in (False, True):
        for lanes, part in ((16, slice(None)), (1, slice(0, len(origin) // 16))):
            hit, _, blocked = shoot(
                scene.handle,
                scene.usual,
                origin[part],
                direction[part].astype(np.float32),
                lanes,
                coherent,
            )
            missed += np.count_nonzero(hit < 0) + np.count_nonzero(~blocked)
    return missed


@pytest.mark.parametrize("name", CLOSED)
def test_no_ray_leaves_through_an_edge(name: str) -> None:
    """Straight at points of edges, which two triangles share: rays round to both of their sides."""
    vertex, triangle = closed(name)
    rng = np.random.default_rng(7)
    edge = np.concatenate([triangle, np.roll(triangle, 1, axis=1)], axis=0).reshape(2, -1)
    start, end = vertex.astype(np.float64)[edge[:, rng.integers(0, edge.shape[1], RAYS)]]
    # Not nearer to their ends than the next test goes.
    share = rng.uniform(0.01, 0.99, (RAYS, 1))
    share[: RAYS // 4] = 0.5
    origin = from_inside(vertex, RAYS, rng)
    direction = start + share * (end - start) - origin
    assert escapes(EmbreeScene(vertex, triangle), origin, direction) == 0


@pytest.mark.parametrize("name", CLOSED)
def test_no_ray_leaves_beside_a_vertex(name: str) -> None:
    """Past the vertices, at 2⁻²⁰ to 2⁻¹⁶ of their distance.

    On which side of an edge a ray goes is the sign of d · ((b − a) × (b + a)), a and b its ends as
    seen from the ray's origin. Each of 3 components of the product is rounded as its two terms
    and their difference are, at most 2 · 2⁻²⁴ |b − a| |b + a| together; so are the 3 terms of
    the sum. Over 2 |b − a|, which makes it a distance, that is 2⁻²⁴ · 2√3 · |b + a| / 2, and with
    the roundings of b − a and b + a less than 2⁻²⁴ · 8 of how far the edge is."""
    vertex, triangle = closed(name)
    rng = np.random.default_rng(8)
    origin = from_inside(vertex, RAYS, rng)
    direction = vertex[rng.integers(0, len(vertex), RAYS)].astype(np.float64) - origin
    aside = np.cross(direction, rng.normal(size=(RAYS, 3)))
    aside *= (
        np.linalg.norm(direction, axis=1, keepdims=True)
        * 2.0 ** rng.uniform(-20.0, -16.0, (RAYS, 1))
        / np.linalg.norm(aside, axis=1, keepdims=True)
    )
    assert escapes(EmbreeScene(vertex, triangle), origin, direction + aside) == 0


def test_idle_lanes_are_left_alone() -> None:
    triangle = np.array([[0, 1, 2]], np.int32)
    wide = np.array([[-9, -9, 0], [9, -9, 0], [0, 9, 0]], np.float32)
    scene = EmbreeScene(wide, triangle)
    far = idle_lanes(scene.handle)
    assert far[2] == -np.inf
    assert np.isposinf(np.delete(far, 2)).all()


def test_packets_are_aligned_as_embree_demands() -> None:
    for _ in range(20):
        assert all(address % 64 == 0 for address in addresses())


def test_scenes_outlive_their_arrays_and_die_quietly() -> None:
    down = np.array([[0.0, 0.0, -1.0]], np.float32)
    for k in range(50):
        vertex, triangle = ball()
        scene = EmbreeScene(vertex, triangle)
        vertex[:] = np.nan
        triangle[:] = 0
        del vertex, triangle
        gc.collect(0)
        _, found, _ = shoot(scene.handle, scene.usual, -5.0 * down, down, 8)
        # Facets of 7.5° lie up to 1 − cos 5.3° inside of the sphere.
        assert 4.0 - 1e-6 <= found[0, 2] <= 4.0 + 0.0043, k
