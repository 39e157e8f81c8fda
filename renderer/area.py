"""Disc lights with soft shadows, over an unshadowed ambient map.

A disc light is a spherical cap of uniform radiance. Rays are stratified over the cap by
low-discrepancy points, different at each sub-pixel. In the mode "area" each ray carries its own
share of the integral, with the BRDF and the cosine of its own direction. In the mode "centre" all
of a light comes from its centre and the rays only measure how much of the cap is visible, which is
what the paper's penumbra wedges compute.

The ambient map casts no shadows (it leaks into occluded places, as in the paper). One compiled pass
per packet of sixteen points adds both: `packet/ambient.py`, `packet/caps.py`.
"""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.direct import trace_light
from renderer.irradiance import irradiance_map
from renderer.monte_carlo import POINT_BLOCK
from renderer.packet.ambient import Ambient, add_ambient, new_ambient
from renderer.packet.caps import face_caps, face_centre
from renderer.packet.drawn_samples import NUMBERS, new_drawn
from renderer.packet.embree import DIR_X, LANES, new_valid, query_arguments
from renderer.packet.lane_samples import begin_numbers, new_state, next_numbers
from renderer.packet.lanes import aim, face_lights, fill_packet, lane_materials, store_lanes
from renderer.packet.layout import Texels, new_packets
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


class Discs(NamedTuple):
    """direction : (k, 3); half_angle : (k,); share : (k, 3), what each of `rays` carries

    from_centre : whether rays carry light of their discs' centres: the mode "centre"
    """

    direction: NDArray[np.float64]
    half_angle: NDArray[np.float64]
    share: NDArray[np.float64]
    rays: int
    from_centre: bool


@inner
def _add_disc(scene, packet, ward, span, points, discs, d, numbers, room, total):
    """Add one ray's share of the light of disc `d` to total (48,); returns the rays traced."""
    arguments, valid, directions = room
    centre = discs.direction[d]
    face_caps(packet, centre, discs.half_angle[d], numbers)
    facing = face_centre(packet, centre) if discs.from_centre else face_lights(packet)
    if facing == 0:
        return 0
    if discs.from_centre:
        _copy(packet, DIR_X * LANES, directions, 0)
        aim(packet, centre[0], centre[1], centre[2])
    reflect(packet)
    if ward:
        reflect_ward(packet, span[0], span[1], points.material, points.materials)
    if discs.from_centre:
        _copy(directions, 0, packet, DIR_X * LANES)
    return trace_light(scene, arguments, packet, valid, span[1] - span[0], discs.share[d], total)


@inner
def _copy(source, start, target, to):
    """Three coordinates of a packet, lane by lane; assigning slices takes seconds to compile."""
    for k in range(3 * LANES):
        target[to + k] = source[start + k]


@inner
def _shade_packets(scene, points, span, discs, ambient, seed, out, scratch):
    """`_shade_run` in arrays that are there."""
    packet, valid, arguments, lanes, state, drawn, places, directions, total = scratch
    traced, count = 0, discs.rays
    for start in range(span[0], span[1], LANES):
        here = (start, min(start + LANES, span[1]))
        ward = fill_packet(
            packet, here[0], here[1], points.position, points.normal, points.geometric,
            points.toward_eye, points.material, lanes,
        )  # fmt: skip
        for k in range(3 * LANES):
            total[k] = 0.0
        add_ambient(packet, ward, here, points, ambient, seed, (state, drawn, places), total)
        for k in range(len(discs.direction)):
            # The numbers of two discs are begun together.
            if k % 2 == 0:
                streams = (DISC_STREAM + k, DISC_STREAM + k + 1)
                begin_numbers(
                    here, points.pixel, points.subpixel, points.subpixels, (0, 0), (count, count),
                    seed, streams, state,
                )  # fmt: skip
            for _ in range(count):
                next_numbers(state, k % 2, False, drawn[NUMBERS])
                traced += _add_disc(
                    scene, packet, ward, here, points, discs, k, drawn[NUMBERS],
                    (arguments, valid, directions), total,
                )  # fmt: skip
        store_lanes(total, here[0], here[1], out)
    return traced


@kernel
def _shade_run(scene, points, span, discs, ambient, seed, out):
    """Radiance of the points span[0] … span[1] into out (n, 3); returns the rays traced."""
    scratch = (
        new_packets(1)[0], new_valid(), query_arguments(True), lane_materials(points.materials),
        new_state(), new_drawn(), new_ambient(), np.empty(3 * LANES, np.float32),
        np.empty(3 * LANES),
    )  # fmt: skip
    return _shade_packets(scene, points, span, discs, ambient, seed, out, scratch)


def shade_discs(
    view: View, lights: DiscLights, seed: int, mode: Mode = "area"
) -> tuple[NDArray[np.float32], RayCount]:
    """Radiance (n, 3) of the view's points under disc lights and their ambient map."""
    out = np.zeros((len(view), 3), np.float32)
    counts: list[int] = []
    count, radiance = lights.rays_per_light, lights.ambient.radiance
    # Copies may be written, as those of fixed lights may not: one compiled kernel for both.
    discs = Discs(
        lights.direction.copy(), lights.half_angle.copy(), lights.irradiance / count, count,
        mode == "centre",
    )  # fmt: skip
    ambient = Ambient(
        irradiance_map(lights.ambient),
        Texels(radiance.reshape(-1), len(radiance)),
        0 if view.is_lambertian or lights.ambient.is_black else AMBIENT_SAMPLES,
    )

    def shade(start: int, stop: int) -> None:
        counts.append(
            _shade_run(view.embree.handle, view.points, (start, stop), discs, ambient, seed, out)
        )

    for_blocks(shade, len(view), block_of(len(view), POINT_BLOCK))
    traced = sum(counts)
    return out, RayCount(shadow=traced, skipped=len(view) * count * len(lights) - traced)
