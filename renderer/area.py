"""Disc lights with soft shadows, over an unshadowed ambient map.

A disc light is a spherical cap of uniform radiance. Rays are stratified over the cap by
low-discrepancy points, different at each sub-pixel. In the mode "area" each ray carries its own
share of the integral, with the BRDF and the cosine of its own direction. In the mode "centre" all
of a light comes from its centre and the rays only measure how much of the cap is visible, which is
what the paper's penumbra wedges compute.

The ambient map casts no shadows (it leaks into occluded places, as in the paper). Its irradiance is
convolved once; what glossy surfaces reflect beyond a diffuse one is gathered along directions drawn
from their BRDF.
"""

import math
import weakref
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from renderer.direct import trace_light
from renderer.monte_carlo import POINT_BLOCK
from renderer.packet import coated, lambert, material_table
from renderer.packet.embree import DIR_X, DIR_Y, DIR_Z, LANES, new_valid, query_arguments
from renderer.packet.lane_samples import (
    ask_for_texels,
    find_texels,
    look_up,
    packet_numbers,
    store_packets,
)
from renderer.packet.lanes import aim, aim_each, face_lights, packets_of
from renderer.packet.layout import (
    BLUE,
    COSINE,
    FACING,
    GREEN,
    GX,
    GY,
    GZ,
    NV,
    NX,
    NY,
    NZ,
    ONE,
    PDF,
    RED,
    ZERO,
)
from renderer.packet.reflectance import draw, reflect, reflect_ward
from renderer.rays import RayCount
from renderer.view import View
from samplers.compiled import inner, kernel
from samplers.environment import EnvironmentMap
from samplers.grids.bilinear import bilinear_at
from samplers.lighting import DiscLights
from samplers.sphere import RUN, map_positions, pixel_directions, row_solid_angle, sine_cosine
from samplers.threads import block_of, for_blocks

Mode = Literal["area", "centre"]
DISC_STREAM, AMBIENT_STREAM = 16, 8
AMBIENT_SAMPLES = 8
"""Unshadowed lookups at each glossy sub-pixel; a pixel's sub-pixels stratify each other."""
IRRADIANCE_HEIGHT = 32
"""Rows of the irradiance map: irradiance holds almost nothing above the second harmonic."""
CONVOLVED_HEIGHT = 64
"""Rows, at least, that a map is cut into before it is convolved."""


_irradiance_maps: weakref.WeakKeyDictionary[EnvironmentMap, NDArray[np.float64]] = (
    weakref.WeakKeyDictionary()
)


def irradiance_map(environment: EnvironmentMap) -> NDArray[np.float64]:
    """Irradiance ∫ L cos dω on planes of all orientations, (32, 64, 3); once per map.

    It may be π times what the map holds, which float32 cannot hold of the largest maps.
    """
    if environment not in _irradiance_maps:
        _irradiance_maps[environment] = _convolved(environment)
    return _irradiance_maps[environment]


def _convolved(environment: EnvironmentMap) -> NDArray[np.float64]:
    if environment.is_black:
        return np.zeros((IRRADIANCE_HEIGHT, 2 * IRRADIANCE_HEIGHT, 3))
    source = environment.radiance.astype(np.float64)
    finer = -(-CONVOLVED_HEIGHT // environment.height)
    source = source.repeat(finer, axis=0).repeat(finer, axis=1)
    factor = len(source) // CONVOLVED_HEIGHT
    while len(source) % factor:
        factor -= 1
    height = len(source) // factor
    flux = source * row_solid_angle(len(source), 2 * len(source))[:, None, None]
    flux = flux.reshape(height, factor, 2 * height, factor, 3).sum(axis=(1, 3)).reshape(-1, 3)
    towards = pixel_directions(height).reshape(-1, 3)
    normal = pixel_directions(IRRADIANCE_HEIGHT)
    out = np.empty_like(normal)
    for_blocks(lambda a, b: _add_cosines(normal[a:b], towards, flux, out[a:b]), len(normal), 1)
    return out


@kernel
def _add_cosines(normal, towards, flux, out):
    """Irradiance on planes of these normals, (rows, columns, 3): flux @ max(0, towards · n)."""
    for row in range(len(normal)):
        for column in range(normal.shape[1]):
            x, y, z = normal[row, column]
            red = green = blue = 0.0
            for k in range(len(towards)):
                cosine = max(0.0, x * towards[k, 0] + y * towards[k, 1] + z * towards[k, 2])
                red += cosine * flux[k, 0]
                green += cosine * flux[k, 1]
                blue += cosine * flux[k, 2]
            out[row, column, 0], out[row, column, 1], out[row, column, 2] = red, green, blue


@inner
def _face_caps(packet, centre, half_angle, u):
    """Directions uniform in the cap around a unit centre into the packet's rows."""
    reach = math.sin(0.5 * half_angle)
    tx, ty, tz, bx, by, bz = lambert.frame(centre[0], centre[1], centre[2])
    cx, cy, cz = centre[0], centre[1], centre[2]
    for k in range(LANES):
        radius = math.sqrt(np.float64(u[k, 0])) * reach  # sin(θ/2), exact for small caps
        cosine = 1.0 - 2.0 * radius * radius
        sine = 2.0 * radius * math.sqrt(max(0.0, 1.0 - radius * radius))
        up, across = sine_cosine(np.float64(u[k, 1]))
        x, y = sine * across, sine * up
        packet[DIR_X * LANES + k] = x * tx + y * bx + cosine * cx
        packet[DIR_Y * LANES + k] = x * ty + y * by + cosine * cy
        packet[DIR_Z * LANES + k] = x * tz + y * bz + cosine * cz


@inner
def _face_centre(packet, centre):
    """COSINE of the centre, and FACING where it and the ray are above; how many lanes face."""
    facing = 0
    x, y, z = np.float32(centre[0]), np.float32(centre[1]), np.float32(centre[2])
    for k in range(LANES):
        cosine = (
            packet[NX * LANES + k] * x + packet[NY * LANES + k] * y + packet[NZ * LANES + k] * z
        )
        above = (
            packet[GX * LANES + k] * packet[DIR_X * LANES + k]
            + packet[GY * LANES + k] * packet[DIR_Y * LANES + k]
            + packet[GZ * LANES + k] * packet[DIR_Z * LANES + k]
        )
        faces = (cosine > ZERO) & (above > ZERO)
        packet[COSINE * LANES + k] = cosine
        packet[FACING * LANES + k] = ONE if faces else ZERO
        facing += 1 if faces else 0
    return facing


@kernel
def _add_disc(
    scene, packets, ward, points, material, materials, centre, half_angle, irradiance, u, count,
    from_centre, total,
):  # fmt: skip
    """Add one disc's light to `total` (packets, 48); returns the rays traced.

    u : (rows, 3), numbers for `count` rays of each point
    """
    valid, arguments = new_valid(), query_arguments(True)
    share, traced = irradiance / count, 0
    directions = np.empty(3 * LANES, np.float32)
    for b in range(len(packets)):
        packet, start = packets[b], points[0] + b * LANES
        used = min(LANES, points[1] - start)
        for s in range(count):
            row = (s * len(packets) + b) * LANES
            _face_caps(packet, centre, half_angle, u[row : row + LANES])
            facing = _face_centre(packet, centre) if from_centre else face_lights(packet)
            if facing == 0:
                continue
            if from_centre:
                _copy(packet, DIR_X * LANES, directions, 0)
                aim(packet, centre[0], centre[1], centre[2])
            reflect(packet)
            if ward:
                reflect_ward(packet, start, points[1], material, materials)
            if from_centre:
                _copy(directions, 0, packet, DIR_X * LANES)
            traced += trace_light(scene, arguments, packet, valid, used, share, total[b])
    return traced


@inner
def _copy(source, start, target, to):
    """Three coordinates of a packet, lane by lane; assigning slices takes seconds to compile."""
    for k in range(3 * LANES):
        target[to + k] = source[start + k]


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
def _face_unshadowed(packet):
    """COSINE and FACING by the shading normal alone, since nothing packets the ambient light."""
    for k in range(LANES):
        cosine = (
            packet[NX * LANES + k] * packet[DIR_X * LANES + k]
            + packet[NY * LANES + k] * packet[DIR_Y * LANES + k]
            + packet[NZ * LANES + k] * packet[DIR_Z * LANES + k]
        )
        packet[COSINE * LANES + k] = cosine
        packet[FACING * LANES + k] = ONE if cosine > ZERO else ZERO


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
def _add_ambient(
    packets, ward, points, normal, material, materials, pixel, subpixel, subpixels, seed,
    irradiance, radiance, count, total,
):  # fmt: skip
    """Unshadowed light of the ambient map.

    The convolved map gives the diffuse part; samples of the BRDF gather only what a surface
    reflects beyond that, so that what is diffuse has no noise.
    """
    way, place, value = np.zeros(3 * RUN), np.empty(2 * RUN), np.empty(3)
    diffuse, light = np.empty(4 * LANES), np.empty(3 * LANES)
    texels, height = radiance.reshape(-1), radiance.shape[0]
    texel = np.empty(count * LANES, np.int32)
    u = np.empty((count * LANES, 3), np.float32)
    direction = np.empty((count * LANES, 3), np.float32)
    for b in range(len(packets)):
        packet, start = packets[b], points[0] + b * LANES
        used = min(LANES, points[1] - start)
        glossy = _diffuse_parts(packet, start, points[1], material, materials, diffuse)
        map_positions(normal, start, used, len(irradiance), way, place)
        for k in range(used):
            bilinear_at(irradiance, place[k], place[RUN + k], value)
            for channel in range(3):
                total[b, channel * LANES + k] = diffuse[channel * LANES + k] * value[channel]
        if not glossy or count == 0:
            continue
        here = (start, start + used)
        packet_numbers(here, pixel, subpixel, subpixels, 0, count, seed, AMBIENT_STREAM, False, u)
        draw(packets[b : b + 1], ward, here, material, materials, u, count, direction)
        for s in range(count):
            aim_each(packet, direction, s * LANES)
            find_texels(packet[DIR_X * LANES :], height, texel[s * LANES :])
            ask_for_texels(texels, texel[s * LANES :])
        for s in range(count):
            aim_each(packet, direction, s * LANES)
            _face_unshadowed(packet)
            reflect(packet)
            if ward:
                reflect_ward(packet, start, points[1], material, materials)
            look_up(texels, texel[s * LANES :], light)
            _add_beyond_diffuse(packet, light, diffuse, count, total[b])
        for k in range(3 * LANES):
            total[b, k] = max(0.0, total[b, k])


def shade_discs(
    view: View, lights: DiscLights, seed: int, mode: Mode = "area"
) -> tuple[NDArray[np.float32], RayCount]:
    """Radiance (n, 3) of the view's points under disc lights and their ambient map."""
    out = np.zeros((len(view), 3), np.float32)
    counts: list[int] = []
    ambient = irradiance_map(lights.ambient)
    # A copy may be written, as the irradiance of fixed lights: one compiled kernel for both.
    irradiance = lights.irradiance.copy()
    count = lights.rays_per_light
    ambient_count = 0 if view.is_lambertian or lights.ambient.is_black else AMBIENT_SAMPLES

    def shade(start: int, stop: int) -> None:
        points = (start, stop)
        packets, ward = packets_of(points, *view.surface, view.material, view.materials)
        total = np.zeros((len(packets), 3 * LANES))
        _add_ambient(
            packets, ward, points, view.normal, view.material, view.materials, view.pixel,
            view.subpixel, view.subpixels, seed, ambient, lights.ambient.radiance, ambient_count,
            total,
        )  # fmt: skip
        u = np.empty((len(packets) * count * LANES, 3), np.float32)
        for k in range(len(lights)):
            packet_numbers(
                points, view.pixel, view.subpixel, view.subpixels, 0, count, seed,
                DISC_STREAM + k, False, u,
            )  # fmt: skip
            counts.append(
                _add_disc(
                    view.embree.handle,
                    packets,
                    ward,
                    points,
                    view.material,
                    view.materials,
                    lights.direction[k],
                    lights.half_angle[k],
                    irradiance[k],
                    u,
                    count,
                    mode == "centre",
                    total,
                )
            )
        store_packets(total, points, out)

    for_blocks(shade, len(view), block_of(len(view), POINT_BLOCK))
    traced = sum(counts)
    return out, RayCount(shadow=traced, skipped=len(view) * count * len(lights) - traced)
