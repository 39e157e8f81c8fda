"""Light that has bounced: irradiance tables on the faces of a place's solids.

Every face carries a grid of irradiance. Lamps, windows and the sun reach it directly, past the
other solids. A fixed set of cosine-distributed rays per grid point then finds which grid points it
sees and what of the sky; along these links light is passed on a few times. What the sun sends
directly is left out of the result, since its shadows are sharp and are traced per sample.

Cost: points × (light samples + rays) × solids, whatever the resolution of the map.
Source: Ward, Rubinstein & Clear, "A ray tracing solution for diffuse interreflection", SIGGRAPH
1988 (gathering from hemispheres at sparse points), with a regular grid for its points.
"""

import math

import numpy as np
from numpy.typing import NDArray

from experiments.maps.places.grid import Grid, cell_of
from experiments.maps.places.rays import FAR, MISS, nearest, occluded, panel_at
from experiments.maps.places.shapes import Array
from samplers.compiled import kernel
from samplers.sphere import pixel_of
from samplers.threads import for_blocks

RAYS = 48
BOUNCES = 3
POINTS_PER_BLOCK = 256


@kernel
def _direct(point, normal, lights, table, bounds, kind, room, start, stop, out):
    """Irradiance of light samples, rows of twelve numbers.

    They are position, normal (0: it shines all round), weight, window flag, a floor for squared
    distances, and the exponent of the cosine at the lamp. The weight is radiance × area, or
    intensity for a light that shines all round; a window's is multiplied by the sky's radiance from
    where it is looked through.
    """
    d = np.empty(3)
    for n in range(start, stop):
        for c in range(3):
            out[n, c] = 0.0
        for j in range(len(lights)):
            for k in range(3):
                d[k] = lights[j, k] - point[n, k]
            square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
            distance = math.sqrt(square)
            for k in range(3):
                d[k] /= distance
            cosine = normal[n, 0] * d[0] + normal[n, 1] * d[1] + normal[n, 2] * d[2]
            if cosine <= 0.0:
                continue
            aim = -(lights[j, 3] * d[0] + lights[j, 4] * d[1] + lights[j, 5] * d[2])
            if lights[j, 3] == 0.0 and lights[j, 4] == 0.0 and lights[j, 5] == 0.0:
                aim = 1.0
            if aim <= 0.0 or occluded(point[n], d, bounds, kind, room, distance - 0.02):
                continue
            factor = cosine * aim ** lights[j, 11] / (square + lights[j, 10])
            if lights[j, 9] > 0.0:
                row, column = pixel_of(d[0], d[1], d[2], table.shape[0])
                for c in range(3):
                    out[n, c] += factor * lights[j, 6 + c] * table[row, column, c]
            else:
                for c in range(3):
                    out[n, c] += factor * lights[j, 6 + c]


@kernel
def _link(point, normal, rays, offset, size, table, bounds, kind, room, panel_range, panel_bounds,
          start, stop, link, sky):  # fmt: skip
    """The grid point that each ray meets, −1 for none, and the irradiance of rays that escape."""
    d, p, u, v = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for n in range(start, stop):
        w = normal[n]
        side = 1 if abs(w[1]) < 0.9 else 0
        length = math.sqrt(1.0 - w[side] * w[side])
        for k in range(3):
            u[k] = ((1.0 if k == side else 0.0) - w[side] * w[k]) / length
        v[0] = w[1] * u[2] - w[2] * u[1]
        v[1] = w[2] * u[0] - w[0] * u[2]
        v[2] = w[0] * u[1] - w[1] * u[0]
        for c in range(3):
            sky[n, c] = 0.0
        for r in range(len(rays)):
            for k in range(3):
                d[k] = rays[r, 0] * u[k] + rays[r, 1] * v[k] + rays[r, 2] * w[k]
            t, solid, face = nearest(point[n], d, bounds, kind, room, FAR)
            link[n, r] = MISS
            if solid == MISS:
                row, column = pixel_of(d[0], d[1], d[2], table.shape[0])
                for c in range(3):
                    sky[n, c] += table[row, column, c] * math.pi / len(rays)
                continue
            for k in range(3):
                p[k] = point[n, k] + t * d[k]
            if panel_at(solid, face, p, panel_range, panel_bounds) == MISS:
                link[n, r] = cell_of(offset, size, bounds, kind, solid, face, p)


@kernel
def _pass_on(link, sky, reflected, start, stop, out):
    """Irradiance of the sky plus what the linked grid points reflect."""
    share = 1.0 / link.shape[1]
    for n in range(start, stop):
        red = green = blue = 0.0
        for r in range(link.shape[1]):
            other = link[n, r]
            if other != MISS:
                red += reflected[other, 0]
                green += reflected[other, 1]
                blue += reflected[other, 2]
        out[n, 0] = sky[n, 0] + red * share
        out[n, 1] = sky[n, 1] + green * share
        out[n, 2] = sky[n, 2] + blue * share


def cosine_rays(count: int) -> Array:
    """A spiral of directions (count, 3) about +z with density cos θ/π."""
    k = np.arange(count) + 0.5
    radius, turn = np.sqrt(k / count), k * (math.pi * (3.0 - math.sqrt(5.0)))
    return np.stack(
        [radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1.0 - k / count)], axis=1
    )


def irradiance(
    grid: Grid,
    solids: tuple[Array, NDArray[np.int64], bool],
    panels: tuple[NDArray[np.int64], Array],
    albedo: Array,
    lights: Array,
    sunlight: Array,
    table: Array,
) -> Array:
    """Irradiance (points, 3) at the grid's points, without what the sun sends directly.

    solids : bounds, kind and whether the first is a room; panels : range per face and bounds
    albedo : (solids, 3); lights : (m, 12) light samples; sunlight : (points, 3) direct irradiance
    table : (h, 2h, 3) the sky, for rays that escape and for windows
    """
    count, rays = len(grid.point), cosine_rays(RAYS)
    direct, bounced, sky = (np.empty((count, 3)) for _ in range(3))
    link = np.empty((count, RAYS), np.int32)

    def light(start: int, stop: int) -> None:
        _direct(grid.point, grid.normal, lights, table, *solids, start, stop, direct)
        _link(grid.point, grid.normal, rays, grid.offset, grid.size, table, *solids, *panels,
              start, stop, link, sky)  # fmt: skip

    for_blocks(light, count, POINTS_PER_BLOCK)
    reflectance = albedo[grid.solid]
    bounced[:] = 0.0
    for _ in range(BOUNCES):
        reflected = (direct + sunlight + bounced) * reflectance

        def gather(start: int, stop: int, reflected: Array = reflected) -> None:
            _pass_on(link, sky, reflected, start, stop, bounced)

        for_blocks(gather, count, POINTS_PER_BLOCK)
    return direct + bounced
