"""Our images against Mitsuba 3's of the same meshes, map, camera and reflectance.

Both renderers are unbiased, so the means of independent runs may differ by their standard errors
alone. Both are given flat facets, since they differ where smooth normals turn a facet away from the
eye or the light, and conductors of constant reflectance and α ≤ 0.2, where the separable
masking term of Mitsuba and the height-correlated one here are alike. Mitsuba interpolates its map,
whose first and last rows are the poles, so it is given one of eight times the resolution that
reproduces constant texels to 1e-4 or so.
"""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from renderer.materials import Conductor, Lambert, Material
from renderer.modelling import box, shade, sphere, square
from renderer.monte_carlo import SampleSplit, shade_distribution
from renderer.scene import Camera, Mesh, Object, Scene
from renderer.view import View, make_view
from samplers.environment import EnvironmentMap
from samplers.lighting import LightDistribution
from samplers.multiple_importance import MultipleImportance

mi = pytest.importorskip("mitsuba", reason="the peer, mitsuba, is not installed: pip install it")
mi.set_variant("scalar_rgb")
mi.set_log_level(mi.LogLevel.Error)

WIDTH, HEIGHT, SUBPIXELS = 64, 48, 16
RUNS = 8
REGRID = 8
SYSTEMATIC = 2e-3
"""Left to the regular sub-pixels here against random ones there, and to the finer map."""


def scene_of(left: Material, right: Material) -> Scene:
    parts = {
        "ground": (square(16.0), Lambert((0.5, 0.5, 0.5))),
        "left": (sphere(1.0, 24).resting().moved(-1.2), left),
        "right": (sphere(1.0, 24).resting().moved(1.2), right),
        "box": (box((3.0, 3.0, 0.5)).resting().moved(0.0, 0.0, -2.0), Lambert((0.7, 0.2, 0.1))),
    }
    objects = tuple(Object(name, shade(s, 0.0), m) for name, (s, m) in parts.items())
    return Scene("peer", objects, Camera((1.0, 3.0, 7.0), (0.0, 0.7, 0.0), 32.0))


SCENES = {
    "diffuse": scene_of(Lambert((0.8, 0.6, 0.4)), Lambert((0.2, 0.4, 0.9))),
    "conductors": scene_of(Conductor((1.0, 1.0, 1.0), 0.2), Conductor((1.0, 1.0, 1.0), 0.1)),
}


def cloudy() -> EnvironmentMap:
    """Noise and a sun that are different in all directions and channels."""
    rng = np.random.default_rng(7)
    radiance = rng.uniform(0.0, 1.0, (32, 64, 3)) ** 3
    radiance[8, 50] = (60.0, 50.0, 40.0)
    return EnvironmentMap.from_array(radiance, "cloudy")


def lone(row: int, column: int) -> EnvironmentMap:
    radiance = np.zeros((32, 64, 3))
    radiance[row, column] = (100.0, 50.0, 25.0)
    return EnvironmentMap.from_array(radiance, "lone")


CASES = [
    ("diffuse", cloudy()),
    ("conductors", cloudy()),
    ("diffuse", lone(9, 20)),  # to the right and behind
    ("diffuse", lone(6, 63)),  # on the seam, behind
]


def regridded(environment: EnvironmentMap) -> NDArray[np.float32]:
    """(8H + 1, 8W): rows on the edges of eighths of texels, columns at their middles."""
    fine = environment.radiance.repeat(REGRID, axis=1)
    row = np.arange(REGRID * environment.height + 1)
    above = np.maximum(row - 1, 0) // REGRID
    below = np.minimum(row, row[-1] - 1) // REGRID
    return np.ascontiguousarray(0.5 * (fine[above] + fine[below]), np.float32)


def write_ply(path: Path, mesh: Mesh) -> None:
    """Vertices with normals, and triangles, in text."""
    head = ["ply", "format ascii 1.0", f"element vertex {len(mesh.vertex)}"]
    head += [f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")]
    head += [f"element face {len(mesh.triangle)}", "property list uchar int vertex_indices"]
    with path.open("w") as file:
        file.write("\n".join([*head, "end_header"]) + "\n")
        np.savetxt(file, np.hstack([mesh.vertex, mesh.normal]), "%.9g")
        np.savetxt(file, np.hstack([np.full((len(mesh.triangle), 1), 3), mesh.triangle]), "%d")


def peer_bsdf(material: Material) -> dict[str, Any]:
    match material:
        case Lambert(albedo):
            return {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(albedo)}}
        case Conductor(_, roughness):
            return {
                "type": "roughconductor", "distribution": "ggx", "alpha": roughness,
                "material": "none", "specular_reflectance": {"type": "rgb", "value": 1.0},
            }  # fmt: skip
    raise TypeError(material)


def peer_scene(scene: Scene, environment: EnvironmentMap, folder: Path) -> Any:
    camera = scene.camera
    look = mi.ScalarTransform4f().look_at(
        origin=list(camera.eye), target=list(camera.target), up=list(camera.up)
    )
    description: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "direct", "emitter_samples": 2, "bsdf_samples": 2},
        "map": {"type": "envmap", "bitmap": mi.Bitmap(regridded(environment))},
        "sensor": {
            "type": "perspective", "fov": camera.field_of_view, "fov_axis": "y", "to_world": look,
            "film": {
                "type": "hdrfilm", "width": WIDTH, "height": HEIGHT, "rfilter": {"type": "box"},
                "pixel_format": "rgb", "component_format": "float32",
            },
            "sampler": {"type": "independent"},
        },
    }  # fmt: skip
    for item in scene.objects:
        path = folder / f"{item.name}.ply"
        write_ply(path, item.mesh)
        bsdf = peer_bsdf(item.material)
        description[item.name] = {"type": "ply", "filename": str(path), "bsdf": bsdf}
    return mi.load_dict(description)


def runs_of(render: Callable[[int], NDArray]) -> NDArray[np.float64]:
    return np.array([render(seed) for seed in range(RUNS)], np.float64).mean(axis=-1)


def own_runs(view: View, environment: EnvironmentMap) -> NDArray[np.float64]:
    lighting = MultipleImportance().prepare(environment, 8, np.random.default_rng(0))
    assert isinstance(lighting, LightDistribution)

    def render(seed: int) -> NDArray:
        points, _ = shade_distribution(view, environment, lighting, seed, SampleSplit(4, 4))
        return view.to_image(points, None)

    return runs_of(render)


def inside_of(view: View, number: int) -> NDArray[np.bool_]:
    """Pixels that show one object only, as do their neighbours."""
    hits = np.bincount(view.pixel, view.material == number, WIDTH * HEIGHT)
    whole = np.pad((hits == SUBPIXELS).reshape(HEIGHT, WIDTH), 1)
    shifts = [(y, x) for y in range(3) for x in range(3)]
    return np.all([whole[y : y + HEIGHT, x : x + WIDTH] for y, x in shifts], axis=0)


def scores(ours: NDArray, theirs: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Difference of means over runs, its variance, and the mean."""
    difference = ours.mean(axis=0) - theirs.mean(axis=0)
    variance = (ours.var(axis=0, ddof=1) + theirs.var(axis=0, ddof=1)) / RUNS
    return difference, variance, theirs.mean(axis=0)


def blocks_of(runs: NDArray, mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Means (runs, blocks) over the masked pixels of 8 × 8 blocks at least half of which count."""
    size = (-1, HEIGHT // 8, 8, WIDTH // 8, 8)
    count = mask.reshape(size).sum(axis=(2, 4)).ravel()
    total = (runs * mask).reshape(size).sum(axis=(2, 4)).reshape(len(runs), -1)
    return total[:, count >= 32] / count[count >= 32]


@pytest.mark.parametrize(
    ("name", "environment"), CASES, ids=[f"{a}-{b.name}-{i}" for i, (a, b) in enumerate(CASES)]
)
def test_images_have_the_same_mean_by_object_and_by_block(
    tmp_path: Path, lab: SimpleNamespace, name: str, environment: EnvironmentMap
) -> None:
    scene = SCENES[name]
    view = make_view(scene, WIDTH, HEIGHT, SUBPIXELS)
    peer = peer_scene(scene, environment, tmp_path)
    ours = own_runs(view, environment)
    theirs = runs_of(lambda seed: np.array(mi.render(peer, seed=seed, spp=64)))
    masks = [inside_of(view, number) for number in range(len(scene.objects))]
    assert all(mask.sum() > 100 for mask in masks)
    for mask in masks:
        difference, variance, mean = scores(ours[:, mask].mean(1), theirs[:, mask].mean(1))
        assert np.sqrt(variance) <= 1e-2 * mean  # both exactly dark, where the sun is behind
        assert abs(difference) <= 1e-3 * mean + 4.0 * np.sqrt(variance), (difference, mean)
    everything = np.any(masks, axis=0)
    assert theirs[:, everything].max() > 0.0
    difference, variance, mean = scores(blocks_of(ours, everything), blocks_of(theirs, everything))
    # With 8 + 8 runs z is Student's t of 14 degrees of freedom: its root mean square is 1.08.
    z = difference / np.sqrt(variance + (SYSTEMATIC * mean) ** 2 + 1e-30)
    assert len(z) > 15
    assert np.sqrt((z**2).mean()) < 1.25 * 1.08


def test_a_turned_map_would_show(tmp_path: Path, lab: SimpleNamespace) -> None:
    """The comparison notices one column of the map, 5.6°, and a mirror."""
    scene, environment = SCENES["diffuse"], cloudy()
    view = make_view(scene, WIDTH, HEIGHT, SUBPIXELS)
    mask = np.any([inside_of(view, number) for number in range(4)], axis=0)
    ours = blocks_of(own_runs(view, environment), mask)
    for changed in (np.roll(environment.radiance, 1, axis=1), environment.radiance[:, ::-1]):
        peer = peer_scene(scene, EnvironmentMap.from_array(changed), tmp_path)
        theirs = blocks_of(
            runs_of(lambda seed, peer=peer: np.array(mi.render(peer, seed=seed, spp=32))), mask
        )
        difference, variance, mean = scores(ours, theirs)
        z = difference / np.sqrt(variance + (SYSTEMATIC * mean) ** 2)
        assert np.sqrt((z**2).mean()) > 1.5 * 1.25 * 1.08
