"""Pictures of a model whose law is known."""

from dataclasses import replace

import numpy as np
from matplotlib.colors import to_rgb

from experiments.questions.advice.plots import winners
from experiments.report.style import looks


def grounds(model, styles):
    """By title of the panel, the colours of its ground; none where it has no ground."""
    axes = winners(model, "rmse", styles).axes
    return {
        one.get_title(): [np.unique(image.get_array().reshape(-1, 3), axis=0)
                          for image in one.get_images()] for one in axes
    }  # fmt: skip


def holds(colors, styles, sampler):
    ground = 0.25 * np.array(to_rgb(styles[sampler].color)) + 0.75
    return bool(np.isclose(colors, ground, atol=1e-6).all(axis=1).any())


def test_who_cannot_make_so_few_lights_wins_nowhere(model):
    """Median cut, which wins somewhere at 4 lights, as if it needed 8."""
    styles = looks(list(model.samplers))
    assert holds(grounds(model, styles)["4 lights"][0], styles, "median-cut")
    needs = dict(zip(model.samplers, model.least, strict=True)) | {"median-cut": 8}
    found = grounds(replace(model, least=tuple(needs.values())), styles)
    assert not holds(found["4 lights"][0], styles, "median-cut")
    assert holds(found["8 lights"][0], styles, "median-cut")


def test_a_panel_without_a_sampler_stays_empty(model):
    found = grounds(replace(model, least=(8,) * len(model.samplers)), looks(list(model.samplers)))
    assert found["4 lights"] == [] and len(found["8 lights"]) == 1
