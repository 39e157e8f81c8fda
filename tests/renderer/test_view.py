"""A view's points lie where its camera looks, just above the surface, in the order of its tiles."""

import numpy as np
import pytest
from numpy.typing import NDArray

from renderer.modelling import Shape, shade, sphere
from renderer.primary import camera_axes
from renderer.scene import Camera, Mesh, Object, Scene
from renderer.view import CELLS, CELLS_X, CELLS_Y, TILE, View, make_view, pattern_cell
from samplers.errors import EnvlightError
from tests.renderer import lab


def seen_at(view: View, aspect: float) -> NDArray[np.float64]:
    """Where the camera sees the view's points, (n, 2) in [0, 1]², from the upper left corner."""
    camera = view.scene.camera
    right, up, forward = camera_axes(camera)
    away = view.position - np.array(camera.eye)
    half = np.tan(np.radians(camera.field_of_view) / 2.0)
    depth = away @ forward
    x, y = away @ right / (depth * half * aspect), away @ up / (depth * half)
    return np.stack([0.5 + 0.5 * x, 0.5 - 0.5 * y], axis=1)


def grid_point(view: View) -> NDArray[np.float64]:
    """The centres of the points' sub-pixels, (n, 2) in [0, 1]²."""
    side = round(view.subpixels**0.5)
    y, x = np.divmod(view.pixel, view.width)
    sub_y, sub_x = np.divmod(view.subpixel, side)
    return np.stack(
        [(x + (sub_x + 0.5) / side) / view.width, (y + (sub_y + 0.5) / side) / view.height], axis=1
    )


@pytest.mark.parametrize("size", [(32, 20), (37, 19)])
@pytest.mark.parametrize("subpixels", [1, 4, 9])
def test_points_project_back_to_their_subpixels(size: tuple[int, int], subpixels: int) -> None:
    view = make_view(lab.plane_scene(), *size, subpixels)
    assert len(view) == size[0] * size[1] * subpixels  # the plane fills the picture
    # Rays are float32, 6e-8; points are lifted by 2⁻¹⁶ of the plane's 64, 1e-3, seen from 5 away
    # under an angle of 25° or more, and the picture is 2 · 8 · tan 20° = 6 wide there.
    np.testing.assert_allclose(seen_at(view, size[0] / size[1]), grid_point(view), atol=1e-3)
    np.testing.assert_allclose(view.normal, np.tile([0.0, 1.0, 0.0], (len(view), 1)), atol=1e-7)
    eye = np.array(view.scene.camera.eye)
    np.testing.assert_allclose(
        view.position + view.toward_eye * view.depth[:, None], np.tile(eye, (len(view), 1)),
        atol=1e-3 + 1e-5,
    )  # fmt: skip


@pytest.mark.parametrize("factor", [2, 4])
def test_a_reduced_view_shows_the_same_picture_whatever_the_size(factor: int) -> None:
    view = make_view(lab.plane_scene(), 53, 29, 4)
    small = view.reduced(factor)
    assert small is view.reduced(factor)
    assert (small.width, small.height) == (-(-53 // factor), -(-29 // factor))
    np.testing.assert_allclose(seen_at(small, 53 / 29), grid_point(small), atol=1e-3)


def test_points_stand_above_their_triangle_by_rounding_errors_only() -> None:
    view = make_view(lab.ball_scene(steps=24), 64, 64, 1)
    # Distance to the plane of a facet: facets are tangent to within their sagitta.
    inside = 1.0 - np.einsum("ij,ij->i", view.position.astype(float), view.geometric)
    step = np.radians(90.0 / 24)
    sagitta = 1.0 - np.cos(0.75 * step)  # half of the largest triangle's diagonal
    assert inside.max() < 2.0 * sagitta
    assert (np.linalg.norm(view.position, axis=1) < 1.0 + 4e-6).all()
    for vectors in (view.normal, view.geometric, view.toward_eye):
        np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1.0, atol=2e-7)
    # Smooth normals of a sphere point along the radius, to the order of a facet's angle squared.
    radial = view.position / np.linalg.norm(view.position, axis=1, keepdims=True)
    assert np.linalg.norm(np.cross(radial, view.normal), axis=1).max() < step**2


def test_normals_face_the_eye_even_on_sheets_seen_from_behind() -> None:
    shape = Shape(np.array([[-9.0, -9, 0], [9, -9, 0], [0, 9, 0]]), np.array([[0, 1, 2]]))
    camera = Camera((0.0, 0.0, -5.0), (0.0, 0.0, 0.0))
    view = make_view(Scene("sheet", (Object("a", shade(shape), lab.GREY),), camera), 8, 8, 1)
    np.testing.assert_allclose(view.normal[:, 2], -1.0)
    assert (view.position[:, 2] < 0.0).all()
    rim = make_view(lab.ball_scene(field=34.0), 96, 96, 1)  # smooth normals turn away at the rim
    facing = np.einsum("ij,ij->i", rim.normal.astype(float), rim.toward_eye)
    assert (facing > 0.0).all()
    assert (np.einsum("ij,ij->i", rim.geometric.astype(float), rim.toward_eye) > 0.0).all()
    assert (np.einsum("ij,ij->i", rim.geometric.astype(float), rim.normal) >= 0.0).all()


def test_points_are_ordered_by_tile_and_cell() -> None:
    view = make_view(lab.ball_scene(field=50.0), 45, 37, 4)
    y, x = np.divmod(view.pixel, view.width)
    tile = (y // TILE) * -(-view.width // TILE) + x // TILE
    cell = (y % CELLS_Y * CELLS_X + x % CELLS_X + 2 * view.subpixel) % CELLS
    assert view.group[0] == view.tile[0] == 0
    assert view.group[-1] == view.tile[-1] == len(view)
    for first, last, number in zip(view.group, view.group[1:], view.group_cell, strict=False):
        assert last > first and (cell[first:last] == number).all()
        assert (tile[first:last] == tile[first]).all()
    runs = [tile[a:b] for a, b in zip(view.tile, view.tile[1:], strict=False)]
    assert all((run == run[0]).all() for run in runs)
    assert len({run[0] for run in runs}) == len(runs)


@pytest.mark.parametrize("subpixels", [1, 4, 9, 16])
def test_neighbours_share_the_cells_of_the_pattern_out(subpixels: int) -> None:
    """Each pixel meets as many cells as it can, and 4 × 2 pixels meet each one equally often."""
    cells = np.array(
        [[pattern_cell(x, y, s, subpixels) for s in range(subpixels)]
         for y in range(CELLS_Y) for x in range(CELLS_X)]
    )  # fmt: skip
    assert all(len(set(pixel)) == min(subpixels, CELLS) for pixel in cells)
    np.testing.assert_array_equal(np.bincount(cells.ravel(), minlength=CELLS), subpixels)


def test_surface_and_background_share_the_picture_out() -> None:
    view = make_view(lab.ball_scene(steps=48, field=40.0), 120, 120, 4)
    samples = np.bincount(view.pixel, minlength=14400) + np.bincount(
        view.background_pixel, minlength=14400
    )
    assert (samples == 4).all()
    ones = view.to_image(np.ones((len(view), 3)), np.ones((len(view.background_pixel), 3)))
    np.testing.assert_array_equal(ones, np.ones((120, 120, 3)))
    np.testing.assert_array_equal(
        view.to_image(np.ones((len(view), 3)), None)[..., 0], view.coverage
    )
    # The silhouette: a disc of angular radius asin(1/d) seen through a pinhole.
    d = np.linalg.norm(view.scene.camera.eye)
    radius = 1.0 / np.sqrt(d * d - 1.0) / np.tan(np.radians(20.0))
    # Gauss's circle problem: the area of a disc of radius r in cells of h errs by h √(h r) or so;
    # the polygon's rim lies up to its sagitta, 1 − cos 1.9°/2, inside.
    share = np.pi * radius**2 / 4.0
    assert share * (1.0 - 2.0 * 1.4e-4) - 1e-3 < view.coverage.mean() < share + 1e-3


def test_missing_vertex_normals_fall_back_to_the_triangle() -> None:
    mesh = shade(sphere(1.0, 8))
    bare = Mesh(mesh.vertex, np.zeros_like(mesh.normal), mesh.triangle)
    camera = Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0))
    view = make_view(Scene("bare", (Object("ball", bare, lab.GREY),), camera), 16, 16, 1)
    np.testing.assert_array_equal(view.normal, view.geometric)


def test_an_empty_picture_is_all_background() -> None:
    scene = lab.ball_scene()
    away = Scene("away", scene.objects, Camera((9.0, 0.0, 0.0), (19.0, 0.0, 0.0)))
    view = make_view(away, 5, 3, 4)
    assert len(view) == 0 and len(view.background_pixel) == 60
    assert not view.coverage.any()


def test_bad_sizes_are_refused() -> None:
    for arguments in ((0, 5, 4), (5, 0, 4), (5, 5, 3), (5, 5, 0)):
        with pytest.raises(EnvlightError, match="view"):
            make_view(lab.ball_scene(), *arguments)
