"""Shapes are closed, of the right size and turned outwards; normals smooth but for edges."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from renderer.modelling import (
    Shape,
    arc,
    bezier,
    box,
    cylinder,
    ground,
    lathe,
    plate,
    rounded,
    rounded_box,
    shade,
    sphere,
    spline,
    sweep,
    torus,
    tube,
    vessel,
    weld,
)
from renderer.modelling.surfaces import _frames
from renderer.modelling.teapot import body, handle, spout, teapot
from tests.renderer import lab
from tests.samplers.maps import data_folder


def solid(shape: Shape) -> trimesh.Trimesh:
    return trimesh.Trimesh(shape.vertex, shape.triangle, process=False)


def helix() -> np.ndarray:
    t = np.linspace(0.0, 9.0, 120)
    return np.stack([np.cos(t), 0.3 * t, np.sin(t)], axis=1)


def trefoil() -> np.ndarray:
    t = np.arange(300) * (2.0 * np.pi / 300)
    reach = 2.0 + np.cos(3.0 * t)
    return np.stack([reach * np.cos(2 * t), np.sin(3 * t), reach * np.sin(2 * t)], axis=1)


SOLIDS = {
    "box": lambda: box((1.0, 2.0, 3.0)),
    "rounded box": lambda: rounded_box((1.0, 2.0, 3.0), 0.2),
    "ball of a box": lambda: rounded_box((1.0, 1.0, 1.0), 0.5),
    "plate": lambda: plate(2.0, 1.0, 0.2, 0.3, 0.1),
    "sphere": lambda: sphere(1.0, 12),
    "torus": lambda: torus(1.0, 0.3, 40, 20),
    "cylinder": lambda: cylinder(1.0, 2.0, 0.1),
    "ground": lambda: ground(5.0),
    "tube": lambda: tube(helix(), np.linspace(0.1, 0.2, 120)),
    "closed tube": lambda: tube(trefoil(), 0.3, 20, closed=True),
    "two-point tube": lambda: tube([(0, 0, 0), (0, 1, 0)], 0.2),
    "sweep": lambda: sweep(helix(), [(1, 0), (0, 0.1), (-1, 0), (0, -0.1)], 0.3),
    "vessel": lambda: lathe(vessel([(0.5, 0), (0.9, 0.5), (1.0, 1.5)], 0.1, 0.15, 0.02), 40),
    "teapot body": lambda: body(8),
    "teapot handle": lambda: handle(8),
    "teapot spout": lambda: spout(8),
    "scaled": lambda: sphere(1.0, 6).scaled(1.0, 2.0, 0.5),
    "mirrored": lambda: sphere(1.0, 6).scaled(-1.0, 2.0, 0.5),
    "turned": lambda: box((1.0, 2.0, 3.0)).turned("x", 30).turned("y", 50).turned("z", 70),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_are_closed_and_turned_outwards(name):
    mesh = solid(SOLIDS[name]())
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.body_count == 1
    assert mesh.volume > 0.0


@pytest.mark.parametrize("name", SOLIDS)
def test_normals_are_unit_and_on_the_outer_side_of_every_triangle(name):
    lab.assert_normals_face_outwards(shade(SOLIDS[name]()))


def test_volumes_of_prisms_are_exact():
    # Sums of a few hundred products of numbers near 1: rounding stays below 1e-12.
    assert solid(box((1.0, 2.0, 3.0))).volume == pytest.approx(6.0, abs=1e-12)
    prism = 0.5 * 96 * np.sin(2.0 * np.pi / 96) * 1.5**2 * 2.0
    assert solid(cylinder(1.5, 2.0, 0.0, 96)).volume == pytest.approx(prism, abs=1e-11)


def test_torus_has_pappus_volume():
    segments, around = 64, 32
    exact = 2.0 * np.pi**2 * 0.3**2

    def inscribed(count: int) -> float:
        return np.sin(2.0 * np.pi / count) / (2.0 * np.pi / count)

    # Its cells are flat, so it is exactly a polygon carried around a polygon.
    volume = solid(torus(1.0, 0.3, segments, around)).volume
    assert volume == pytest.approx(exact * inscribed(segments) * inscribed(around), rel=1e-12)


def test_edges_sharper_than_the_crease_stay_sharp():
    sharp, smooth = shade(box((1.0, 1.0, 1.0)), 89.0), shade(box((1.0, 1.0, 1.0)), 91.0)
    assert len(sharp.vertex) == 24
    assert np.abs(sharp.normal).max(axis=1) == pytest.approx(1.0)
    assert len(smooth.vertex) == len(shade(box((1.0, 1.0, 1.0)), 180.0).vertex) == 8
    # By symmetry, whichever way the squares are cut.
    assert np.abs(smooth.normal) == pytest.approx(np.sqrt(1.0 / 3.0), abs=1e-6)


def test_flat_faces_keep_their_normal_beside_a_narrow_bevel():
    mesh = shade(rounded_box((1.0, 1.0, 1.0), 0.01, 4))
    on_top = mesh.vertex[:, 1] == mesh.vertex[:, 1].max()
    # Two bevel strips of width 0.01 · π/16 lean by half of that angle against a face of 0.96.
    tilt = 2.0 * 0.01 * (np.pi / 16) * (np.pi / 32) / 0.96
    assert on_top.sum() == 4
    assert np.linalg.norm(mesh.normal[on_top][:, [0, 2]], axis=1).max() < 2.0 * tilt


def test_triangles_that_disagree_about_the_outside_share_no_normal():
    # The second triangle is folded back over the first; with the first one's winding its normal
    # is nearly opposite, with the other winding nearly equal although the sheet turns inside out.
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 1], [0.1, 0.1, 0.1]])
    assert len(shade(Shape(corner, np.array([[0, 1, 2], [2, 3, 1]]))).vertex) == 6
    unfolded = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 1], [1, 0.1, 1]])
    assert len(shade(Shape(unfolded, np.array([[0, 1, 2], [1, 3, 2]]))).vertex) == 4


def test_a_folded_sheet_still_has_unit_normals():
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 1]])
    folded = Shape(corner, np.array([[0, 1, 2], [0, 2, 1]]))
    assert np.abs(shade(folded, 180.0).normal[:, 1]) == pytest.approx(1.0)


def test_weld_joins_twins_and_drops_what_collapses():
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1e-9, 0, 0], [1, 1e-9, 0], [1, 1, 0]])
    welded = weld(Shape(corner, np.array([[0, 1, 2], [4, 5, 2], [0, 3, 5]])))
    assert len(welded.vertex) == 4
    assert len(welded.triangle) == 2
    apart = weld(Shape(corner + np.arange(6)[:, None] * 1e-5, np.array([[0, 1, 2], [3, 4, 5]])))
    assert len(apart.vertex) == 6


@pytest.mark.parametrize("fraction", [1 / 256, 1 / 3, 0.05, 1 / 1024])
def test_weld_joins_twins_that_rounding_has_parted(fraction):
    value = fraction * (1.0 + np.array([-1e-13, 1e-13]))
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [value[0], 1, 0], [value[1], 1, 0]])
    assert len(weld(Shape(corner, np.array([[0, 1, 2], [0, 1, 3]]))).vertex) == 3


def test_turns_are_right_handed():
    x, y, z = np.eye(3)
    for axis, before, after in (("x", y, z), ("y", z, x), ("z", x, y)):
        turned = Shape(before[None], np.zeros((0, 3), np.int64)).turned(axis, 90.0)
        assert turned.vertex[0] == pytest.approx(after, abs=1e-15)


def test_closed_sweep_has_no_seam():
    section = np.array([(1.0, 0), (0, 0.3), (-1, 0), (0, -0.3)])
    shape = sweep(trefoil(), 0.2 * section, closed=True)
    # Each quarter of the section runs along the path: were the ends not matched, the edges over
    # the seam would be longer than all others.
    edge = np.linalg.norm(
        shape.vertex[shape.triangle] - np.roll(shape.vertex[shape.triangle], 1, axis=1), axis=2
    )
    points = trefoil()
    step = np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1).max()
    # Curvature below 1 and 0.2 of reach stretch a step by 1.2 at most; its diagonal crosses a
    # side of the section, 0.21 long; an even twist adds its share.
    assert edge.max() < np.hypot(1.3 * step, 0.22)


def test_frames_are_orthonormal_and_do_not_turn_about_the_path():
    path = helix()
    side, above = _frames(path, np.array([0.0, 1.0, 0.0]), closed=False)
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    frame = np.stack([side, above, tangent], axis=1)
    assert frame @ frame.transpose(0, 2, 1) == pytest.approx(np.eye(3)[None].repeat(120, 0))
    # Double reflection has an error of fourth order in the step h of 0.08: h⁴ = 4e-5 a step. At the
    # ends, where the tangents are one-sided differences, it is of second order.
    turn = np.einsum("ij,ij->i", np.diff(above, axis=0), 0.5 * (side[1:] + side[:-1]))
    assert np.abs(turn).max() < 0.08**2
    assert np.abs(turn[2:-2]).max() < 0.08**4


def test_curves_pass_through_their_ends():
    knots = np.array([(0.0, 0.0), (1.0, 2.0), (3.0, 1.0), (4.0, 4.0)])
    for curve in (bezier(knots, 8), spline(knots, 8), rounded(knots, 0.2)):
        assert curve[[0, -1]] == pytest.approx(knots[[0, -1]], abs=1e-12)
    assert arc((1.0, 1.0), 2.0, 0.0, 90.0, 4)[[0, -1]] == pytest.approx(np.array([(3, 1), (1, 3)]))


def test_rounded_corners_are_circles_that_touch_both_edges():
    curve = rounded([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)], 0.25, 8)[1:-1]
    assert np.linalg.norm(curve - (0.75, 0.25), axis=1) == pytest.approx(0.25, abs=1e-12)
    assert curve[[0, -1]] == pytest.approx(np.array([(0.75, 0.0), (1.0, 0.25)]), abs=1e-12)


def test_rounded_corners_shrink_to_fit_short_edges():
    curve = rounded([(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.2, 0.1)], 5.0)
    assert np.isfinite(curve).all()
    assert curve.min() >= -1e-12 and curve.max() <= 0.2 + 1e-12


def test_vessels_have_a_wall_and_a_floor():
    side = spline([(0.5, 0), (0.9, 0.5), (1.0, 1.5)], 60)
    profile = vessel(side, wall=0.1, floor=0.15, foot=0.02)
    top = int(np.argmax(profile[:, 1]))
    assert profile[-1] == pytest.approx((0.0, 0.15))
    assert profile[0] == pytest.approx((0.0, 0.0))
    upper = profile[top:][profile[top:, 1] > 0.6]
    upper = upper[upper[:, 1] < 1.4]
    distance = cKDTree(profile[:top]).query(upper)[0]
    # The outside is sampled every 0.027, so the nearest sample can be √(0.1² + 0.0135²) away.
    assert distance.min() > 0.1 - 1e-3
    assert distance.max() < np.hypot(0.1, 0.014)


def test_teapot_has_newells_measures():
    parts = [solid(part(16)) for part in (body, handle, spout)]
    # Newell's quarter circle is widest at 45°: 0.71 = 1/8 + 3/8 + 3/8 · 0.56 along either axis.
    reach = np.linalg.norm(body(16).vertex[:, [0, 2]], axis=1).max()
    assert reach == pytest.approx(2.0 * 0.71 * np.sqrt(2.0), abs=1e-12)
    low, high = solid(teapot(16)).bounds
    # The corners of the patches lie on the surface.
    assert parts[0].bounds[:, 1] == pytest.approx((0.0, 3.15))
    assert parts[0].bounds[1, 0] == pytest.approx(2.0)
    assert low == pytest.approx((-3.0, 0.0, -2.0))
    # The spout's tip: the last control points pull a curve to x = 3.434 in Newell's data.
    assert high[0] == pytest.approx(3.434, abs=2e-3)


def test_teapot_agrees_with_the_published_mesh():
    published = trimesh.load_mesh(data_folder("meshes") / "utah_teapot.ply").vertices
    low, high = published.min(axis=0), published.max(axis=0)
    ours = teapot(64).vertex
    ours = (ours - 0.5 * (ours.min(axis=0) + ours.max(axis=0))) * (2.0 / np.ptp(ours[:, 0]))
    assert high - low == pytest.approx(np.ptp(ours, axis=0), abs=2e-4)
    # No patch is longer than 0.7 of these units: a cell's half diagonal is below 0.008.
    assert cKDTree(ours).query(published)[0].max() < 0.008
