"""Scales, and the noise that their references are to have."""

import pytest

from experiments.run.scale import SCALES, find_scale
from samplers import EnvlightError


def test_less_noise_takes_as_many_more_samples():
    """Noise falls with the root of the samples; more noise than a scale's takes no fewer."""
    scale = find_scale("quick")
    finer = scale.with_noise(scale.noise_target / 5.0)
    assert finer.noise_target == scale.noise_target / 5.0
    assert finer.max_samples == 25 * scale.max_samples
    assert scale.with_noise(2.0 * scale.noise_target).max_samples == scale.max_samples


def test_scales_grow():
    sizes = [scale.width * scale.height for scale in SCALES.values()]
    assert sizes == sorted(sizes)
    with pytest.raises(EnvlightError, match="quick, medium, standard, paper"):
        find_scale("large")
