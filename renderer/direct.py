"""Shading by one global set of directional lights, or by interleaved sets of them.

One compiled pass per run of points: sixteen neighbouring points at a time meet each light. Those
that it faces are shaded side by side and those that it carries anything to are traced as one packet
of coherent rays, whose origins stay in place from light to light.

Interleaved sampling: Kollig and Keller, "Efficient illumination by high dynamic range images",
EGSR 2003; perturbation as in Wu, "Efficient environment map rendering based on decomposition",
2025, 3.5.
"""

import math

import numpy as np
from numpy.typing import NDArray

from renderer.packet.embree import LANES, T_FAR, new_valid, occluded, query_arguments
from renderer.packet.lanes import aim, face_lights, fill_packet, lane_materials, store_lanes
from renderer.packet.layout import BLUE, FACING, GREEN, RED, ZERO, new_packets
from renderer.packet.reflectance import reflect, reflect_ward
from renderer.rays import RayCount
from renderer.view import CELLS, View
from samplers.compiled import inner, kernel
from samplers.errors import EnvlightError
from samplers.lighting import DirectionalLights
from samplers.sphere import normalized
from samplers.threads import for_blocks, groups_of

PERTURBATION = 0.1
"""Half angle of the perturbation in units of a light's extent (Wu 2025, 3.5)."""
POINT_BLOCK = 2048
"""Points that a thread takes at once, at least."""


def interleaved(
    lights: DirectionalLights, sets: int, rng: np.random.Generator, scale: float = PERTURBATION
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Directions and irradiance (sets, n, 3) of the sets that pixels use in turn.

    The sampler's own sets come first, then perturbations of them, again in turn: a direction is
    drawn uniformly from the cap of half angle scale × extent around the light's. Sets with fewer
    lights than others are filled up with lights of no irradiance.
    """
    if sets not in (1, 2, 4, 8):
        raise EnvlightError(f"interleaving of {sets} sets; use 1, 2, 4 or {CELLS}")
    given = lights.sets[:sets]
    shape = (sets, max(map(len, given)), 3)
    direction, irradiance = np.zeros(shape), np.zeros(shape)
    direction[..., 1] = 1.0
    for k, own in enumerate(given):
        turns = len(range(k, sets, len(given)))
        direction[k :: len(given), : len(own)] = _perturbed(own, turns, rng, scale)
        irradiance[k :: len(given), : len(own)] = own.irradiance
    return direction, irradiance


def _perturbed(
    lights: DirectionalLights, sets: int, rng: np.random.Generator, scale: float
) -> NDArray[np.float64]:
    """Directions (sets, n, 3): the lights' own, then sets − 1 random perturbations of them."""
    centre = lights.direction
    if sets == 1:
        return centre[None]
    shape = (sets - 1, len(lights))
    half_angle = np.minimum(scale * lights.extent, math.pi)
    # Uniform in the cap: 1 − cos θ = u (1 − cos α), through sines of half angles for small caps.
    theta = 2.0 * np.arcsin(np.sqrt(rng.random(shape)) * np.sin(half_angle / 2.0))
    phi = 2.0 * math.pi * rng.random(shape)
    axis = np.where(np.abs(centre[:, 1:2]) < 0.9, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    tangent = normalized(np.cross(axis, centre), 0.0)
    bitangent = np.cross(centre, tangent)
    moved = (
        np.cos(theta)[..., None] * centre
        + (np.sin(theta) * np.cos(phi))[..., None] * tangent
        + (np.sin(theta) * np.sin(phi))[..., None] * bitangent
    )
    return np.concatenate([centre[None], normalized(moved, centre)])


@inner
def _carried(packet, irradiance, valid, count):
    """Mark the lanes whose ray is traced; returns how many of the first `count` are."""
    marked = 0
    er, eg, eb = irradiance[0], irradiance[1], irradiance[2]
    for k in range(LANES):
        # As float64: irradiance may be beyond what float32 holds.
        carries = (
            (packet[RED * LANES + k] * er != 0.0)
            | (packet[GREEN * LANES + k] * eg != 0.0)
            | (packet[BLUE * LANES + k] * eb != 0.0)
        )
        used = (packet[FACING * LANES + k] != ZERO) & carries & (k < count)
        valid[k] = -1 if used else 0
        marked += 1 if used else 0
    return marked


@inner
def _add_unblocked(packet, valid, irradiance, total):
    """Add what the marked lanes carry to `total` (3 · 16,) where no hit was found."""
    er, eg, eb = irradiance[0], irradiance[1], irradiance[2]
    for k in range(LANES):
        lit = 1.0 if (valid[k] != 0) & (packet[T_FAR * LANES + k] >= ZERO) else 0.0
        total[k] += lit * packet[RED * LANES + k] * er
        total[LANES + k] += lit * packet[GREEN * LANES + k] * eg
        total[2 * LANES + k] += lit * packet[BLUE * LANES + k] * eb


@inner
def trace_light(scene, arguments, packet, valid, count, irradiance, total):
    """Add what the first `count` lanes get to `total` (3 · 16,); returns the rays traced.

    RED, GREEN and BLUE hold f_r · cosine for the directions of the packet's rays:
    total += irradiance · f_r · cosine · visibility. Lanes that get nothing are not traced.
    """
    marked = _carried(packet, irradiance, valid, count)
    if marked > 0:
        occluded(scene, valid, packet, arguments)
        _add_unblocked(packet, valid, irradiance, total)
    return marked


@inner
def _shade_packet(
    scene, arguments, packet, valid, count, ward, first, material, materials, direction,
    irradiance, total,
):  # fmt: skip
    """Light the first `count` lanes of a packet; returns the rays traced.

    Radiance = Σ over lights of irradiance · f_r · n·l · visibility.
    """
    traced = 0
    for light in range(len(direction)):
        aim(packet, direction[light, 0], direction[light, 1], direction[light, 2])
        if face_lights(packet) == 0:
            continue
        reflect(packet)
        if ward:
            reflect_ward(packet, first, first + count, material, materials)
        traced += trace_light(scene, arguments, packet, valid, count, irradiance[light], total)
    return traced


@inner
def _shade_runs(scene, points, group, cell, first, last, direction, irradiance, out, scratch):
    """`_shade_groups` in arrays that are there."""
    position, normal, geometric, toward_eye = points[:4]
    material, materials = points.material, points.materials
    packet, valid, arguments, table, total = scratch
    traced = pairs = 0
    for g in range(first, last):
        ways, sent = direction[cell[g] % len(direction)], irradiance[cell[g] % len(direction)]
        for start in range(group[g], group[g + 1], LANES):
            stop = min(start + LANES, group[g + 1])
            ward = fill_packet(
                packet, start, stop, position, normal, geometric, toward_eye, material, table
            )
            total[:] = 0.0
            traced += _shade_packet(
                scene, arguments, packet, valid, stop - start, ward, start, material, materials,
                ways, sent, total,
            )  # fmt: skip
            pairs += (stop - start) * len(ways)
            store_lanes(total, start, stop, out)
    return traced, pairs - traced


@kernel
def _shade_groups(scene, points, group, cell, first, last, direction, irradiance, out):
    """Light the points of the groups first … last; returns the rays traced and those not."""
    scratch = (
        new_packets(1)[0], new_valid(), query_arguments(True), lane_materials(points.materials),
        np.empty(3 * LANES),
    )  # fmt: skip
    return _shade_runs(scene, points, group, cell, first, last, direction, irradiance, out, scratch)


def shade_directional(
    view: View,
    direction: NDArray[np.float64],
    irradiance: NDArray[np.float64],
) -> tuple[NDArray[np.float32], RayCount]:
    """Radiance (n, 3) of the view's points under sets of directional lights.

    direction : (sets, k, 3); irradiance : (sets, k, 3), or (k, 3), the same for all sets. A
    sub-pixel uses the set of its cell in the view's pattern.
    """
    out = np.zeros((len(view), 3), np.float32)
    direction = np.ascontiguousarray(direction, np.float32)
    irradiance = np.ascontiguousarray(np.broadcast_to(irradiance, direction.shape))
    counts: list[tuple[int, int]] = []

    def groups(first: int, last: int) -> None:
        counts.append(
            _shade_groups(
                view.embree.handle, view.points, view.group, view.group_cell, first, last,
                direction, irradiance, out,
            )
        )  # fmt: skip

    if irradiance.size:
        count = len(view.group_cell)
        for_blocks(groups, count, groups_of(count, len(view), POINT_BLOCK))
    traced, skipped = (sum(column) for column in zip(*counts, strict=True)) if counts else (0, 0)
    return out, RayCount(shadow=traced, skipped=skipped)
