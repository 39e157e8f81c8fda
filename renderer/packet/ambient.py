"""What sixteen points reflect of a map whose light nothing shadows.

A look-up of the map's irradiance gives the diffuse part; samples of the BRDF gather only what a
surface reflects beyond that, so that what is diffuse has no noise.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.packet import coated, lambert, material_table
from renderer.packet.drawn_samples import AHEAD, TEXEL, aim_drawn, draw_from_brdf
from renderer.packet.embree import LANES
from renderer.packet.lane_samples import begin_numbers, look_up
from renderer.packet.lanes import face_above
from renderer.packet.layout import BLUE, COSINE, GREEN, NV, PDF, RED, Sequences, Texels
from renderer.packet.reflectance import reflect, reflect_ward
from samplers.compiled import inner, kernel
from samplers.grids.bilinear import bilinear_at
from samplers.sphere import RUN, map_positions

AMBIENT_STREAM = 8


class Ambient(NamedTuple):
    """What `add_ambient` adds.

    irradiance : (h, 2h, 3) of planes of all orientations; texels : the map
    samples : of each point's BRDF
    """

    irradiance: NDArray[np.float64]
    texels: Texels
    samples: int


@inner
def _diffuse_parts(packet, start, stop, material, materials, diffuse):
    """f_r of the diffuse part, and 1 for surfaces that are more than that, rows of diffuse (64,).

    Returns whether any surface is more.
    """
    glossy = False
    for k in range(LANES):
        row = materials[material[min(start + k, stop - 1)]]
        share = coated.diffuse_share(row, np.float64(packet[NV * LANES + k]))
        share = lambert.evaluate(share)
        for channel in range(3):
            diffuse[channel * LANES + k] = row[material_table.DIFFUSE + channel] * share
        more = int(row[material_table.KIND]) != material_table.LAMBERT
        diffuse[3 * LANES + k] = 1.0 if more else 0.0
        glossy |= more
    return glossy


@inner
def _add_beyond_diffuse(packet, light, diffuse, count, total):
    """Add a sample of what surfaces reflect of `light` (48,) beyond their diffuse part."""
    for k in range(LANES):
        density = np.float64(packet[PDF * LANES + k])
        # What is diffuse alone would get the rounding of a difference, times the light of a sun.
        drawn = (density > 0.0) & (diffuse[3 * LANES + k] > 0.0)
        scale = (1.0 if drawn else 0.0) / ((density if drawn else 1.0) * count)
        cosine = np.float64(packet[COSINE * LANES + k])
        red = np.float64(packet[RED * LANES + k]) - diffuse[k] * cosine
        green = np.float64(packet[GREEN * LANES + k]) - diffuse[LANES + k] * cosine
        blue = np.float64(packet[BLUE * LANES + k]) - diffuse[2 * LANES + k] * cosine
        total[k] += scale * red * light[k]
        total[LANES + k] += scale * green * light[LANES + k]
        total[2 * LANES + k] += scale * blue * light[2 * LANES + k]


@kernel
def new_ambient():
    """Room for `add_ambient`: places on the map, diffuse parts and light of sixteen points."""
    return (
        np.zeros(3 * RUN), np.empty(2 * RUN), np.empty(3), np.empty(4 * LANES), np.empty(3 * LANES),
    )  # fmt: skip


@inner
def add_ambient(packet, ward, span, points, ambient, seed, room, total):
    """Add unshadowed light of the ambient map to total (48,), at the points of a span.

    points, ambient : `layout.Points` and `Ambient`
    room : what `lane_samples.new_state`, `drawn_samples.new_drawn` and `new_ambient` make
    """
    state, drawn, (way, place, value, diffuse, light) = room
    irradiance, texels, count = ambient
    (start, stop), material, materials = span, points.material, points.materials
    used = stop - start
    glossy = _diffuse_parts(packet, start, stop, material, materials, diffuse)
    map_positions(points.normal, start, used, len(irradiance), way, place)
    for k in range(used):
        bilinear_at(irradiance, place[k], place[RUN + k], value)
        for channel in range(3):
            total[channel * LANES + k] += diffuse[channel * LANES + k] * value[channel]
    if not glossy or count == 0:
        return
    streams = (AMBIENT_STREAM, AMBIENT_STREAM)
    begin_numbers(
        span, points.pixel, points.subpixel, points.subpixels, (0, 0), (count, count), seed,
        streams, state,
    )  # fmt: skip
    sequences = Sequences(state, False)
    for first in range(0, count, AHEAD):
        last = min(first + AHEAD, count)
        draw_from_brdf(packet, ward, span, points, first, (first, last), sequences, texels, drawn)
        for i in range(last - first):
            aim_drawn(packet, drawn, i)
            face_above(packet)
            reflect(packet)
            if ward:
                reflect_ward(packet, start, stop, material, materials)
            look_up(texels.radiance, drawn[TEXEL][i], light)
            _add_beyond_diffuse(packet, light, diffuse, count, total)
    for k in range(3 * LANES):
        total[k] = max(0.0, total[k])
