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
from numba import njit
from numpy.typing import NDArray

from renderer import brdf
from renderer.embree import LANES, new_packet, new_valid, query_arguments
from renderer.low_discrepancy import fill_points
from renderer.monte_carlo import POINT_BLOCK
from renderer.rays import RayCount, flush_rays, new_ray_values, push_ray
from renderer.skips import DEFAULT, Skips
from renderer.view import View
from samplers.environment import EnvironmentMap
from samplers.lighting import DiscLights
from samplers.sphere import pixel_directions, pixel_of, row_solid_angle, turns
from samplers.threads import for_blocks

Mode = Literal["area", "centre"]
DISC_STREAM, AMBIENT_STREAM = 16, 8
AMBIENT_SAMPLES = 8
"""Unshadowed lookups at each glossy sub-pixel; a pixel's sub-pixels stratify each other."""
IRRADIANCE_HEIGHT = 32
"""Rows of the irradiance map: irradiance holds almost nothing above the second harmonic."""
CONVOLVED_HEIGHT = 64
"""Rows, at least, that a map is cut into before it is convolved."""


_irradiance_maps: weakref.WeakKeyDictionary[EnvironmentMap, NDArray[np.float32]] = (
    weakref.WeakKeyDictionary()
)


def irradiance_map(environment: EnvironmentMap) -> NDArray[np.float32]:
    """Irradiance ∫ L cos dω on planes of all orientations, (32, 64, 3) float32; once per map."""
    if environment not in _irradiance_maps:
        _irradiance_maps[environment] = _convolved(environment)
    return _irradiance_maps[environment]


def _convolved(environment: EnvironmentMap) -> NDArray[np.float32]:
    if environment.is_black:
        return np.zeros((IRRADIANCE_HEIGHT, 2 * IRRADIANCE_HEIGHT, 3), np.float32)
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
    result = np.stack([np.maximum(row @ towards.T, 0.0) @ flux for row in normal])
    return result.astype(np.float32)


@njit(nogil=True, cache=True)
def _wrapped(column, width):
    """A column from less than a turn outside, brought into the map."""
    if column < 0:
        return column + width
    return column - width if column >= width else column


@njit(nogil=True, cache=True)
def bilinear(image, x, y, z, out):
    """Bilinear lookup of a latitude-longitude image (H, 2H, 3) in a direction, into out (3,)."""
    height, width = image.shape[0], image.shape[1]
    bilinear_at(image, 2.0 * turns(math.sqrt(x * x + z * z), y) * height, turns(x, -z) * width, out)


@njit(nogil=True, cache=True)
def bilinear_at(image, row, column, out):
    """Bilinear lookup at a row and a column, which count from the edges of pixel (0, 0)."""
    height, width = image.shape[0], image.shape[1]
    row, column = row - 0.5, column - 0.5
    left, top = math.floor(column), math.floor(row)
    a, b = column - left, row - top
    # Beyond a pole lies the same row again, half a turn further.
    upper, upper_turn = (0, height) if top < 0 else (top, 0)
    lower, lower_turn = (height - 1, height) if top >= height - 1 else (top + 1, 0)
    first, second = _wrapped(left + upper_turn, width), _wrapped(left + upper_turn + 1, width)
    third, fourth = _wrapped(left + lower_turn, width), _wrapped(left + lower_turn + 1, width)
    for k in range(3):
        above = (1.0 - a) * image[upper, first, k] + a * image[upper, second, k]
        below = (1.0 - a) * image[lower, third, k] + a * image[lower, fourth, k]
        out[k] = (1.0 - b) * above + b * below


@njit(nogil=True, cache=True)
def _cap_direction(centre, half_angle, u0, u1):
    """A direction uniform in the cap of the given half angle around a unit centre."""
    radius = math.sqrt(u0) * math.sin(0.5 * half_angle)  # sin(θ/2), exact for small caps
    cosine = 1.0 - 2.0 * radius * radius
    sine = 2.0 * radius * math.sqrt(max(0.0, 1.0 - radius * radius))
    tx, ty, tz, bx, by, bz = brdf.frame(centre[0], centre[1], centre[2])
    x, y = sine * math.cos(2.0 * math.pi * u1), sine * math.sin(2.0 * math.pi * u1)
    return (
        x * tx + y * bx + cosine * centre[0],
        x * ty + y * by + cosine * centre[1],
        x * tz + y * bz + cosine * centre[2],
    )


@njit(nogil=True, cache=True)
def _shade_disc(
    scene, start, stop, position, normal, geometric, toward_eye, material, materials,
    centre, half_angle, irradiance, u, count, from_centre, skip_away, skip_zero, total,
):  # fmt: skip
    packet, valid, arguments = new_packet(), new_valid(), query_arguments(False)
    owner, value = new_ray_values()
    traced = skipped = lanes = 0
    for s in range(count):
        for i in range(start, stop):
            j = (i - start) * count + s
            lx, ly, lz = _cap_direction(centre, half_angle, u[j, 0], u[j, 1])
            skipped += 1
            nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
            above = geometric[i, 0] * lx + geometric[i, 1] * ly + geometric[i, 2] * lz
            sx, sy, sz = lx, ly, lz
            if from_centre:
                sx, sy, sz = centre[0], centre[1], centre[2]
            cosine = nx * sx + ny * sy + nz * sz
            if cosine <= 0.0 or above <= 0.0:
                if skip_away:
                    continue
                red = green = blue = 0.0
            else:
                red, green, blue = brdf.evaluate(
                    materials[material[i]], nx, ny, nz,
                    toward_eye[i, 0], toward_eye[i, 1], toward_eye[i, 2], sx, sy, sz,
                )  # fmt: skip
                share = cosine / count
                red, green, blue = (
                    red * share * irradiance[0],
                    green * share * irradiance[1],
                    blue * share * irradiance[2],
                )
                if skip_zero and red == 0.0 and green == 0.0 and blue == 0.0:
                    continue
            push_ray(packet, owner, value, lanes, position, i, lx, ly, lz, red, green, blue)
            skipped -= 1
            lanes += 1
            if lanes == LANES:
                flush_rays(scene, packet, valid, owner, value, lanes, start, total, arguments)
                traced += lanes
                lanes = 0
    if lanes > 0:
        flush_rays(scene, packet, valid, owner, value, lanes, start, total, arguments)
        traced += lanes
    return traced, skipped


@njit(nogil=True, cache=True)
def _add_ambient(
    start, stop, normal, toward_eye, material, materials, irradiance, radiance, u, total
):
    """Unshadowed light of the ambient map.

    The convolved map gives the diffuse part; samples of the BRDF gather only what a surface
    reflects beyond that, so that what is diffuse has no noise.
    """
    value = np.empty(3)
    count = len(u) // (stop - start)
    for i in range(start, stop):
        row = materials[material[i]]
        nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
        vx, vy, vz = toward_eye[i, 0], toward_eye[i, 1], toward_eye[i, 2]
        share = brdf.diffuse_share(row, nx * vx + ny * vy + nz * vz) * brdf.INV_PI
        bilinear(irradiance, nx, ny, nz, value)
        for k in range(3):
            total[i - start, k] += row[brdf.DIFFUSE + k] * share * value[k]
        if int(row[brdf.KIND]) == brdf.LAMBERT:
            continue
        for s in range(count):
            j = (i - start) * count + s
            lx, ly, lz, density = brdf.sample(
                row, nx, ny, nz, vx, vy, vz, u[j, 0], u[j, 1], u[j, 2]
            )
            if density <= 0.0:
                continue
            y, x = pixel_of(lx, ly, lz, radiance.shape[0])
            scale = (nx * lx + ny * ly + nz * lz) / (density * count)
            red, green, blue = brdf.evaluate(row, nx, ny, nz, vx, vy, vz, lx, ly, lz)
            red -= row[brdf.DIFFUSE] * share
            green -= row[brdf.DIFFUSE + 1] * share
            blue -= row[brdf.DIFFUSE + 2] * share
            total[i - start, 0] += red * scale * radiance[y, x, 0]
            total[i - start, 1] += green * scale * radiance[y, x, 1]
            total[i - start, 2] += blue * scale * radiance[y, x, 2]
        for k in range(3):
            total[i - start, k] = max(0.0, total[i - start, k])


def shade_discs(
    view: View, lights: DiscLights, seed: int, mode: Mode = "area", skips: Skips = DEFAULT
) -> tuple[NDArray[np.float32], RayCount]:
    """Radiance (n, 3) of the view's points under disc lights and their ambient map."""
    out = np.zeros((len(view), 3), np.float32)
    counts: list[tuple[int, int]] = []
    ambient = irradiance_map(lights.ambient)
    count = lights.rays_per_light
    ambient_count = 0 if view.is_lambertian or lights.ambient.is_black else AMBIENT_SAMPLES

    def points(start: int, stop: int) -> None:
        total = np.zeros((stop - start, 3))
        where = (view.pixel[start:stop], view.subpixel[start:stop], view.subpixels, 0)
        u = np.empty(((stop - start) * ambient_count, 3), np.float32)
        fill_points(*where, ambient_count, seed, AMBIENT_STREAM, u)
        _add_ambient(
            start, stop, view.normal, view.toward_eye, view.material, view.materials,
            ambient, lights.ambient.radiance, u, total,
        )  # fmt: skip
        u = np.empty(((stop - start) * count, 3), np.float32)
        for k in range(len(lights)):
            fill_points(*where, count, seed, DISC_STREAM + k, u)
            counts.append(
                _shade_disc(
                    view.embree.handle,
                    start,
                    stop,
                    view.position,
                    view.normal,
                    view.geometric,
                    view.toward_eye,
                    view.material,
                    view.materials,
                    lights.direction[k],
                    lights.half_angle[k],
                    lights.irradiance[k],
                    u,
                    count,
                    mode == "centre",
                    skips.facing_away,
                    skips.zero,
                    total,
                )
            )
        out[start:stop] = total

    for_blocks(points, len(view), POINT_BLOCK)
    traced, skipped = (sum(column) for column in zip(*counts, strict=True)) if counts else (0, 0)
    return out, RayCount(shadow=traced, skipped=skipped)
