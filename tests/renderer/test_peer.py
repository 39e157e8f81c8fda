"""Our images against Mitsuba 3's of the same meshes, map, camera and reflectance.

Both renderers are unbiased, so the means of independent runs may differ by their standard errors
alone. Compared are pixels that show surfaces only, none of them at a grazing angle: elsewhere they
differ where smooth normals turn a facet away from the eye, and in the masking term of GGX, which is
separable in Mitsuba and height-correlated here. Mitsuba interpolates its map, whose first and last
rows are the poles, so it is given one of eight times the resolution that reproduces constant
texels to 1e-4 or so.
"""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from renderer import scenes
from renderer.modelling import box, shade, sphere, square
from renderer.monte_carlo import SampleSplit, shade_distribution
from renderer.scene import Camera, Object, Scene
from renderer.scene.materials import Conductor, Lambert, Material
from renderer.view import View, make_view
from samplers.environment import EnvironmentMap
from samplers.inversion import MultipleImportance
from samplers.lighting import LightDistribution
from tests.benchmarks.mitsuba_peer import PeerSettings, description
from tests.renderer import lab

mi = pytest.importorskip("mitsuba", reason="the peer, mitsuba, is not installed: pip install it")
mi.set_variant("scalar_rgb")
mi.set_log_level(mi.LogLevel.Error)

WIDTH, HEIGHT = 96, 72
SUBPIXELS = 100
"""So many that their regular grid misses no glint of the sun on a rounded edge: of 36 it did."""
PEER_SAMPLES = 32
RUNS = 8
REGRID = 8
SYSTEMATIC = 2e-3
"""Left to the regular sub-pixels here against random ones there, and to the finer map."""
STEEP = 0.27
"""Least cosine between normal and eye. At α = 0.1 Smith's function Λ is 0.03 there, and the masking
terms (1 + 2 Λ)⁻¹ and (1 + Λ)⁻² of light that leaves as it arrives differ by Λ² = 1e-3 at most."""
LEAST_PIXELS = 48
"""Most of a case: a smaller object's mean is left to a few pixels' rare bright samples."""


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


def photographed(name: str) -> EnvironmentMap:
    """The map of that name at 128 × 64, the mean of 8 × 8 texels in each."""
    radiance = lab.photographed(name).radiance
    size = len(radiance) // 64
    return EnvironmentMap.from_array(
        radiance.reshape(64, size, 128, size, 3).mean(axis=(1, 3)), name
    )


def made_of(name: str, material: Material) -> Scene:
    """The built-in scene, with the same material everywhere."""
    scene = scenes.make(name)
    objects = tuple(Object(item.name, item.mesh, material) for item in scene.objects)
    return Scene(name, objects, scene.camera)


def lone(row: int, column: int) -> EnvironmentMap:
    radiance = np.zeros((32, 64, 3))
    radiance[row, column] = (100.0, 50.0, 25.0)
    return EnvironmentMap.from_array(radiance, "lone")


CLOUDY = cloudy()
CASES = [
    ("diffuse", CLOUDY),
    ("conductors", CLOUDY),
    ("diffuse", lone(6, 63)),  # on the seam, behind
    ("conductors", lone(1, 63)),  # on the seam, near the pole
]
MATERIALS = {"diffuse": Lambert((0.8, 0.6, 0.4)), "conductor": Conductor((1.0, 1.0, 1.0), 0.1)}
BUILT_IN = [("birdcage", "entrance_hall", "diffuse"), ("vase", "noon_grass", "conductor")]
"""What meshes and maps add to the cases above: each of them once."""


def regridded(environment: EnvironmentMap) -> NDArray[np.float32]:
    """(8H + 1, 8W): rows on the edges of eighths of texels, columns at their middles."""
    fine = environment.radiance.repeat(REGRID, axis=1)
    row = np.arange(REGRID * environment.height + 1)
    above = np.maximum(row - 1, 0) // REGRID
    below = np.minimum(row, row[-1] - 1) // REGRID
    return np.ascontiguousarray(0.5 * (fine[above] + fine[below]), np.float32)


def runs_of(render: Callable[[int], NDArray]) -> NDArray[np.float64]:
    """Images (runs, height, width) of independent runs, the mean of their channels."""
    return np.array([render(seed) for seed in range(RUNS)], np.float64).mean(axis=-1)


@cache
def view_of(scene: Scene) -> View:
    return make_view(scene, WIDTH, HEIGHT, SUBPIXELS)


@cache
def own_runs(view: View, environment: EnvironmentMap) -> NDArray[np.float64]:
    lighting = MultipleImportance().prepare(environment, 8, np.random.default_rng(0))
    assert isinstance(lighting, LightDistribution)

    def render(seed: int) -> NDArray:
        points, _ = shade_distribution(view, environment, lighting, seed, SampleSplit(1, 1))
        return view.to_image(points, None)

    return runs_of(render)


def peer_runs(scene: Scene, environment: EnvironmentMap) -> NDArray[np.float64]:
    settings = PeerSettings("scalar_rgb", WIDTH, HEIGHT, PEER_SAMPLES, 1)
    peer = mi.load_dict(description(mi, scene, regridded(environment), settings))
    return runs_of(lambda seed: np.array(mi.render(peer, seed=seed)))


def whole(view: View, shown: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Pixels (height, width) whose sub-pixels all see shown points, none at a grazing angle."""
    steep = (view.normal * view.toward_eye).sum(axis=1) > STEEP
    hits = np.bincount(view.pixel, shown & steep, WIDTH * HEIGHT)
    return (hits == SUBPIXELS).reshape(HEIGHT, WIDTH)


def inside_of(view: View, number: int) -> NDArray[np.bool_]:
    """Pixels that show one object only, as do their neighbours."""
    padded = np.pad(whole(view, view.material == number), 1)
    shifts = [(y, x) for y in range(3) for x in range(3)]
    return np.all([padded[y : y + HEIGHT, x : x + WIDTH] for y, x in shifts], axis=0)


def insides(view: View) -> dict[str, NDArray[np.bool_]]:
    """The pixels inside of each object that shows enough of them."""
    masks = {item.name: inside_of(view, i) for i, item in enumerate(view.scene.objects)}
    return {name: mask for name, mask in masks.items() if mask.sum() >= LEAST_PIXELS}


def scores(ours: NDArray, theirs: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Difference of means over runs, its variance, and the mean."""
    difference = ours.mean(axis=0) - theirs.mean(axis=0)
    variance = (ours.var(axis=0, ddof=1) + theirs.var(axis=0, ddof=1)) / RUNS
    return difference, variance, theirs.mean(axis=0)


def cases_of(runs: NDArray, mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Means (runs, cases) over the masked pixels of 8 × 8 cases at least half of which count."""
    size = (-1, HEIGHT // 8, 8, WIDTH // 8, 8)
    count = mask.reshape(size).sum(axis=(2, 4)).ravel()
    total = (runs * mask).reshape(size).sum(axis=(2, 4)).reshape(len(runs), -1)
    return total[:, count >= 32] / count[count >= 32]


def case_score(ours: NDArray, theirs: NDArray, masks: list[NDArray[np.bool_]]) -> float:
    """Root mean square of z over the masks' cases, in units of the largest that chance allows.

    With 8 + 8 runs z is Student's t of 14 degrees of freedom, whose square has the mean 14/12 and
    the variance 3.54. The root is allowed a quarter more than sqrt(14/12) = 1.08, for the heavy
    tails of rare bright samples, or three standard errors of the mean square where cases are few.
    """
    squares = []
    for mask in masks:
        difference, variance, mean = scores(cases_of(ours, mask), cases_of(theirs, mask))
        squares.append(difference**2 / (variance + (SYSTEMATIC * mean) ** 2 + 1e-30))
    z2 = np.concatenate(squares)
    assert len(z2) > 15
    allowed = max((1.25 * 1.08) ** 2, 14 / 12 + 3.0 * np.sqrt(3.54 / len(z2)))
    return float(np.sqrt(z2.mean() / allowed))


def assert_alike(scene: Scene, environment: EnvironmentMap, least_objects: int) -> None:
    """Means of the image, of each object and of the cases of both differ by their errors alone."""
    view = view_of(scene)
    ours, theirs = own_runs(view, environment), peer_runs(scene, environment)
    covered, objects = whole(view, view.material >= 0), insides(view)
    assert len(objects) >= least_objects, list(objects)
    assert theirs[:, covered].max() > 0.0
    for name, mask in {"image": covered, **objects}.items():
        difference, variance, mean = scores(ours[:, mask].mean(1), theirs[:, mask].mean(1))
        # The sun's glints on a small conductor's edges are rare; objects turned away may be dark.
        assert np.sqrt(variance) <= (1e-2 if name == "image" else 1e-1) * mean, name
        assert abs(difference) <= 1e-3 * mean + 4.0 * np.sqrt(variance), (name, difference, mean)
    assert case_score(ours, theirs, [covered]) <= 1.0
    assert case_score(ours, theirs, list(objects.values())) <= 1.0


@pytest.mark.parametrize(
    ("name", "environment"), CASES, ids=[f"{a}-{b.name}-{i}" for i, (a, b) in enumerate(CASES)]
)
def test_images_have_the_same_mean_by_object_and_by_case(
    name: str, environment: EnvironmentMap
) -> None:
    assert_alike(SCENES[name], environment, 4)


@pytest.mark.parametrize(("scene", "name", "material"), BUILT_IN)
def test_built_in_scenes_look_the_same_under_photographed_maps(
    scene: str, name: str, material: str
) -> None:
    assert_alike(made_of(scene, MATERIALS[material]), photographed(name), 2)


def test_a_map_turned_by_a_column_would_show() -> None:
    """The texel is near the pole: one column is 5.6° of azimuth, and 0.8° of its direction."""
    name, environment = CASES[-1]
    turned = EnvironmentMap.from_array(np.roll(environment.radiance, 1, axis=1))
    view = view_of(SCENES[name])
    ours, theirs = own_runs(view, environment), peer_runs(SCENES[name], turned)
    assert case_score(ours, theirs, [whole(view, view.material >= 0)]) > 1.5
