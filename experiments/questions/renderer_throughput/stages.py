"""Where a shading point's time goes under MIS: the renderer's stages, one more at each time.

The loop is that of `renderer.packet.estimate.shade_points` with one sample of the light and one of
the BRDF. It ends a sample after a given stage, so that the difference of two times is a stage's
share. Each stage works on what those before it left, in the same memory, as it does in an image.
"""

import numpy as np
from numpy.typing import NDArray

from renderer.packet.embree import LANES, new_valid, occluded, query_arguments
from renderer.packet.estimate import (
    LIGHT_STREAM,
    STREAMS,
    add_unblocked,
    draw_light,
    light_densities,
    weigh,
)
from renderer.packet.lane_samples import (
    NUMBERS_SIZE,
    STATE_SIZE,
    begin_numbers,
    find_texels,
    look_up,
    next_numbers,
)
from renderer.packet.lanes import face_lights, fill_packet, lane_materials
from renderer.packet.layout import new_packets
from renderer.packet.reflectance import draw_packet, reflect, reflect_ward
from renderer.view import View
from samplers import EnvironmentMap
from samplers.compiled import kernel
from samplers.grids.running_sums import WHOLE_SIZE
from samplers.grids.tabulated import DRAWN_SIZE, TabulatedDistribution
from samplers.threads import for_blocks

STAGES = (
    "packets", "random numbers", "light samples", "BRDF samples", "cosines", "texels and look-ups",
    "reflectance", "densities of the light", "weights", "Embree", "sums",
)  # fmt: skip
"""In the order of the loop: what each one adds to those before it."""
(
    PACKETS, NUMBERS, LIGHT, BRDF, COSINES, LOOK_UPS, REFLECTANCE, DENSITIES, WEIGHTS, EMBREE, SUMS,
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
    lanes, height, flux = lane_materials(materials), radiance.shape[0], table[3][-1]
    state, numbers = np.zeros(STATE_SIZE, np.uint32), np.zeros(NUMBERS_SIZE, np.float32)
    whole, real = np.zeros(WHOLE_SIZE, np.int32), np.zeros(DRAWN_SIZE)
    texel, density = np.zeros(2 * LANES, np.int32), np.zeros(LANES)
    light, total = np.zeros(3 * LANES), np.zeros(3 * LANES)
    for start in range(points[0], points[1], LANES):
        stop, count = points[1], min(LANES, points[1] - start)
        ward = fill_packet(
            packet, start, stop, position, normal, geometric, toward_eye, material, lanes
        )
        for k in range(3 * LANES):
            total[k] = 0.0
        if last < NUMBERS:
            continue
        begin_numbers((start, stop), pixel, subpixel, subpixels, (0, 0), (1, 1), 0, STREAMS, state)
        for stream in STREAMS:
            is_light = stream == LIGHT_STREAM
            next_numbers(state, stream, False, numbers)
            if is_light and last >= LIGHT:
                draw_light(packet, table, numbers, texel, whole, real)
            if not is_light and last >= BRDF:
                draw_packet(packet, ward, start, stop, material, materials, numbers)
            if last < COSINES or face_lights(packet) == 0 or last < LOOK_UPS:
                continue
            if not is_light:
                find_texels(packet, height, texel)
            look_up(radiance, texel, light)
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
            marked = weigh(packet, light, density, is_light, 1, 1, valid, count)
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
