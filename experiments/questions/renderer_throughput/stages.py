"""Where a shading point's time goes under MIS: the renderer's stages, one more at each time.

The loop is that of `renderer.packet.estimate.shade_points` with one sample of the light and one of
the BRDF. It ends a sample after a given stage, so that the difference of two times is a stage's
share. Each stage works on what those before it left, in the same memory, as it does in an image.
"""

import numpy as np
from numpy.typing import NDArray

from renderer.packet.drawn_samples import (
    BRDF_STREAM,
    LIGHT_STREAM,
    NUMBERS,
    STREAMS,
    TEXEL,
    aim_drawn,
    draw_samples,
    new_drawn,
)
from renderer.packet.embree import LANES, new_valid, occluded, query_arguments
from renderer.packet.estimate import add_unblocked, light_densities, weigh
from renderer.packet.lane_samples import begin_numbers, look_up, new_state, next_numbers
from renderer.packet.lanes import face_lights, fill_packet, lane_materials
from renderer.packet.layout import new_packets
from renderer.packet.reflectance import reflect, reflect_ward
from renderer.view import View
from samplers import EnvironmentMap
from samplers.compiled import kernel
from samplers.grids.tabulated import TabulatedDistribution
from samplers.threads import for_blocks

STAGES = (
    "packets", "random numbers", "light samples", "BRDF samples", "cosines", "look-ups",
    "reflectance", "densities of the light", "weights", "Embree", "sums",
)  # fmt: skip
"""In the order of the loop: what each one adds to those before it. Samples bring their texels."""
(
    _, RANDOM, LIGHT, BRDF, COSINES, LOOK_UPS, REFLECTANCE, DENSITIES, WEIGHTS, EMBREE, SUMS,
) = range(len(STAGES))  # fmt: skip
POINT_BLOCK = 4096


@kernel
def _shade(
    scene, surface, material, materials, pixel, subpixel, subpixels, points, radiance, table,
    offset, last, out,
):  # fmt: skip
    """The renderer's loop up to the stage `last`."""
    position, normal, geometric, toward_eye = surface
    packet, valid, arguments = new_packets(1)[0], new_valid(), query_arguments(False)
    lanes, flux, state, drawn = lane_materials(materials), table[3][-1], new_state(), new_drawn()
    texels, height = radiance.reshape(-1), radiance.shape[0]
    density, light, total = np.zeros(LANES), np.zeros(3 * LANES), np.zeros(3 * LANES)
    for start in range(points[0], points[1], LANES):
        stop, count = points[1], min(LANES, points[1] - start)
        ward = fill_packet(
            packet, start, stop, position, normal, geometric, toward_eye, material, lanes
        )
        for k in range(3 * LANES):
            total[k] = 0.0
        if last < RANDOM:
            continue
        begin_numbers((start, stop), pixel, subpixel, subpixels, (0, 0), (1, 1), 0, STREAMS, state)
        samples = 0 if last < LIGHT else 1 if last < BRDF else 2
        draw_samples(
            packet, ward, start, stop, material, materials, 0, samples, 1, state, False, table,
            texels, height, drawn,
        )  # fmt: skip
        for s in range(samples, 2):
            stream = LIGHT_STREAM if s == 0 else BRDF_STREAM
            next_numbers(state, stream, False, drawn[NUMBERS])
        for s in range(2 if last >= COSINES else 0):
            aim_drawn(packet, drawn, s)
            if face_lights(packet) == 0 or last < LOOK_UPS:
                continue
            look_up(texels, drawn[TEXEL][s], light)
            if last < REFLECTANCE:
                continue
            reflect(packet)
            if ward:
                reflect_ward(packet, start, stop, material, materials)
            if last < DENSITIES:
                continue
            light_densities(light, offset, flux, density)
            if last < WEIGHTS:
                continue
            marked = weigh(packet, light, density, s == 0, 1, 1, valid, count)
            if last < EMBREE or marked == 0:
                continue
            occluded(scene, valid, packet, arguments)
            if last >= SUMS:
                add_unblocked(packet, valid, light, total)
        if last >= SUMS:
            for k in range(count):
                for channel in range(3):
                    out[start + k, channel] = total[channel * LANES + k]


def shade_to_stage(
    view: View, environment: EnvironmentMap, lighting: TabulatedDistribution, last: int
) -> NDArray[np.float32]:
    """The points' radiance (n, 3), of 1 + 1 samples, where `last` is the last of the stages."""
    out = np.zeros((len(view), 3), np.float32)

    def shade(start: int, stop: int) -> None:
        _shade(
            view.embree.handle, view.surface, view.material, view.materials, view.pixel,
            view.subpixel, view.subpixels, (start, stop), environment.radiance, lighting.table,
            lighting.offset, last, out,
        )  # fmt: skip

    for_blocks(shade, len(view), POINT_BLOCK)
    return out
