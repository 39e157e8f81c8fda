"""Disc lights with soft shadows, over an unshadowed ambient map.

A disc light is a spherical cap of uniform radiance. Rays are stratified over the cap by
low-discrepancy points, different at each sub-pixel. In the mode "area" each ray carries its own
share of the integral, with the BRDF and the cosine of its own direction. In the mode "centre" all
of a light comes from its centre and the rays only measure how much of the cap is visible, which is
what the paper's penumbra wedges compute.

The ambient map casts no shadows (it leaks into occluded places, as in the paper). One compiled pass
per packet of sixteen points adds both: `packet/ambient.py`, `packet/caps.py`.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from renderer.direct import trace_light
from renderer.irradiance import irradiance_map
from renderer.monte_carlo import POINT_BLOCK
from renderer.packet.ambient import add_ambient, new_ambient
from renderer.packet.caps import face_caps, face_centre
from renderer.packet.drawn_samples import NUMBERS, new_drawn
from renderer.packet.embree import DIR_X, LANES, new_valid, query_arguments
from renderer.packet.lane_samples import begin_numbers, new_state, next_numbers
from renderer.packet.lanes import aim, face_lights, fill_packet, lane_materials, store_lanes
from renderer.packet.layout import new_packets
from renderer.packet.reflectance import reflect, reflect_ward
from renderer.rays import RayCount
from renderer.view import View
from samplers.compiled import inner, kernel
from samplers.lighting import DiscLights
from samplers.threads import block_of, for_blocks

Mode = Literal["area", "centre"]
DISC_STREAM = 16
AMBIENT_SAMPLES = 8
"""Unshadowed lookups at each glossy sub-pixel; a pixel's sub-pixels stratify each other."""


@inner
def _add_disc(
    scene, arguments, packet, ward, start, stop, material, materials, centre, half_angle, share,
    numbers, from_centre, directions, valid, total,
):  # fmt: skip
    """Add one ray's share of a disc's light to total (48,); returns the rays traced."""
    face_caps(packet, centre, half_angle, numbers)
    facing = face_centre(packet, centre) if from_centre else face_lights(packet)
    if facing == 0:
        return 0
    if from_centre:
        _copy(packet, DIR_X * LANES, directions, 0)
        aim(packet, centre[0], centre[1], centre[2])
    reflect(packet)
    if ward:
        reflect_ward(packet, start, stop, material, materials)
    if from_centre:
        _copy(directions, 0, packet, DIR_X * LANES)
    return trace_light(scene, arguments, packet, valid, stop - start, share, total)


@inner
def _copy(source, start, target, to):
    """Three coordinates of a packet, lane by lane; assigning slices takes seconds to compile."""
    for k in range(3 * LANES):
        target[to + k] = source[start + k]


@inner
def _shade_packets(
    scene, points, span, discs, count, from_centre, irradiance, radiance, ambient_count, seed, out,
    scratch,
):  # fmt: skip
    """`_shade_run` in arrays that are there."""
    position, normal, geometric, toward_eye, material, materials, pixel, subpixel, _ = points
    subpixels = points.subpixels
    centre, half_angle, share = discs
    packet, valid, arguments, lanes, state, drawn, ambient, directions, total = scratch
    texels, height, traced = radiance.reshape(-1), radiance.shape[0], 0
    for start in range(span[0], span[1], LANES):
        stop = min(start + LANES, span[1])
        ward = fill_packet(
            packet, start, stop, position, normal, geometric, toward_eye, material, lanes
        )
        for k in range(3 * LANES):
            total[k] = 0.0
        add_ambient(
            packet, ward, start, stop, normal, material, materials, pixel, subpixel, subpixels,
            seed, irradiance, texels, height, ambient_count, state, drawn, ambient, total,
        )  # fmt: skip
        for k in range(len(centre)):
            # The numbers of two discs are begun together.
            if k % 2 == 0:
                streams = (DISC_STREAM + k, DISC_STREAM + k + 1)
                begin_numbers(
                    (start, stop), pixel, subpixel, subpixels, (0, 0), (count, count), seed,
                    streams, state,
                )  # fmt: skip
            for _ in range(count):
                next_numbers(state, k % 2, False, drawn[NUMBERS])
                traced += _add_disc(
                    scene, arguments, packet, ward, start, stop, material, materials, centre[k],
                    half_angle[k], share[k], drawn[NUMBERS], from_centre, directions, valid, total,
                )  # fmt: skip
        store_lanes(total, start, stop, out)
    return traced


@kernel
def _shade_run(
    scene, points, span, discs, count, from_centre, irradiance, radiance, ambient_count, seed, out
):  # fmt: skip
    """Radiance of the points span[0] … span[1] into out (n, 3); returns the rays traced.

    discs : directions (k, 3), half angles (k,) and what each of `count` rays carries (k, 3)
    """
    scratch = (
        new_packets(1)[0], new_valid(), query_arguments(True), lane_materials(points.materials),
        new_state(), new_drawn(), new_ambient(), np.empty(3 * LANES, np.float32),
        np.empty(3 * LANES),
    )  # fmt: skip
    return _shade_packets(
        scene, points, span, discs, count, from_centre, irradiance, radiance, ambient_count, seed,
        out, scratch,
    )  # fmt: skip


def shade_discs(
    view: View, lights: DiscLights, seed: int, mode: Mode = "area"
) -> tuple[NDArray[np.float32], RayCount]:
    """Radiance (n, 3) of the view's points under disc lights and their ambient map."""
    out = np.zeros((len(view), 3), np.float32)
    counts: list[int] = []
    irradiance = irradiance_map(lights.ambient)
    count = lights.rays_per_light
    # Copies may be written, as those of fixed lights may not: one compiled kernel for both.
    discs = lights.direction.copy(), lights.half_angle.copy(), lights.irradiance / count
    ambient_count = 0 if view.is_lambertian or lights.ambient.is_black else AMBIENT_SAMPLES

    def shade(start: int, stop: int) -> None:
        counts.append(
            _shade_run(
                view.embree.handle, view.points, (start, stop), discs, count, mode == "centre",
                irradiance, lights.ambient.radiance, ambient_count, seed, out,
            )
        )  # fmt: skip

    for_blocks(shade, len(view), block_of(len(view), POINT_BLOCK))
    traced = sum(counts)
    return out, RayCount(shadow=traced, skipped=len(view) * count * len(lights) - traced)
