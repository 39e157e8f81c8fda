"""Lights and a residual map in Mitsuba 3: directional lights, and an `envmap` of what they leave.

Compared twice: with our rendering of the same lights and residual, from which it may differ by the
errors of both alone; and with our reference of the whole map, from which both differ by what a few
directions in place of a sun of several texels cost.
"""

import numpy as np
import pytest

mi = pytest.importorskip("mitsuba", reason="the peer, mitsuba, is not installed: pip install it")

from experiments.export.residual import part  # noqa: E402
from experiments.questions.renderer_throughput.mitsuba_peer import (  # noqa: E402
    PeerSettings,
    description,
)
from renderer.direct import shade_directional  # noqa: E402
from renderer.view import make_view  # noqa: E402
from samplers import DirectionalLights, EnvironmentMap, make_sampler  # noqa: E402
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

SAMPLES = 64


def evening() -> EnvironmentMap:
    """A sky of many colours and a low sun of 2 × 3 texels, 5.6° each, that gives half the light."""
    rng = np.random.default_rng(11)
    radiance = 0.2 + rng.uniform(0.0, 0.6, (32, 64, 3)) ** 2
    radiance[9:11, 18:21] = (380.0, 300.0, 210.0)
    return EnvironmentMap.from_array(radiance, "evening")


def peer_runs(scene, lights: DirectionalLights, residual: EnvironmentMap):
    settings = PeerSettings("scalar_rgb", WIDTH, HEIGHT, SAMPLES, 1, emitter_samples=4)
    content = description(mi, scene, regridded(residual), settings)
    for k, (direction, irradiance) in enumerate(
        zip(lights.direction, lights.irradiance, strict=True)
    ):
        content[f"light_{k}"] = {
            "type": "directional", "direction": (-direction).tolist(),
            "irradiance": {"type": "rgb", "value": irradiance.tolist()},
        }  # fmt: skip
    peer = mi.load_dict(content)
    return runs_of(lambda seed: np.array(mi.render(peer, seed=seed)))


def rms(image, reference, covered) -> float:
    """RMSE over the covered pixels, in units of the reference's mean."""
    off = (image - reference)[covered]
    return float(np.sqrt((off**2).mean()) / reference[covered].mean())


def test_mitsuba_shows_lights_and_residual_as_our_reference_shows_the_map() -> None:
    scene, environment = SCENES["diffuse"], evening()
    parted = part(make_sampler("ours"), environment, 16, np.random.default_rng(0))
    lights = parted.lights
    assert isinstance(lights, DirectionalLights)
    assert 0.3 < parted.carried.sum() / parted.whole.sum() < 0.7
    view = make_view(scene, WIDTH, HEIGHT, SUBPIXELS)
    covered = whole(view, view.material >= 0)
    points, _ = shade_directional(view, lights.direction[None], lights.irradiance)
    lit = view.to_image(points, None).mean(axis=-1)
    ours = own_runs(view, parted.residual) + lit
    theirs = peer_runs(scene, lights, parted.residual)
    assert case_score(ours, theirs, [covered]) <= 1.0

    reference = own_runs(view, environment)
    truth, image, same = reference.mean(0), theirs.mean(0), ours.mean(0)
    noise = [
        float(np.sqrt((runs[:, covered].var(0, ddof=1) / len(runs)).mean()) / truth[covered].mean())
        for runs in (reference, theirs)
    ]
    error, own = rms(image, truth, covered), rms(same, truth, covered)
    print(
        f"relative RMSE against the reference: Mitsuba {error:.4f}, ours {own:.4f}; noise {noise}"
    )
    # Both show the same lights: what Mitsuba adds is its own noise.
    assert error <= own + 3.0 * np.hypot(*noise)
    # Only penumbrae differ: the mean is the map's but for cosines within the sun's few degrees.
    assert image[covered].mean() == pytest.approx(truth[covered].mean(), rel=0.02)
    # The sun once more on top of the whole map is what the residual is there against.
    assert rms(truth + lit, truth, covered) > 5.0 * error
