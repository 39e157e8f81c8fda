"""The Monte Carlo estimator has the right mean, whatever the technique, the map and the material.

Estimates of independent seeds are compared with float64 sums over all texels of the map, each cut
into so many parts that the midpoint rule's error is far below the standard error. With R seeds and
a true mean, (mean of seeds − truth)/standard error follows Student's distribution of R − 1 degrees
of freedom; Šidák's correction covers the number of cases.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import t as student

from experiments.maps import places as embedded
from renderer.modelling import shade, square
from renderer.monte_carlo import SampleSplit, shade_distribution
from renderer.scene import Camera, Object, Scene
from renderer.scene.materials import Coated, Lambert
from renderer.view import View, make_view
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.grids.tabulated import TabulatedDistribution
from samplers.inversion import CompensatedImportance, MultipleImportance
from samplers.lighting import LightDistribution
from tests.renderer import lab
from tests.renderer.lab import SURFACES, spoiled

SEEDS = 24
LIGHT_ONLY, BRDF_ONLY, BOTH = SampleSplit(16, 0), SampleSplit(0, 16), SampleSplit(8, 8)
MANY = SampleSplit(256, 256)
REAL_MAPS = ("noon_grass", "dikhololo_night", "entrance_hall", "quarry_02")


def distribution_of(environment: EnvironmentMap, count: int = 16) -> LightDistribution:
    lighting = MultipleImportance().prepare(environment, count, np.random.default_rng(0))
    assert isinstance(lighting, LightDistribution)
    return lighting


def estimates(
    view: View, environment: EnvironmentMap, split: SampleSplit, seeds: int = SEEDS
) -> NDArray[np.float64]:
    """The points' radiance (seeds, n, 3)."""
    lighting = distribution_of(environment)
    runs = [shade_distribution(view, environment, lighting, s, split)[0] for s in range(seeds)]
    return np.array(runs, np.float64)


def assert_mean(
    runs: NDArray[np.float64], truth: NDArray[np.float64], tests: int, precision: float
) -> None:
    """Both halves of the points and all of them have the right mean, over `tests` such cases.

    Means of many points are close to normal where those of one point are not.

    precision : largest relative standard error at which the test still says something"""
    seeds = len(runs)
    limit = student.isf(0.5 * (1.0 - 0.99 ** (1.0 / (3.0 * tests))), seeds - 1)
    half = truth.shape[0] // 2
    for part in (slice(None), slice(0, half), slice(half, None)):
        means, expected = runs[:, part].mean(axis=(1, 2)), truth[part].mean()
        error = means.std(ddof=1) / math.sqrt(seeds)
        assert error < precision * expected
        # 2e-5 of the expectation is left to the midpoint rule and to float32.
        assert abs(means.mean() - expected) < limit * error + 2e-5 * expected


@pytest.fixture(scope="module")
def ball() -> View:
    return make_view(lab.ball_scene(), 7, 7, 1)


def test_a_furnace_shows_the_albedo() -> None:
    """BRDF samples alone, which all weigh the same, exactly; the full estimator to 1e-3."""
    albedo = (1.0, 0.5, 0.25)
    flat = make_view(lab.plane_scene(Lambert(albedo)), 16, 16, 1)
    white = EnvironmentMap.from_array(np.ones((64, 128, 3)))
    exact, _ = shade_distribution(flat, white, distribution_of(white), 1, BRDF_ONLY)
    # A cosine against a float32 normal and direction, over one in float64: 2⁻²⁴ over cos θ on
    # average over samples of density cos θ/π.
    np.testing.assert_allclose(exact, np.tile(albedo, (len(flat), 1)), rtol=2e-6)
    both = estimates(flat, white, SampleSplit(256, 256), 8)
    np.testing.assert_allclose(both.mean(axis=(0, 1)), albedo, rtol=1e-3)


@pytest.mark.parametrize("name", [*embedded.names()[::6], *REAL_MAPS])
def test_the_mean_is_the_sum_over_texels(ball: View, name: str) -> None:
    own = name in embedded.names()
    environment = embedded.make(name, 32) if own else lab.photographed(name)
    truth = lab.unoccluded(ball, lab.finer(environment, max(1, 256 // environment.height)))
    assert_mean(estimates(ball, environment, MANY), truth, 10, 2e-3)


@pytest.mark.parametrize("surface", SURFACES)
def test_every_technique_has_the_same_mean(surface: str) -> None:
    view = make_view(lab.ball_scene(SURFACES[surface]), 8, 8, 1)
    environment = lab.stormy_map(8, sun=60.0)
    # Lobes of α = 0.15 over texels of 0.39/32 = 0.012: (0.012/0.15)²/24 = 3e-4 of a lobe's width,
    # and an eighth of that on average over all texels it covers.
    truth = lab.unoccluded(view, lab.finer(environment, 32))
    for split in (SampleSplit(256, 0), SampleSplit(0, 256), MANY, SampleSplit(200, 56)):
        assert_mean(estimates(view, environment, split), truth, 16, 1.5e-2)


def test_combining_is_never_much_worse_than_the_better_technique() -> None:
    """Veach and Guibas bound the balance heuristic; the power heuristic is near it in practice."""
    for surface in ("lambert", "conductor"):
        view = make_view(lab.ball_scene(SURFACES[surface]), 8, 8, 1)
        environment = lab.stormy_map(8)
        spread = {
            split: estimates(view, environment, split, 16).var(axis=0, ddof=1).mean()
            for split in (LIGHT_ONLY, BRDF_ONLY, BOTH)
        }
        # Half of the samples would double the better one's variance, weights add a little to that.
        assert spread[BOTH] < 2.5 * min(spread[LIGHT_ONLY], spread[BRDF_ONLY])


def test_compensation_leaves_the_mean_alone(ball: View) -> None:
    environment = lab.stormy_map(8, sun=60.0)
    truth = lab.unoccluded(ball, lab.finer(environment, 32))
    lighting = CompensatedImportance().prepare(environment, 256, np.random.default_rng(0))
    runs = [shade_distribution(ball, environment, lighting, s)[0] for s in range(SEEDS)]
    assert_mean(np.array(runs, np.float64), truth, 1, 5e-3)


def test_later_estimates_continue_the_sequence(ball: View) -> None:
    environment = lab.stormy_map(8)
    lighting = distribution_of(environment)
    whole, _ = shade_distribution(ball, environment, lighting, 5, SampleSplit(8, 8))
    halves = [
        shade_distribution(ball, environment, lighting, 5, SampleSplit(4, 4), before=before)[0]
        for before in (SampleSplit(0, 0), SampleSplit(4, 4))
    ]
    # The same samples, whose weights depend on the ratio of the techniques alone.
    np.testing.assert_allclose(np.mean(halves, axis=0), whole, rtol=1e-6)


class Given:
    """A distribution that the renderer knows nothing more of than its protocol."""

    def __init__(self, table: LightDistribution) -> None:
        self.count, self.sample, self.pdf = table.count, table.sample, table.pdf


SPOILED: dict[str, Callable[[Given], dict[str, Any]]] = {
    "a direction of length 3; 1 is wanted": lambda g: {
        "sample": lambda u: (3.0 * g.sample(u)[0], g.sample(u)[1])
    },
    "a direction of length nan": lambda g: {
        "sample": lambda u: (spoiled(g.sample(u)[0], np.nan), g.sample(u)[1])
    },
    "a density that is negative": lambda g: {
        "sample": lambda u: (g.sample(u)[0], spoiled(g.sample(u)[1], -0.1))
    },
    "a density that is .* not finite": lambda g: {
        "sample": lambda u: (g.sample(u)[0], spoiled(g.sample(u)[1], np.inf))
    },
    r"directions of shape \(\d+,\); \(\d+, 3\) is wanted": lambda g: {
        "sample": lambda u: (g.sample(u)[0][:, 0], g.sample(u)[1])
    },
    r"densities of shape \(1,\); \(\d+,\) is wanted": lambda g: {
        "sample": lambda u: (g.sample(u)[0], g.sample(u)[1][:1])
    },
    "density that is negative": lambda g: {"pdf": lambda d: spoiled(g.pdf(d), -1.0)},
    "density .* not finite; 0 or more is wanted": lambda g: {
        "pdf": lambda d: spoiled(g.pdf(d), np.nan)
    },
    r"densities of shape \(\d+, 1\)": lambda g: {"pdf": lambda d: g.pdf(d)[:, None]},
}


@pytest.mark.parametrize("sentence", SPOILED)
def test_samples_that_are_none_are_refused(ball: View, sentence: str) -> None:
    environment = lab.stormy_map(8)
    given = Given(distribution_of(environment))
    shade_distribution(ball, environment, given, 0)
    for name, method in SPOILED[sentence](Given(distribution_of(environment))).items():
        setattr(given, name, method)
    with pytest.raises(EnvlightError, match=f"lighting Given: it gave .*{sentence}"):
        shade_distribution(ball, environment, given, 0)


@pytest.mark.parametrize("split", [BOTH, LIGHT_ONLY, BRDF_ONLY, SampleSplit(5, 2)])
def test_samples_drawn_in_place_are_those_of_the_table_itself(split: SampleSplit) -> None:
    """Bit for bit: the same texels, directions and densities, read in another order."""
    view = make_view(lab.box_scene(), 40, 30, 4)
    environment = lab.stormy_map(32)
    for table in (
        distribution_of(environment),
        CompensatedImportance().prepare(environment, 16, np.random.default_rng(0)),
    ):
        assert isinstance(table, TabulatedDistribution)
        here, rays = shade_distribution(view, environment, table, 3, split)
        given, more = shade_distribution(view, environment, Given(table), 3, split)
        np.testing.assert_array_equal(here, given)
        assert rays == more and rays.traced > 0


class Foreign:
    """A tabulated light of another program's making, whose samples nobody is to ask for."""

    def __init__(self, of: TabulatedDistribution) -> None:
        self.count, self.weight, self.offset, self.table = of.count, of.weight, of.offset, of.table

    def sample(self, u: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        raise AssertionError("it is drawn from in place")

    def pdf(self, direction: NDArray[np.float32]) -> NDArray[np.float32]:
        raise AssertionError("it is drawn from in place")


@pytest.mark.parametrize("power", [1.0, 0.5])
def test_a_table_is_drawn_from_in_place_whoever_made_it(power: float) -> None:
    """By luminance as well as by weights of another kind, and with the bits of its samples."""
    view = make_view(lab.box_scene(), 40, 30, 4)
    environment = lab.stormy_map(32)
    weight = environment.luminance if power == 1.0 else environment.luminance ** np.float32(power)
    table = TabulatedDistribution.of_weight(weight, 16, offset=0.25 * float(weight.mean()))
    given, rays = shade_distribution(view, environment, Given(table), 3)
    theirs, same = shade_distribution(view, environment, Foreign(table), 3)
    np.testing.assert_array_equal(theirs, given)
    assert same == rays and rays.traced > 0


def test_a_table_of_another_size_is_asked_for_its_samples() -> None:
    view, environment = make_view(lab.ball_scene(), 7, 7, 1), lab.stormy_map(8)
    table = TabulatedDistribution.of_weight(lab.stormy_map(16).luminance, 16)
    with pytest.raises(AssertionError, match="in place"):
        shade_distribution(view, environment, Foreign(table), 0)


def test_a_table_of_another_map_keeps_its_own_densities() -> None:
    """The mean stays right where the table is not of the map that sends the light."""
    view = make_view(lab.ball_scene(), 7, 7, 1)
    environment = lab.stormy_map(8, sun=60.0)
    other = distribution_of(EnvironmentMap.from_array(np.sqrt(environment.radiance)))
    truth = lab.unoccluded(view, lab.finer(environment, 32))
    runs = [shade_distribution(view, environment, other, s, MANY)[0] for s in range(SEEDS)]
    assert_mean(np.array(runs, np.float64), truth, 1, 1e-2)


def test_spans_choose_points_and_change_nothing_else(ball: View) -> None:
    environment = lab.stormy_map(8)
    lighting = distribution_of(environment)
    whole, all_rays = shade_distribution(ball, environment, lighting, 5)
    spans = np.array([[3, 10], [20, 21]])
    part, rays = shade_distribution(ball, environment, lighting, 5, spans=spans)
    chosen = np.zeros(len(ball), bool)
    chosen[3:10] = chosen[20:21] = True
    np.testing.assert_array_equal(part[chosen], whole[chosen])
    assert not part[~chosen].any()
    assert rays.traced + rays.skipped == 16 * 8
    assert all_rays.traced + all_rays.skipped == 16 * len(ball)


def test_a_black_map_traces_no_ray(ball: View) -> None:
    black = EnvironmentMap.from_array(np.zeros((8, 16, 3)))
    out, rays = shade_distribution(ball, black, distribution_of(black), 0)
    assert not out.any() and rays.traced == 0 and rays.skipped == 16 * len(ball)


def test_samples_that_face_away_change_no_bit() -> None:
    """From a flat ground the lower half of a map is not seen: light there costs no ray either."""
    flat = Scene(
        "flat",
        (Object("ground", shade(square(16.0)), Coated((0.5, 0.3, 0.2), 0.2)),),
        Camera((0.0, 2.0, 6.0), (0.0, 0.0, 0.0), 30.0),
    )
    view, environment = make_view(flat, 40, 30, 1), lab.stormy_map(16)
    sky = environment.radiance.copy()
    sky[8:] = 0.0
    lighting = distribution_of(lab.stormy_map(8))  # of neither map, and so drawn alike for both
    image, rays = shade_distribution(view, environment, lighting, 3)
    alone, of_sky = shade_distribution(view, EnvironmentMap.from_array(sky), lighting, 3)
    np.testing.assert_array_equal(alone, image)
    assert of_sky == rays and rays.skipped > len(view) and image.any()
