"""Shading by one global set of directional lights, or by interleaved sets of them.

One compiled pass per run of points: lights that face away are culled, the rest are shaded, and
those that carry anything become shadow rays, eight to a packet. All rays of a packet go towards the
same light from neighbouring points.

Interleaved sampling: Kollig and Keller, "Efficient illumination by high dynamic range images",
EGSR 2003; perturbation as in Wu, "Efficient environment map rendering based on decomposition",
2025, 3.5.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from renderer.brdf import evaluate
from renderer.embree import LANES, new_packet, new_valid
from renderer.rays import RayCount, flush_rays, new_ray_values, push_ray
from renderer.skips import DEFAULT, Skips
from renderer.view import CELLS, View
from samplers.errors import EnvlightError
from samplers.lighting import DirectionalLights
from samplers.sphere import normalized
from samplers.threads import for_blocks

PERTURBATION = 0.1
"""Half angle of the perturbation in units of a light's extent (Wu 2025, 3.5)."""
GROUP_BLOCK = 16


def interleaved(
    lights: DirectionalLights, sets: int, rng: np.random.Generator, scale: float = PERTURBATION
) -> NDArray[np.float64]:
    """Directions (sets, n, 3): the lights' own, then sets − 1 random perturbations of them.

    A direction is drawn uniformly from the cap of half angle scale × extent around the light's.
    """
    if sets not in (1, 2, 4, 8):
        raise EnvlightError(f"interleaving of {sets} sets; use 1, 2, 4 or {CELLS}")
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


@njit(nogil=True, cache=True)
def _shade_group(
    scene, position, normal, geometric, toward_eye, material, materials,
    start, stop, direction, irradiance, skip_away, skip_zero, packet, valid, owner, value, total,
):  # fmt: skip
    """Light the points start … stop; returns rays traced and pairs skipped."""
    traced = skipped = 0
    for light in range(len(direction)):
        lx, ly, lz = direction[light, 0], direction[light, 1], direction[light, 2]
        lanes = 0
        for i in range(start, stop):
            cosine = normal[i, 0] * lx + normal[i, 1] * ly + normal[i, 2] * lz
            above = geometric[i, 0] * lx + geometric[i, 1] * ly + geometric[i, 2] * lz
            if cosine <= 0.0 or above <= 0.0:
                if skip_away:
                    skipped += 1
                    continue
                red = green = blue = 0.0
            else:
                red, green, blue = evaluate(
                    materials[material[i]], normal[i, 0], normal[i, 1], normal[i, 2],
                    toward_eye[i, 0], toward_eye[i, 1], toward_eye[i, 2], lx, ly, lz,
                )  # fmt: skip
                red *= cosine * irradiance[light, 0]
                green *= cosine * irradiance[light, 1]
                blue *= cosine * irradiance[light, 2]
                if skip_zero and red == 0.0 and green == 0.0 and blue == 0.0:
                    skipped += 1
                    continue
            push_ray(packet, owner, value, lanes, position, i, lx, ly, lz, red, green, blue)
            lanes += 1
            if lanes == LANES:
                flush_rays(scene, packet, valid, owner, value, lanes, start, total)
                traced += lanes
                lanes = 0
        if lanes > 0:
            flush_rays(scene, packet, valid, owner, value, lanes, start, total)
            traced += lanes
    return traced, skipped


@njit(nogil=True, cache=True)
def _shade_groups(
    scene, position, normal, geometric, toward_eye, material, materials,
    group, cell, first, last, direction, irradiance, skip_away, skip_zero, out,
):  # fmt: skip
    packet, valid = new_packet(), new_valid()
    owner, value = new_ray_values()
    traced = skipped = 0
    for g in range(first, last):
        start, stop = group[g], group[g + 1]
        total = np.zeros((stop - start, 3))
        t, s = _shade_group(
            scene, position, normal, geometric, toward_eye, material, materials,
            start, stop, direction[cell[g] % len(direction)], irradiance, skip_away, skip_zero,
            packet, valid, owner, value, total,
        )  # fmt: skip
        traced += t
        skipped += s
        out[start:stop] = total
    return traced, skipped


def shade_directional(
    view: View,
    direction: NDArray[np.float64],
    irradiance: NDArray[np.float64],
    skips: Skips = DEFAULT,
) -> tuple[NDArray[np.float32], RayCount]:
    """Radiance (n, 3) of the view's points under sets of directional lights.

    direction : (sets, k, 3); irradiance : (k, 3), the same for all sets. The pixel at (x, y) uses
    the set of its cell in the 4 × 2 pattern.
    """
    out = np.zeros((len(view), 3), np.float32)
    direction = np.ascontiguousarray(direction, np.float32)
    counts: list[tuple[int, int]] = []

    def groups(first: int, last: int) -> None:
        counts.append(
            _shade_groups(
                view.embree.handle,
                view.position,
                view.normal,
                view.geometric,
                view.toward_eye,
                view.material,
                view.materials,
                view.group,
                view.group_cell,
                first,
                last,
                direction,
                irradiance,
                skips.facing_away,
                skips.zero,
                out,
            )
        )

    if irradiance.size:
        for_blocks(groups, len(view.group_cell), GROUP_BLOCK)
    traced, skipped = (sum(column) for column in zip(*counts, strict=True)) if counts else (0, 0)
    return out, RayCount(shadow=traced, skipped=skipped)
