"""Small scenes, and sums over every texel in float64 to hold their images against."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from renderer.modelling import Shape, box, shade, sphere, square
from renderer.scene import Camera, Mesh, Object, Scene
from renderer.scene.materials import Coated, Conductor, Lambert, Material, Ward
from renderer.view import View
from samplers.environment import EnvironmentMap
from samplers.lighting import DirectionalLights, SurfaceDistribution
from samplers.registry import make_sampler
from samplers.sphere import pixel_directions, row_solid_angle
from samplers.threads import set_thread_count, thread_count
from tests.renderer.packet import plain_brdf as brdf
from tests.samplers.maps import data_folder

WHITE = Lambert((1.0, 1.0, 1.0))
GREY = Lambert((0.6, 0.5, 0.4))
SURFACES = {
    "lambert": GREY,
    "coated": Coated((0.5, 0.3, 0.2), 0.15),
    "conductor": Conductor((0.9, 0.7, 0.5), 0.15),
    "ward": Ward((0.2, 0.2, 0.1), (0.4, 0.3, 0.2), 0.3, 0.15),
}
"""A material of every kind."""


def convex_ball(radius: float = 1.0, steps: int = 12) -> Shape:
    """The convex hull of a sphere's vertices: no facet can hide the light from another one."""
    shape = sphere(radius, steps)
    hull = ConvexHull(shape.vertex)
    a, b, c = hull.simplices.T
    corner = shape.vertex[hull.simplices]
    outward = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    inside_out = (outward * corner[:, 0]).sum(axis=1) < 0.0
    return Shape(
        shape.vertex, np.stack([a, np.where(inside_out, c, b), np.where(inside_out, b, c)], 1)
    )


def ball_scene(material: Material = GREY, steps: int = 12, field: float = 24.0) -> Scene:
    """A unit sphere alone, which fills the picture's middle: nothing can block its light."""
    camera = Camera((1.5, 2.5, 4.0), (0.0, 0.0, 0.0), field)
    ball = shade(convex_ball(1.0, steps), 180.0)
    return Scene("ball", (Object("ball", ball, material),), camera)


def plane_scene(material: Material = GREY, size: float = 64.0) -> Scene:
    """A square of ground alone, seen from above; it fills the picture."""
    camera = Camera((0.0, 6.0, 6.0), (0.0, 0.0, 0.0), 40.0)
    return Scene("plane", (Object("ground", shade(square(size)), material),), camera)


def box_scene(scale: float = 1.0, offset: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Scene:
    """A box and a thin wall on the ground, scaled about the origin and then moved.

    Its coordinates are multiples of 2⁻⁴, which float32 holds exactly after a move too."""

    def placed(shape: Shape) -> Shape:
        return shape.scaled(scale).moved(*offset)

    parts = {
        "ground": square(16.0),
        "box": box((1.0, 1.0, 1.0)).moved(-1.0, 0.5, 0.0),
        "wall": box((2.0, 1.0, 0.0625)).moved(1.0, 0.5, -1.0),
    }
    objects = tuple(Object(name, shade(placed(s)), GREY) for name, s in parts.items())
    eye, target = (np.array(p) * scale + offset for p in ((1.0, 4.0, 7.0), (0.0, 0.5, 0.0)))
    return Scene("boxes", objects, Camera(tuple(eye), tuple(target), 40.0))


def assert_normals_face_outwards(mesh: Mesh) -> None:
    """Unit, and on the outer side of every triangle that they belong to."""
    a, b, c = (mesh.vertex[mesh.triangle[:, i]].astype(np.float64) for i in range(3))
    # Float32 keeps 24 bits; three components and a square root lose two of them.
    assert np.abs(np.linalg.norm(mesh.normal.astype(np.float64), axis=1) - 1.0).max() < 2.0**-22
    face = np.cross(b - a, c - a)
    assert (np.einsum("tj,tij->ti", face, mesh.normal[mesh.triangle]) > 0.0).all()


def triangle_count(scene: Scene) -> int:
    return sum(len(item.mesh.triangle) for item in scene.objects)


def texel_lights(environment: EnvironmentMap) -> DirectionalLights:
    """A directional light for every texel."""
    solid_angle = row_solid_angle(environment.height, environment.width)
    irradiance = environment.radiance.astype(np.float64) * solid_angle[:, None, None]
    direction = pixel_directions(environment.height).reshape(-1, 3)
    return DirectionalLights(direction, irradiance.reshape(-1, 3), np.zeros(len(direction)))


def sun_lights(*directions: tuple[float, float, float]) -> DirectionalLights:
    """Lights of irradiance (1, 2, 3) from the given directions, of any length."""
    unit = np.array(directions, np.float64)
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    return DirectionalLights(unit, np.tile([1.0, 2.0, 3.0], (len(unit), 1)), np.zeros(len(unit)))


def finer(environment: EnvironmentMap, factor: int) -> EnvironmentMap:
    """The same piecewise constant radiance on factor × factor times as many texels."""
    radiance = environment.radiance.repeat(factor, axis=0).repeat(factor, axis=1)
    return EnvironmentMap(radiance, environment.name)


def stormy_map(height: int = 16, seed: int = 0, sun: float = 300.0) -> EnvironmentMap:
    """Noise of three decades with one bright texel above the horizon."""
    rng = np.random.default_rng(seed)
    radiance = 10.0 ** rng.uniform(-2.0, 1.0, (height, 2 * height, 3))
    radiance[height // 4, height // 3] = sun
    return EnvironmentMap.from_array(radiance, "storm")


@njit(nogil=True)
def _summed(materials, material, normal, geometric, toward_eye, direction, flux, out):
    for i in range(len(normal)):
        n, g, v = normal[i], geometric[i], toward_eye[i]
        row = materials[material[i]]
        for k in range(len(direction)):
            d = direction[k]
            cosine = brdf.dot(n, d)
            if cosine <= 0.0 or brdf.dot(g, d) <= 0.0:
                continue
            f = brdf.evaluate(row, n, v, d)
            for c in range(3):
                out[i, c] += f[c] * cosine * flux[k, c]


def unoccluded(view: View, environment: EnvironmentMap) -> NDArray[np.float64]:
    """Radiance (n, 3) of the view's points, if nothing hides a texel: a sum over all of them."""
    lights = texel_lights(environment)
    out = np.zeros((len(view), 3))
    surface = (a.astype(np.float64) for a in (view.normal, view.geometric, view.toward_eye))
    _summed(view.materials, view.material, *surface, lights.direction, lights.irradiance, out)
    return out


def photographed(name: str) -> EnvironmentMap:
    """A map of the data folder; skips where there is none."""
    return EnvironmentMap.from_file(data_folder("environments") / f"{name}.exr")


def one_and_four_threads(call: Callable[[], NDArray]) -> tuple[NDArray, NDArray]:
    """What `call` returns on one thread and on four."""
    before = thread_count()
    try:
        results = []
        for threads in (1, 4):
            set_thread_count(threads)
            results.append(call())
    finally:
        set_thread_count(before)
    return results[0], results[1]


def prepared(
    name: str, environment: EnvironmentMap, count: int, **parameters: Any
) -> SurfaceDistribution:
    lighting = make_sampler(name, **parameters).prepare(
        environment, count, np.random.default_rng(0)
    )
    assert isinstance(lighting, SurfaceDistribution)
    return lighting


def spoiled(array: NDArray, value: float) -> NDArray:
    """The same but for the very last number."""
    array = array.copy()
    array.flat[-1] = value
    return array
