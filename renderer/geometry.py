"""All triangles of a scene in one mesh and in Embree's hierarchy, made once and kept with them."""

import threading
import weakref
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from renderer.packet.embree import EmbreeScene
from renderer.scene import Mesh, Scene


@dataclass(frozen=True, eq=False)
class Geometry:
    """A scene's triangles as one mesh.

    vertex, normal : (n, 3) float32; triangle : (m, 3) int32; owner : (m,) int32, each triangle's
    object
    """

    vertex: NDArray[np.float32]
    normal: NDArray[np.float32]
    triangle: NDArray[np.int32]
    owner: NDArray[np.int32]
    embree: EmbreeScene = field(repr=False)

    @classmethod
    def of(cls, meshes: list[Mesh]) -> "Geometry":
        first = np.cumsum([0] + [len(mesh.vertex) for mesh in meshes[:-1]])
        vertex = np.concatenate([mesh.vertex for mesh in meshes])
        triangle = np.concatenate([m.triangle + k for m, k in zip(meshes, first, strict=True)])
        triangle = triangle.astype(np.int32)
        owner = np.repeat(np.arange(len(meshes), dtype=np.int32), [len(m.triangle) for m in meshes])
        normal = np.concatenate([mesh.normal for mesh in meshes])
        return cls(vertex, normal, triangle, owner, EmbreeScene(vertex, triangle))


_kept: weakref.WeakKeyDictionary[Mesh, tuple[list[weakref.ref[Mesh]], Geometry]] = (
    weakref.WeakKeyDictionary()
)
_lock = threading.Lock()


def geometry_of(scene: Scene) -> Geometry:
    """The scene's geometry; the last one made of the same meshes is kept as long as they live."""
    meshes = [item.mesh for item in scene.objects]
    with _lock:
        if meshes[0] in _kept:
            members, geometry = _kept[meshes[0]]
            if [member() for member in members] == meshes:
                return geometry
        geometry = Geometry.of(meshes)
        _kept[meshes[0]] = ([weakref.ref(mesh) for mesh in meshes], geometry)
        return geometry
