"""Closed solids: boxes, plates, spheres, tori, cylinders and a ground to put them on."""

import numpy as np

from renderer.modelling.curves import arc, rounded
from renderer.modelling.shape import Shape, weld
from renderer.modelling.surfaces import grid, lathe

Size = tuple[float, float, float]


def box(size: Size) -> Shape:
    """An axis-aligned box about the origin: 12 triangles."""
    half = 0.5 * np.asarray(size)
    corner = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    face = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangle = [[a, b, c] for a, b, c, _ in face] + [[a, c, d] for a, _, c, d in face]
    return Shape(corner, np.array(triangle))


def rounded_box(size: Size, radius: float, steps: int = 4) -> Shape:
    """A box about the origin whose edges and corners are rounded.

    radius : of the edges, at most half of the shortest side
    steps : rows of triangles from a face's plane to the middle of an edge
    """
    half = 0.5 * np.asarray(size)
    angle = np.radians(np.linspace(-45.0, 0.0, steps + 1))
    slope = np.tan(np.concatenate([angle, -angle[::-1]]))
    sign = np.repeat([-1.0, 1.0], steps + 1)
    faces = []
    for axis in range(3):
        across, along = (axis + 1) % 3, (axis + 2) % 3
        for outward in (1.0, -1.0):
            direction = np.empty((len(slope), len(slope), 3))
            direction[..., axis] = outward
            direction[..., across] = outward * slope
            direction[..., along] = slope[:, None]
            direction /= np.linalg.norm(direction, axis=2, keepdims=True)
            core = np.empty_like(direction)
            core[..., axis] = outward
            core[..., across] = outward * sign
            core[..., along] = sign[:, None]
            faces.append(core * (half - radius) + radius * direction)
    return weld(grid(np.stack(faces)))


def plate(
    width: float, depth: float, height: float, corner: float, bevel: float, steps: int = 6
) -> Shape:
    """A plate of rounded outline that lies on y = 0; its upper edge is bevelled to an arc.

    corner : radius of the outline's corners; bevel : radius of the upper edge, at most `corner`
    """
    fall = arc((0.0, 0.0), bevel, 0.0, 90.0, steps)
    inset = np.concatenate([[0.0], bevel - fall[:, 0]])
    level = np.concatenate([[0.0], height - bevel + fall[:, 1]])
    quarter = np.radians(np.linspace(0.0, 90.0, 2 * steps + 1))
    angle = (quarter + np.radians([[0.0], [90.0], [180.0], [270.0]])).ravel()
    center = np.repeat([[1, 1], [-1, 1], [-1, -1], [1, -1]], len(quarter), axis=0)
    center = center * (0.5 * width - corner, 0.5 * depth - corner)
    reach = corner - inset[:, None]
    rows = np.stack(
        np.broadcast_arrays(
            center[:, 0] + reach * np.cos(angle),
            level[:, None],
            -center[:, 1] - reach * np.sin(angle),
        ),
        axis=2,
    )
    below = np.zeros((1, rows.shape[1], 3))
    above = below + np.array([0.0, height, 0.0])
    return weld(grid(np.concatenate([below, rows, above]), closed_columns=True))


def sphere(radius: float, steps: int = 48) -> Shape:
    """A sphere about the origin with even triangles: a cube's grid, pushed out to the sphere.

    steps : intervals along an edge of the cube; 12 steps² triangles
    """
    slope = np.tan(np.radians(np.linspace(-45.0, 45.0, steps + 1)))
    faces = []
    for axis in range(3):
        for outward in (1.0, -1.0):
            direction = np.empty((steps + 1, steps + 1, 3))
            direction[..., axis] = outward
            direction[..., (axis + 1) % 3] = outward * slope
            direction[..., (axis + 2) % 3] = slope[:, None]
            faces.append(direction / np.linalg.norm(direction, axis=2, keepdims=True))
    return weld(grid(radius * np.stack(faces)))


def torus(radius: float, thickness: float, segments: int = 128, around: int = 48) -> Shape:
    """A ring about the +Y axis.

    radius : of the circle that the tube follows; thickness : radius of the tube
    """
    angle = np.arange(segments)[:, None] * (2.0 * np.pi / segments)
    turn = np.arange(around) * (2.0 * np.pi / around)
    reach = radius + thickness * np.cos(turn)
    points = np.stack(
        np.broadcast_arrays(reach * np.cos(angle), thickness * np.sin(turn), reach * np.sin(angle)),
        axis=2,
    )
    return grid(points, closed_rows=True, closed_columns=True)


def cylinder(radius: float, height: float, bevel: float = 0.0, segments: int = 96) -> Shape:
    """A cylinder about the +Y axis that stands on y = 0; its edges are rounded by `bevel`."""
    outline = [(0.0, 0.0), (radius, 0.0), (radius, height), (0.0, height)]
    return lathe(rounded(outline, bevel), segments)


def ground(radius: float, thickness: float = 0.3, segments: int = 512) -> Shape:
    """A round table top whose upper side is y = 0, about the origin, with a rounded edge."""
    outline = [(0.0, -thickness), (radius, -thickness), (radius, 0.0), (0.0, 0.0)]
    return lathe(rounded(outline, (0.2 * thickness, 0.45 * thickness)), segments)


def square(size: float) -> Shape:
    """A square on y = 0 about the origin that is seen from above: two triangles, not closed."""
    half = 0.5 * size
    corner = [(-half, 0.0, half), (half, 0.0, half), (half, 0.0, -half), (-half, 0.0, -half)]
    return Shape(np.array(corner), np.array([[0, 1, 2], [0, 2, 3]]))
