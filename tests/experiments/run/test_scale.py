"""Scales, and the noise that their references are to have."""

import pytest

from experiments.run.scale import SCALES, find_scale, of_scale, references_to, without_interleaving
from samplers import EnvlightError
from samplers.lighting import SETS


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


def test_sets_are_the_renderers_unless_an_experiment_wants_one_for_all_pixels():
    assert {scale.sets for scale in SCALES.values()} == {SETS}
    plain = without_interleaving(references_to({"quick": 0.001}))(find_scale("medium"))
    assert plain.sets == 1 and plain.noise_target == 0.001


def test_a_table_without_a_scale_gives_the_next_smaller_one():
    table = {"quick": 1, "standard": 2}
    found = [of_scale(table, name) for name in SCALES]
    assert found == [1, 1, 2, 2]
    with pytest.raises(EnvlightError, match="no scale is called"):
        of_scale(table, "large")
