"""Denoising: an extra, asked for by a lighting, that leaves the map behind the surfaces alone."""

import sys

import numpy as np
import pytest

from renderer.render import render
from renderer.view import make_view
from samplers.errors import EnvlightError
from samplers.registry import make_sampler
from tests.renderer import lab

BOTH = pytest.mark.parametrize(("name", "count"), [("mis-compensated", 2), ("restir", 1)])


@BOTH
def test_without_the_extra_a_sentence_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, name: str, count: int
) -> None:
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    view, environment = make_view(lab.ball_scene(), 8, 8, 1), lab.stormy_map(8)
    lighting = make_sampler(name, denoise=True).prepare(
        environment, count, np.random.default_rng(0)
    )
    with pytest.raises(EnvlightError, match=r"pyoidn .*; install envlight\[denoise\]"):
        render(view, lighting, environment)


@BOTH
def test_a_denoised_image_errs_less_and_keeps_the_map(name: str, count: int) -> None:
    pytest.importorskip("pyoidn", reason="the extra `denoise` is not installed")
    view, environment = make_view(lab.ball_scene(field=60.0), 96, 96, 1), lab.stormy_map(8)
    truth = lab.unoccluded(view, lab.finer(environment, 8))
    images = {}
    for denoise in (False, True):
        sampler = make_sampler(name, denoise=denoise)
        lighting = sampler.prepare(environment, count, np.random.default_rng(0))
        images[denoise] = render(view, lighting, environment).image
    exact = view.to_image(truth, None)
    seen = view.coverage > 0.0
    error = {d: np.sqrt(np.mean((image[seen] - exact[seen]) ** 2)) for d, image in images.items()}
    # A network promises nothing; it is meant to leave a fraction of so few samples' noise.
    assert error[True] < 0.7 * error[False]
    np.testing.assert_array_equal(images[True][~seen], images[False][~seen])
