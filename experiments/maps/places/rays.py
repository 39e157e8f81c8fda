"""Rays against a few boxes and upright cylinders, compiled.

A place is built of axis-aligned boxes and of cylinders along y, both given by their bounds; the
first may be a room, which is hit from the inside. A face is 2·axis for the side towards −axis and
2·axis + 1 for the other; the mantle of a cylinder is face 0.

Source: Kay & Kajiya, "Ray tracing complex scenes", SIGGRAPH 1986 (slabs).
"""

import math

import numpy as np

from samplers.compiled import kernel

BOX, CYLINDER = 0, 1
FAR = 1e9
MISS = -1


@kernel
def _inverse(component):
    return 1.0 / (component if abs(component) > 1e-12 else 1e-12)


@kernel
def _slabs(o, ix, iy, iz, bounds):
    """Entry and exit distances of a ray, given the inverse of its direction, and a box."""
    a, b = (bounds[0] - o[0]) * ix, (bounds[3] - o[0]) * ix
    near, far = (a, b) if a < b else (b, a)
    a, b = (bounds[1] - o[1]) * iy, (bounds[4] - o[1]) * iy
    if a > b:
        a, b = b, a
    near, far = a if a > near else near, b if b < far else far
    a, b = (bounds[2] - o[2]) * iz, (bounds[5] - o[2]) * iz
    if a > b:
        a, b = b, a
    return a if a > near else near, b if b < far else far


@kernel
def _face_of(o, d, t, bounds):
    """The face of a box that a ray meets at distance t: the one whose plane is nearest to it."""
    best, face = FAR, 0
    for k in range(3):
        p = o[k] + t * d[k]
        size = bounds[k + 3] - bounds[k] + 1e-12
        for side in range(2):
            gap = abs(p - bounds[k + 3 * side]) / size
            if gap < best:
                best, face = gap, 2 * k + side
    return face


@kernel
def _cylinder(o, d, bounds, limit):
    """Distance and face of a ray and an upright cylinder from outside; FAR where it misses."""
    radius = 0.5 * (bounds[3] - bounds[0])
    x, z = o[0] - 0.5 * (bounds[0] + bounds[3]), o[2] - 0.5 * (bounds[2] + bounds[5])
    a = d[0] * d[0] + d[2] * d[2]
    b = x * d[0] + z * d[2]
    c = x * x + z * z - radius * radius
    best, face = FAR, 0
    root = b * b - a * c
    if a > 1e-12 and root > 0.0:
        t = (-b - math.sqrt(root)) / a
        y = o[1] + t * d[1]
        if 1e-6 < t < limit and bounds[1] <= y <= bounds[4]:
            best = t
    if abs(d[1]) > 1e-12:
        top = d[1] < 0.0
        t = ((bounds[4] if top else bounds[1]) - o[1]) / d[1]
        px, pz = x + t * d[0], z + t * d[2]
        if 1e-6 < t < min(best, limit) and px * px + pz * pz < radius * radius:
            best, face = t, 3 if top else 2
    return best, face


@kernel
def nearest(o, d, bounds, kind, room, limit):
    """Distance, solid and face of the first hit nearer than `limit`; solid is −1 without one."""
    ix, iy, iz = _inverse(d[0]), _inverse(d[1]), _inverse(d[2])
    best, solid, face = limit, MISS, 0
    for i in range(len(bounds)):
        near, far = _slabs(o, ix, iy, iz, bounds[i])
        if i == 0 and room:
            if 1e-6 < far < best:
                best, solid = far, i
        elif near <= far and far > 1e-6 and near < best:
            if kind[i] == CYLINDER:
                t, side = _cylinder(o, d, bounds[i], best)
                if t < best:
                    best, solid, face = t, i, side
            elif near > 1e-6:
                best, solid = near, i
    if solid != MISS and kind[solid] == BOX:
        face = _face_of(o, d, best, bounds[solid])
    return best, solid, face


@kernel
def occluded(o, d, bounds, kind, room, limit):
    """Whether anything but the room itself stands before the distance `limit`."""
    ix, iy, iz = _inverse(d[0]), _inverse(d[1]), _inverse(d[2])
    for i in range(1 if room else 0, len(bounds)):
        near, far = _slabs(o, ix, iy, iz, bounds[i])
        if near <= far and far > 1e-6 and near < limit:
            if kind[i] == CYLINDER:
                if _cylinder(o, d, bounds[i], limit)[0] < limit:
                    return True
            elif near > 1e-6:
                return True
    return False


@kernel
def panel_at(solid, face, p, panel_range, panel_bounds):
    """Index of the first panel of a solid's face that holds the point p, or −1."""
    a, b = (face // 2 + 1) % 3, (face // 2 + 2) % 3
    for i in range(panel_range[solid, face, 0], panel_range[solid, face, 1]):
        r = panel_bounds[i]
        if r[0] <= p[a] < r[2] and r[1] <= p[b] < r[3]:
            return i
    return MISS


@kernel
def trace(origin, direction, bounds, kind, room, panel_range, panel_bounds, distance, hit):
    """Distance (n,) and solid, face, panel (n, 3) of the first hits of rays from `origin`."""
    point = np.empty(3)
    for n in range(len(direction)):
        o = origin[n if len(origin) > 1 else 0]
        t, solid, face = nearest(o, direction[n], bounds, kind, room, FAR)
        distance[n] = t
        hit[n, 0], hit[n, 1], hit[n, 2] = solid, face, MISS
        if solid != MISS and len(panel_bounds):
            for k in range(3):
                point[k] = o[k] + t * direction[n, k]
            hit[n, 2] = panel_at(solid, face, point, panel_range, panel_bounds)


@kernel
def sees_sun(origin, normal, sun, bounds, kind, room, panel_range, panel_bounds, clear, out):
    """How a point sees the sun: 0 not, 1 past all solids, 2 + i through the clear panel i."""
    point = np.empty(3)
    start = np.empty(3)
    for n in range(len(origin)):
        out[n] = 0
        if normal[n, 0] * sun[0] + normal[n, 1] * sun[1] + normal[n, 2] * sun[2] <= 0.0:
            continue
        for k in range(3):
            start[k] = origin[n, k] + 1e-4 * normal[n, k]
        if occluded(start, sun, bounds, kind, room, FAR):
            continue
        out[n] = 1
        if room:
            t, solid, face = nearest(start, sun, bounds[:1], kind[:1], True, FAR)
            for k in range(3):
                point[k] = start[k] + t * sun[k]
            panel = panel_at(solid, face, point, panel_range, panel_bounds)
            out[n] = 2 + panel if panel != MISS and clear[panel] else 0
