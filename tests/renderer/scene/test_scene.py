"""Meshes, cameras, materials and scenes refuse what cannot be rendered, and say so."""

from dataclasses import replace

import numpy as np
import pytest

from renderer.modelling import box, shade
from renderer.scene import Camera, Mesh, Object, Scene
from renderer.scene.materials import Coated, Conductor, Lambert, Ward
from samplers.errors import EnvlightError

GRAY = (0.5, 0.5, 0.5)
CAMERA = Camera((0.0, 1.0, 5.0), (0.0, 0.0, 0.0))
CUBE = Object("cube", shade(box((1.0, 1.0, 1.0))), Lambert(GRAY))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"eye": (0.0, float("nan"), 5.0)}, "eye"),
        ({"target": (0.0, 0.0)}, "target"),
        ({"target": (0.0, 1.0, 5.0)}, "same point"),
        ({"field_of_view": 0.0}, "field of view"),
        ({"field_of_view": 180.0}, "field of view"),
        ({"field_of_view": float("nan")}, "field of view"),
        ({"up": (0.0, 0.0, 0.0)}, "up"),
        ({"up": (0.0, -2.0, -10.0)}, "up"),
    ],
)
def test_cameras_without_a_picture_are_refused(change, message):
    with pytest.raises(EnvlightError, match=message):
        replace(CAMERA, **change)


def test_scenes_need_objects_with_names_of_their_own():
    with pytest.raises(EnvlightError, match="no objects"):
        Scene("empty", (), CAMERA)
    with pytest.raises(EnvlightError, match="two objects are called 'cube'"):
        Scene("twins", (CUBE, CUBE), CAMERA)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("vertex", np.full((3, 3), np.nan), "NaN"),
        ("normal", np.full((3, 3), np.inf), "NaN"),
        ("vertex", np.zeros((3, 2)), "shape"),
        ("normal", np.zeros((2, 3)), "normals"),
        ("triangle", np.zeros((0, 3)), "no triangles"),
        ("triangle", np.array([[0, 1, 3]]), "does not exist"),
        ("triangle", np.array([[0, 1, -1]]), "does not exist"),
    ],
)
def test_broken_meshes_are_refused(field, value, message):
    parts = {"vertex": np.eye(3), "normal": np.eye(3), "triangle": np.array([[0, 1, 2]])}
    with pytest.raises(EnvlightError, match=message):
        Mesh(**(parts | {field: value}))


def test_the_digest_follows_all_that_the_picture_depends_on():
    scene = Scene("one", (CUBE,), CAMERA)
    moved = Object("cube", shade(box((1.0, 1.0, 1.0)).moved(1e-3)), Lambert(GRAY))
    others = [
        replace(scene, camera=replace(CAMERA, field_of_view=41.0)),
        replace(scene, objects=(replace(CUBE, material=Lambert((0.5, 0.5, 0.6))),)),
        replace(scene, objects=(moved,)),
        replace(scene, objects=(replace(CUBE, mesh=shade(box((1.0, 1.0, 1.0)), 180.0)),)),
    ]
    assert len({scene.digest, *(other.digest for other in others)}) == 5
    assert replace(scene, name="another").digest == scene.digest


@pytest.mark.parametrize(
    "make",
    [
        lambda: Lambert((0.5, 0.5, 1.1)),
        lambda: Lambert((0.5, float("nan"), 0.5)),
        lambda: Lambert((-0.1, 0.5, 0.5)),
        lambda: Lambert((0.5, 0.5)),  # type: ignore[arg-type]
        lambda: Lambert(0.5),  # type: ignore[arg-type]
        lambda: Lambert("red"),  # type: ignore[arg-type]
        lambda: Coated(GRAY, -0.1),
        lambda: Coated(GRAY, float("nan")),
        lambda: Coated(GRAY, "smooth"),  # type: ignore[arg-type]
        lambda: Coated(GRAY, 0.1, 0.9),
        lambda: Coated(GRAY, 0.1, float("inf")),
        lambda: Conductor(GRAY, 1.5),
        lambda: Ward(GRAY, GRAY, 0.1, True),
        lambda: Ward((0.6, 0.5, 0.5), GRAY, 0.1, 0.1),
    ],
)
def test_impossible_values_are_refused(make):
    with pytest.raises(EnvlightError, match="material"):
        make()


def test_equal_materials_have_equal_texts():
    # A scene's digest is made from the text.
    assert repr(Conductor([1, np.float64(0.5), 0], 1)) == repr(Conductor((1.0, 0.5, 0.0), 1.0))  # type: ignore[arg-type]
