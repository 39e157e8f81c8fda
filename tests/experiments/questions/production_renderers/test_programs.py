"""Written scenes in the programs themselves: their means are this project's."""

import numpy as np
import pytest

from experiments.questions.production_renderers.shots import (
    Agreement,
    Contender,
    Converged,
    contenders,
    own_image,
)
from experiments.questions.production_renderers.written_scene import (
    Picture,
    Render,
    render_scene,
    require,
)
from renderer.modelling import box, shade, sphere, square
from renderer.scene import Camera, Object, Scene
from renderer.scene.materials import Lambert
from samplers import EnvironmentMap, EnvlightError, make_sampler

PICTURE = Picture(64, 48)
RUNS, SAMPLES, SUBPIXELS = 6, 64, 100
SYSTEMATIC = 1e-3
"""Left to the regular sub-pixels here against random ones there, and to Mitsuba's interpolation of
a map of 64 rows that has no lone bright texel."""


@pytest.fixture(scope="module")
def scene() -> Scene:
    parts = {
        "ground": (square(16.0), Lambert((0.5, 0.5, 0.5))),
        "ball": (sphere(1.0, 24).resting().moved(-1.2), Lambert((0.8, 0.6, 0.4))),
        "box": (box((1.5, 2.0, 1.0)).resting().moved(1.2), Lambert((0.7, 0.2, 0.1))),
    }
    objects = tuple(Object(name, shade(s, 40.0), m) for name, (s, m) in parts.items())
    return Scene("agreement", objects, Camera((1.0, 3.0, 7.0), (0.0, 0.7, 0.0), 32.0))


@pytest.fixture(scope="module")
def environment() -> EnvironmentMap:
    """Different in all directions and channels, with a bright window to one side."""
    rng = np.random.default_rng(7)
    radiance = rng.uniform(0.2, 1.0, (8, 16, 3)).repeat(8, axis=0).repeat(8, axis=1)
    radiance[14:22, 40:52] = (12.0, 10.0, 8.0)
    return EnvironmentMap.from_array(radiance, "window")


@pytest.fixture(scope="module")
def ours(scene, environment) -> Converged:
    table = make_sampler("mis")
    picture = Picture(PICTURE.width, PICTURE.height, SUBPIXELS)
    return Converged.of(
        [own_image(scene, environment, table, picture, seed)[1] for seed in range(RUNS)]
    )


@pytest.mark.parametrize("renderer", contenders(), ids=lambda one: one.label)
def test_means_are_those_of_this_renderer(scene, environment, ours, tmp_path, renderer: Contender):
    try:
        require(renderer.package, renderer.label)
    except EnvlightError as error:
        pytest.skip(str(error))
    renderer.write(scene, environment, PICTURE, tmp_path)
    plan = [Render(SAMPLES, k + 1, str(tmp_path / f"{k}.npy")) for k in range(RUNS)]
    render_scene(tmp_path, plan, renderer.label, 2, renderer.environment)
    theirs = Converged.of([np.load(tmp_path / f"{k}.npy") for k in range(RUNS)])
    found = Agreement.of(theirs, ours)
    assert abs(found.difference) < SYSTEMATIC + 4.0 * found.difference_error
    # A window one column aside (5.6°) moves blocks by ten times that.
    assert found.block_difference < 5e-3 + found.block_noise
    # Surfaces over black: where none is seen nothing is.
    assert not theirs.image[0, 0].any() and not ours.image[0, 0].any()
