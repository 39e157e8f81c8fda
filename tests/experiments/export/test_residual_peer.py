"""Lights and a residual map in Mitsuba 3: directional lights, and an `envmap` of what they leave.

Compared twice: with our rendering of the same lights and residual, from which it may differ by the
errors of both alone; and with our reference of the whole map, from which both differ by what a few
directions in place of a sun of several texels cost.
"""

import numpy as np
import pytest

mi = pytest.importorskip("mitsuba", reason="the peer, mitsuba, is not installed: pip install it")

from experiments.export.light_set import part  # noqa: E402
from renderer.direct import shade_directional  # noqa: E402
from renderer.view import make_view  # noqa: E402
from samplers import DirectionalLights, EnvironmentMap, make_sampler  # noqa: E402
from tests.benchmarks.mitsuba_peer import PeerSettings, description  # noqa: E402
from tests.renderer.test_peer import (  # noqa: E402
    HEIGHT,
    SCENES,
    SUBPIXELS,
    WIDTH,
    case_score,
    own_runs,
    regridded,
    runs_of,
    whole,
)

SAMPLES = 24
"""Of a pixel. With several samples of emitters at each, Mitsuba 3.9 counts directional lights as
often."""


def evening() -> EnvironmentMap:
    """A sky of many colours, and a low sun and a lamp of a texel each that give half the light."""
    rng = np.random.default_rng(11)
    radiance = 0.2 + rng.uniform(0.0, 0.6, (32, 64, 3)) ** 2
    radiance[9, 18] = (420.0, 360.0, 260.0)
    radiance[5, 50] = (120.0, 150.0, 180.0)
    return EnvironmentMap.from_array(radiance, "evening")


def peer_scene(scene, lights: DirectionalLights, residual: EnvironmentMap, size, samples: int):
    """The scene under directional lights and a map, for Mitsuba's `load_dict`."""
    settings = PeerSettings("scalar_rgb", *size, samples, 1)
    content = description(mi, scene, regridded(residual), settings)
    for k, (direction, irradiance) in enumerate(
        zip(lights.direction, lights.irradiance, strict=True)
    ):
        content[f"light_{k}"] = {
            "type": "directional", "direction": (-direction).tolist(),
            "irradiance": {"type": "rgb", "value": irradiance.tolist()},
        }  # fmt: skip
    return content


def peer_runs(scene, lights: DirectionalLights, residual: EnvironmentMap):
    peer = mi.load_dict(peer_scene(scene, lights, residual, (WIDTH, HEIGHT), SAMPLES))
    return runs_of(lambda seed: np.array(mi.render(peer, seed=seed)))


def squared(image, reference) -> float:
    """Mean square error over pixels, in units of the reference's mean squared."""
    return float(((image - reference) ** 2).mean() / reference.mean() ** 2)


def noise_of(runs, mean: float) -> float:
    """The part of such an error that the noise of the runs' mean makes."""
    return float((runs.var(axis=0, ddof=1) / len(runs)).mean() / mean**2)


def test_mitsuba_shows_lights_and_residual_as_our_reference_shows_the_map() -> None:
    scene, environment = SCENES["diffuse"], evening()
    parted = part(make_sampler("ours"), environment, 16, np.random.default_rng(0))
    lights = parted.lights
    assert isinstance(lights, DirectionalLights)
    assert len(lights) > 1 and 0.4 < parted.carried.sum() / parted.whole.sum() < 0.7
    view = make_view(scene, WIDTH, HEIGHT, SUBPIXELS)
    covered = whole(view, view.material >= 0)
    points, _ = shade_directional(view, lights.direction[None], lights.irradiance)
    lit = view.to_image(points, None).mean(axis=-1)
    ours = own_runs(view, parted.residual) + lit
    theirs = peer_runs(scene, lights, parted.residual)
    assert case_score(ours, theirs, [covered]) <= 1.0

    seen = [runs[:, covered] for runs in (own_runs(view, environment), theirs, ours)]
    truth, image, same = (runs.mean(axis=0) for runs in seen)
    noise = [noise_of(runs, truth.mean()) for runs in seen]
    error = squared(image, truth) - noise[0] - noise[1]
    own = squared(same, truth) - noise[0] - noise[2]
    print(f"relative RMSE without noise: Mitsuba {max(error, 0.0) ** 0.5:.4f}, ours {own**0.5:.4f}")
    # Squares of n pixels' noise sum up to their mean within √(2/n) of it, a few times that here,
    # where noise differs from pixel to pixel.
    slack = 10.0 * np.sqrt(2.0 / len(truth)) * sum(noise)
    assert abs(error - own) <= slack
    # Only penumbrae of lights of a texel differ, 5.6° wide, in a few pixels: 3 % of the mean.
    assert own <= 0.03**2 and error <= 0.03**2 + slack
    # Means over the image differ by what cosines do within a texel, and by the noise.
    assert image.mean() == pytest.approx(truth.mean(), rel=0.01)
    # The lights once more on top of the whole map are what the residual is there against.
    assert squared(truth + lit[covered], truth) > 100.0 * own
