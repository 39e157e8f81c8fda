"""A scene's triangles are put into Embree once for all of its views, and let go with its meshes."""

import gc
import weakref
from dataclasses import replace

from renderer.geometry import geometry_of
from tests.renderer import lab


def test_scenes_of_the_same_meshes_share_their_geometry() -> None:
    scene = lab.box_scene()
    moved = replace(scene, camera=replace(scene.camera, eye=(9.0, 9.0, 9.0)))
    assert geometry_of(scene) is geometry_of(moved) is geometry_of(scene)


def test_other_meshes_get_a_geometry_of_their_own() -> None:
    scene = lab.box_scene()
    assert len(scene.objects) > 1
    fewer = replace(scene, objects=scene.objects[:1])
    assert len(geometry_of(fewer).triangle) == len(scene.objects[0].mesh.triangle)
    assert len(geometry_of(scene).triangle) == lab.triangle_count(scene)


def test_geometry_goes_with_its_meshes() -> None:
    scene = lab.box_scene()
    kept = weakref.ref(geometry_of(scene))
    del scene
    gc.collect()
    assert kept() is None
