"""Parameters typed as name=value become what a sampler takes, or a sentence."""

import pytest

from experiments.run.parameters import parse_parameters
from samplers import EnvlightError, make_sampler


def test_values_are_literals_or_text():
    texts = ["a=1", "b=-2.5", "c=rounds", "d=True", "e=false", "f=None", "g=solid angle", "h=x=y"]
    assert parse_parameters(texts) == {
        "a": 1, "b": -2.5, "c": "rounds", "d": True, "e": False, "f": None, "g": "solid angle",
        "h": "x=y",
    }  # fmt: skip


@pytest.mark.parametrize("text", ["", "order", "=3", "2x=3", "a b=3", "a-b=1"])
def test_what_is_no_parameter_is_named(text):
    with pytest.raises(EnvlightError, match="write it as name=value"):
        parse_parameters([text])


def test_a_name_is_given_once():
    with pytest.raises(EnvlightError, match="'a': it is given twice"):
        parse_parameters(["a=1", "a=2"])


@pytest.mark.parametrize("value", ["1e999999", "9" * 5000, "(" * 3000, "[" * 300 + "]" * 300])
def test_monstrous_values_end_in_a_sentence(value):
    with pytest.raises(EnvlightError, match="aspect"):
        make_sampler("median-cut", **parse_parameters([f"aspect={value}"]))
