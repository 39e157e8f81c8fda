"""Distributions that see the surface: the mean is the sum over texels, whoever draws."""

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import t as student

from renderer.monte_carlo import shade_distribution
from renderer.render import render
from renderer.scene.materials import Lambert
from renderer.surface import shade_surface
from renderer.view import View, make_view
from samplers.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from samplers.errors import EnvlightError
from samplers.lighting import Surface, SurfaceDistribution, SurfaceSamples
from samplers.registry import make_sampler
from tests.renderer import lab
from tests.renderer.lab import SURFACES, prepared, spoiled

SEEDS = 16
README = Path(__file__).parents[2] / "samplers" / "README.md"


def means(view: View, environment: EnvironmentMap, lighting: SurfaceDistribution) -> NDArray:
    """Mean radiance of the view's points by each seed."""
    runs = [shade_surface(view, environment, lighting, seed)[0] for seed in range(SEEDS)]
    return np.array([run.mean(dtype=np.float64) for run in runs])


def assert_mean(
    found: NDArray, truth: float, tests: int, precision: float, systematic: float = 2e-5
) -> None:
    """The seeds' means scatter around the truth, at a risk of 1 % in all `tests` together.

    systematic : share of the truth that is left to the sum's midpoint rule and to float32"""
    error = found.std(ddof=1) / math.sqrt(len(found))
    limit = student.isf(0.5 * (1.0 - 0.99 ** (1.0 / tests)), len(found) - 1)
    assert error < precision * truth
    assert abs(found.mean() - truth) < limit * error + systematic * truth


@pytest.mark.parametrize(("count", "candidates"), [(1, 2), (4, 8), (16, 3)])
@pytest.mark.parametrize("surface", SURFACES)
@pytest.mark.parametrize(
    ("name", "given"), [("ris", {}), ("ris-stratified", {}), ("ris-stratified", {"shared": False})]
)
def test_resampling_has_the_mean_of_the_sum_over_texels(
    name: str, given: dict, surface: str, count: int, candidates: int
) -> None:
    view = make_view(lab.ball_scene(SURFACES[surface]), 24, 24, 4)
    environment = lab.stormy_map(8, sun=60.0)
    truth = lab.unoccluded(view, lab.finer(environment, 8)).mean()
    lighting = prepared(name, environment, count, candidates=candidates, **given)
    # Texels of 0.39/8 against lobes of 0.15: (0.05/0.15)²/24 of a lobe's width at most, which its
    # own two sides cancel to a tenth.
    assert_mean(means(view, environment, lighting), truth, 36, 2e-2, 5e-4)


def test_resampling_sees_the_same_shadows_as_multiple_importance() -> None:
    view = make_view(lab.box_scene(), 40, 30, 4)
    environment = lab.stormy_map(8)
    found = means(view, environment, prepared("ris-stratified", environment, 8))
    mis = make_sampler("mis").prepare(environment, 512, np.random.default_rng(0))
    runs = [shade_distribution(view, environment, mis, seed)[0] for seed in range(4)]  # type: ignore[arg-type]
    other = np.array([run.mean(dtype=np.float64) for run in runs])
    error = math.sqrt(found.var(ddof=1) / len(found) + other.var(ddof=1) / len(other))
    # Student's t with 3 degrees of freedom, the fewest of the two, exceeds 12.9 once in a thousand.
    assert error < 2e-3 * other.mean()
    assert abs(found.mean() - other.mean()) < 12.9 * error


def test_more_candidates_make_less_noise_at_the_same_rays() -> None:
    """In the open, where a target is all the luminance that a sample carries."""
    view = make_view(lab.ball_scene(SURFACES["coated"]), 24, 24, 1)
    environment = lab.stormy_map(8)
    truth = lab.unoccluded(view, lab.finer(environment, 8))
    noise = {}
    for candidates in (2, 32):
        lighting = prepared("ris-stratified", environment, 4, candidates=candidates)
        out, rays = shade_surface(view, environment, lighting, 0)
        assert rays.traced + rays.skipped == 4 * len(view) and rays.brdf == 0
        noise[candidates] = np.sqrt(np.mean(((out - truth) @ LUMINANCE_WEIGHTS) ** 2))
    # Independent candidates would give √(32/2) = 4 times less; half of that is asked for.
    assert noise[32] < 0.5 * noise[2]


def test_the_example_for_plug_ins_works_as_printed(tmp_path: Path) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    file = tmp_path / "hemisphere.py"
    file.write_text(code, encoding="utf-8")
    environment = lab.stormy_map(8, sun=30.0)
    view = make_view(lab.ball_scene(), 16, 16, 4)
    lighting = prepared(f"{file}:Hemisphere", environment, 64)
    truth = lab.unoccluded(view, lab.finer(environment, 16)).mean()
    assert_mean(means(view, environment, lighting), truth, 1, 1e-2)
    assert render(view, lighting, environment).rays.shadow > 0


@dataclass(frozen=True)
class Fixed:
    """Returns what it is told to."""

    samples: Any
    count: int = 1
    draws: tuple[int, ...] = (1,)

    def sample_at(self, surface: Surface, u: list[NDArray[np.float32]]) -> SurfaceSamples:
        assert u[0].shape == (1, len(surface.normal), 3)
        made: SurfaceSamples = self.samples(surface)
        return made


def up(surface: Surface) -> NDArray[np.float32]:
    return np.tile(np.float32([0.0, 1.0, 0.0]), (1, len(surface.normal), 1))


def ones(surface: Surface) -> NDArray[np.float64]:
    return np.ones((1, len(surface.normal)))


REFUSED = {
    "16 samples at a point; 1 to 1, its count, is wanted": lambda s: SurfaceSamples(
        np.repeat(up(s), 16, axis=0), np.repeat(ones(s), 16, axis=0)
    ),
    "0 samples at a point": lambda s: SurfaceSamples(up(s)[:0], ones(s)[:0]),
    r"directions of shape \(1, 16\)": lambda s: SurfaceSamples(up(s)[..., 0], ones(s)),
    r"weights of shape \(16,\); \(1, 16\) is wanted": lambda s: SurfaceSamples(up(s), ones(s)[0]),
    r"radiances of shape \(16, 3\)": lambda s: SurfaceSamples(up(s), ones(s), up(s)[0]),
    "a weight that is negative": lambda s: SurfaceSamples(up(s), spoiled(ones(s), -1.0)),
    "a weight that is .* not finite": lambda s: SurfaceSamples(up(s), spoiled(ones(s), np.nan)),
    "a radiance of -1; 0 or more": lambda s: SurfaceSamples(up(s), ones(s), spoiled(up(s), -1.0)),
    "a radiance of nan": lambda s: SurfaceSamples(up(s), ones(s), spoiled(up(s), np.nan)),
    "length 2; 1 is wanted": lambda s: SurfaceSamples(2.0 * up(s), ones(s)),
    "length 1.00002; 1 is wanted": lambda s: SurfaceSamples(up(s) * np.float32(1.00002), ones(s)),
    "length nan; 1 is wanted": lambda s: SurfaceSamples(spoiled(up(s), np.nan), 0.0 * ones(s)),
}


@pytest.mark.parametrize("sentence", REFUSED)
def test_samples_that_are_none_are_refused(sentence: str) -> None:
    view = make_view(lab.plane_scene(), 4, 4, 1)
    with pytest.raises(EnvlightError, match=f"lighting Fixed: it gave .*{sentence}"):
        shade_surface(view, lab.stormy_map(4), Fixed(REFUSED[sentence]), 0)


def test_directions_rounded_to_float32_and_those_that_are_not_drawn_pass() -> None:
    def samples(surface: Surface) -> SurfaceSamples:
        direction = np.random.default_rng(0).normal(size=(2, len(surface.normal), 3))
        direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
        weight = np.ones((2, len(surface.normal)))
        direction[1], weight[1] = 0.0, 0.0
        return SurfaceSamples(direction.astype(np.float32), weight)

    view = make_view(lab.plane_scene(), 4, 4, 1)
    out, rays = shade_surface(view, lab.stormy_map(4), Fixed(samples, count=2), 0)
    assert out.any() and 0 < rays.traced <= 16


def test_samples_may_bring_their_own_light_and_go_without_rays() -> None:
    """A light straight above, of radiance (1, 2, 3) and weight π, on a plane and on boxes."""

    def samples(surface: Surface) -> SurfaceSamples:
        light = np.tile(np.float32([1.0, 2.0, 3.0]), (1, len(surface.normal), 1))
        weight = np.full((1, len(surface.normal)), math.pi)
        return SurfaceSamples(up(surface), weight, light, shadowed=False)

    view = make_view(lab.box_scene(), 20, 15, 1)
    out, rays = shade_surface(view, lab.stormy_map(4), Fixed(samples), 0)
    cosine = np.maximum(view.normal[:, 1:2].astype(float), 0.0)
    # float32 roundings of the cosine, the reflectance and the result.
    np.testing.assert_allclose(
        out, cosine * lab.GREY.albedo * np.array([1.0, 2.0, 3.0]), rtol=4e-7, atol=1e-7
    )
    assert rays.traced == rays.skipped == 0


def test_a_filtered_white_map_shows_the_albedo_without_rays() -> None:
    view = make_view(lab.plane_scene(Lambert((1.0, 0.5, 0.25))), 8, 8, 1)
    white = EnvironmentMap.from_array(np.ones((16, 32, 3)))
    lighting = prepared("filtered-importance-sampling", white, 4)
    result = render(view, lighting, white)
    # Each BRDF sample weighs the albedo; cosines and densities round to 2⁻²⁴ of steep cosines.
    np.testing.assert_allclose(result.image, np.tile([1.0, 0.5, 0.25], (8, 8, 1)), rtol=1e-5)
    assert result.rays.traced == 0
