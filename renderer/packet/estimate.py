"""Radiance of points by samples of a map's light and of their BRDFs: one pass for each packet.

    radiance = Σ weight · L · f_r · n·l · visibility / (n p)   over all samples of both techniques
    weight   = (n p)² / ((n p)² + (m q)²),   where the other one draws m samples of density q

by the power heuristic (Veach and Guibas, SIGGRAPH 1995, equation 20 with β = 2). A packet is
filled, draws samples of each lane, a few ahead (`drawn_samples.py`), looks their light up, reflects
and weighs it, traces what carries anything, and adds it: nothing but the sum leaves the packet.
Samples of the light are drawn in place from a table of the map (`samplers.grids.tabulated`), and
the map is read once for a sample's radiance and its density. Samples of other distributions are
given.
"""

import numpy as np

from renderer.packet import coated
from renderer.packet.drawn_samples import (
    AHEAD,
    STREAMS,
    TEXEL,
    aim_drawn,
    draw_samples,
    new_drawn,
    take_samples,
)
from renderer.packet.embree import LANES, T_FAR, new_valid, occluded, query_arguments
from renderer.packet.lane_samples import begin_numbers, look_up, new_state
from renderer.packet.lanes import (
    face_above,
    face_lights,
    fill_packet,
    lane_materials,
    store_lanes,
)
from renderer.packet.layout import (
    BLUE,
    COSINE,
    DIFFUSE_B,
    DIFFUSE_G,
    DIFFUSE_R,
    DIMMED,
    F0_R,
    FACING,
    GREEN,
    ONE,
    PDF,
    RED,
    ZERO,
    Sequences,
    Texels,
    new_packets,
)
from renderer.packet.reflectance import reflect, reflect_ward
from samplers.compiled import inner, kernel
from samplers.grids.map_kernels import texel_luminance
from samplers.grids.tabulated import texel_density


@inner
def light_densities(light, offset, total, density):
    """The density (16,) of directions in texels of radiance light (48,), by their luminance."""
    for k in range(LANES):
        luminance = texel_luminance(
            np.float32(light[k]), np.float32(light[LANES + k]), np.float32(light[2 * LANES + k])
        )
        density[k] = texel_density(luminance, offset, total)


@inner
def find_densities(density_of, light, texel, total, density):
    """The density (16,) of directions in the texels (16,), whose radiance is light (48,).

    density_of : `layout.Density`; total : what its whole table holds
    """
    weight, offset = density_of.weight, density_of.offset
    if len(weight) > 0:
        for k in range(LANES):
            density[k] = texel_density(weight[np.uint64(texel[k])], offset, total)
    else:
        light_densities(light, offset, total, density)


@inner
def _scale(own, other, own_count, other_count):
    """The weight of a sample over its technique's n and density: 1 / (a + b²/a).

    own, other : its densities, by its own technique and the other one
    a = n · own, b = m · other, for n samples of the own technique and m of the other; written so
    that nothing overflows. Of no meaning where `own` is 0.
    """
    a, b = own_count * (own if own > 0.0 else 1.0), other_count * other
    return 1.0 / (a + b * (b / a))


@inner
def add_diffuse(packet, light, density, is_light, own_count, other_count, total):
    """Add each lane's sample to total (48,): what it carries of diffuse light before shadows.

    The packet's COSINE, FACING and PDF are by the shading normal alone: `face_above`.
    """
    for k in range(LANES):
        brdf = np.float64(packet[PDF * LANES + k])
        own, other = (density[k], brdf) if is_light else (brdf, density[k])
        nl = packet[COSINE * LANES + k]
        through = ONE - coated.coat_reflectance(
            packet[DIMMED * LANES + k], packet[F0_R * LANES + k], nl
        )
        scale = _scale(own, other, own_count, other_count)
        factor = np.float64(packet[FACING * LANES + k] * nl * through)
        factor *= scale if own > 0.0 else 0.0
        total[k] += light[k] * factor * packet[DIFFUSE_R * LANES + k]
        total[LANES + k] += light[LANES + k] * factor * packet[DIFFUSE_G * LANES + k]
        total[2 * LANES + k] += light[2 * LANES + k] * factor * packet[DIFFUSE_B * LANES + k]


@inner
def weigh(packet, light, density, is_light, own_count, other_count, valid, count):
    """Turn radiance `light` (48,) into what each lane's sample carries and mark what is traced.

    density : (16,) float64, that of the directions as samples of the light; the packet's PDF is
        theirs as samples of the BRDF. The samples are of the light where `is_light`.

    light = radiance · f_r · cosine · `_scale`
    """
    marked = 0
    for k in range(LANES):
        brdf = np.float64(packet[PDF * LANES + k])
        own = density[k] if is_light else brdf
        other = brdf if is_light else density[k]
        drawn = own > 0.0
        scale = _scale(own, other, own_count, other_count)
        red = light[k] * packet[RED * LANES + k] * scale
        green = light[LANES + k] * packet[GREEN * LANES + k] * scale
        blue = light[2 * LANES + k] * packet[BLUE * LANES + k] * scale
        light[k], light[LANES + k], light[2 * LANES + k] = red, green, blue
        carries = (red != 0.0) | (green != 0.0) | (blue != 0.0)
        facing = packet[FACING * LANES + k] != ZERO
        used = drawn & (k < count) & facing & carries
        valid[k] = -1 if used else 0
        marked += 1 if used else 0
    return marked


@inner
def add_unblocked(packet, valid, light, total):
    for k in range(LANES):
        lit = (valid[k] != 0) & (packet[T_FAR * LANES + k] >= ZERO)
        total[k] += light[k] if lit else 0.0
        total[LANES + k] += light[LANES + k] if lit else 0.0
        total[2 * LANES + k] += light[2 * LANES + k] if lit else 0.0


@kernel
def shade_points(scene, points, span, radiance, density_of, given, split, before, numbers, out):
    """Radiance of the points span[0] … span[1] into out (n, 3); returns the rays traced.

    points : `layout.Points`
    radiance : (h, 2h, 3), the map
    density_of, given, numbers : `layout.Density`, `layout.Given` and `layout.Numbers`
    split : n samples of the light and m of the BRDF for each point
    before : samples of the two that went before, whose numbers are skipped
    """
    return _shade_packets(
        scene, points, span, radiance, density_of, given, split, before, numbers, out, False, out,
        new_scratch(points.materials),
    )  # fmt: skip


@kernel
def shade_points_and_diffuse(
    scene, points, span, radiance, density_of, given, split, before, numbers, out, diffuse_out
):
    """`shade_points`, and into diffuse_out (n, 3) what its samples carry of diffuse light before
    shadows, also from below the geometry. A kernel of its own: the other is none the slower.
    """
    return _shade_packets(
        scene, points, span, radiance, density_of, given, split, before, numbers, out, True,
        diffuse_out, new_scratch(points.materials),
    )  # fmt: skip


@kernel
def new_scratch(materials):
    """A packet, and the arrays that its samples are worked on in."""
    return (
        new_packets(1)[0], new_valid(), query_arguments(False), lane_materials(materials),
        new_state(), new_drawn(), np.zeros(LANES), np.zeros(3 * LANES), np.zeros(3 * LANES),
        np.zeros(3 * LANES),
    )  # fmt: skip


@inner
def _shade_packets(
    scene, points, span, radiance, density_of, given, split, before, numbers, out, keeps_diffuse,
    diffuse_out, scratch,
):  # fmt: skip
    """`shade_points` in arrays that are there."""
    position, normal, geometric, toward_eye, material, materials, pixel, subpixel, _ = points
    subpixels = points.subpixels
    direction, densities, sent, shadowed = given
    packet, valid, arguments, lanes, state, drawn, density, light, total, diffuse = scratch
    texels, table = Texels(radiance.reshape(-1), radiance.shape[0]), density_of.table
    sequences = Sequences(state, numbers.independent)
    flux = table.marginal[-1] if len(table.marginal) else 1.0
    packets = (span[1] - span[0] + LANES - 1) // LANES
    traced, traced_brdf = 0, 0
    for p in range(packets):
        start, stop = span[0] + p * LANES, span[1]
        count = min(LANES, stop - start)
        ward = fill_packet(
            packet, start, stop, position, normal, geometric, toward_eye, material, lanes
        )
        if len(direction) == 0:
            begin_numbers(
                (start, stop), pixel, subpixel, subpixels, before, split, numbers.seed, STREAMS,
                state,
            )  # fmt: skip
        for k in range(3 * LANES):
            total[k] = 0.0
            if keeps_diffuse:
                diffuse[k] = 0.0
        for first in range(0, split[0] + split[1], AHEAD):
            last = min(first + AHEAD, split[0] + split[1])
            if len(direction) > 0:
                take_samples(direction, first, last, packets, p, texels, drawn)
            else:
                draw_samples(
                    packet, ward, (start, stop), points, (first, last), split[0], sequences, table,
                    texels, drawn,
                )  # fmt: skip
            for s in range(first, last):
                is_light = s < split[0]
                own, other = (split[0], split[1]) if is_light else (split[1], split[0])
                aim_drawn(packet, drawn, s - first)
                if keeps_diffuse:
                    face_above(packet)
                elif face_lights(packet) == 0:
                    continue
                row = (s * packets + p) * LANES
                reflect(packet)
                if ward:
                    reflect_ward(packet, start, stop, material, materials)
                if len(sent) > 0:
                    for k in range(LANES):
                        for channel in range(3):
                            light[channel * LANES + k] = sent[row + k, channel]
                else:
                    look_up(texels.radiance, drawn[TEXEL][s - first], light)
                if len(direction) > 0:
                    for k in range(LANES):
                        density[k] = densities[row + k]
                else:
                    find_densities(density_of, light, drawn[TEXEL][s - first], flux, density)
                if keeps_diffuse:
                    add_diffuse(packet, light, density, is_light, own, other, diffuse)
                    if face_lights(packet) == 0:
                        continue
                marked = weigh(packet, light, density, is_light, own, other, valid, count)
                if marked == 0:
                    continue
                if shadowed:
                    occluded(scene, valid, packet, arguments)
                    traced += marked
                    traced_brdf += 0 if is_light else marked
                add_unblocked(packet, valid, light, total)
        store_lanes(total, start, start + count, out)
        if keeps_diffuse:
            store_lanes(diffuse, start, start + count, diffuse_out)
    return traced - traced_brdf, traced_brdf
