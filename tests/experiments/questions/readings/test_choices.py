"""Every parameter of every sampler is among the readings, or there is a reason why not."""

from dataclasses import dataclass, fields
from typing import Literal, get_args, get_origin, get_type_hints

import pytest

from experiments.questions.readings import grid
from experiments.questions.readings.grid import (
    READ_AS,
    READINGS,
    RULED_OUT,
    choices_in_words,
    costly,
    costly_samplers,
    defaults_in_words,
    equal_costs,
    measured_samplers,
    same_as,
)
from experiments.run.scale import find_scale
from samplers import LightSampler, make_sampler, sampler_class, sampler_names
from samplers.base import REGISTERED, Reading
from samplers.lighting import LIGHT_EXTENT, LightExtent

PARAMETERS = [
    (sampler, field.name) for sampler in sampler_names() for field in fields(sampler_class(sampler))
]


def values_of(sampler: str, name: str) -> set:
    """The values that the readings give to a parameter."""
    return {
        value
        for reading in READINGS
        if reading.sampler == sampler
        for key, value in reading.parameters
        if key == name
    }


@pytest.mark.parametrize(("sampler", "name"), PARAMETERS, ids=lambda word: word)
def test_every_parameter_is_a_reading_or_has_a_reason(sampler, name):
    of = same_as(sampler)
    listed = values_of(of, name)
    settled = dict(sampler_class(of).settled)
    if name in settled:
        assert not listed and settled[name]
        return
    default = getattr(make_sampler(of), name)
    kind = get_type_hints(sampler_class(of))[name]
    if get_origin(kind) is Literal:
        assert listed == set(get_args(kind)), "every value has to be read"
    elif kind is bool:
        assert listed == {True, False}
    else:
        assert listed - {default}, "a value other than the default has to be read"


def test_nothing_is_listed_that_no_sampler_has():
    for sampler in sampler_names():
        kind = sampler_class(sampler)
        named = {name for name, _ in kind.settled} | set(kind.costly)
        named |= {name for one in kind.readings for name in one.parameters}
        assert {(sampler, name) for name in named} <= set(PARAMETERS)
    for reading in READINGS:
        assert {(reading.sampler, name) for name, _ in reading.parameters} <= set(PARAMETERS)
        assert reading.spec.sampler.name == reading.sampler


def test_a_variant_has_its_parents_parameters_and_no_readings_of_its_own():
    variants = [name for name in sampler_names() if same_as(name) != name]
    assert variants == ["ours-no-upsampling"]
    for name in variants:
        assert [f.name for f in fields(sampler_class(name))] == [
            f.name for f in fields(sampler_class(same_as(name)))
        ]
        assert not any(reading.sampler == name for reading in READINGS)


def test_a_sampler_tells_its_choices_in_its_own_file(monkeypatch):
    """With a sampler more in the tree, its readings are found, and a parameter without is told."""

    @dataclass(frozen=True)
    class Mine(LightSampler):
        turns: int = 1
        light_extent: LightExtent = LIGHT_EXTENT
        readings = (
            Reading("one turn", {"turns": 1}),
            Reading("two turns", {"turns": 2}, "it takes time"),
        )
        costly = ("turns",)

        def _prepare(self, environment, count, rng):
            raise NotImplementedError

    monkeypatch.setitem(REGISTERED, "mine", Mine)
    Mine.name = "mine"
    found = grid._choices_of("mine")
    assert [one.choice for one in found] == [
        "one turn", "two turns",
        *(f"perturbed by the {extent} angle" for extent in get_args(LightExtent)),
    ]  # fmt: skip
    assert found[1].ruled_out == "it takes time" and found[1].spec.label == "mine[turns=2]"
    assert costly("mine") == ("turns",)


def test_each_reading_is_measured_once_beside_its_default():
    labels = [spec.label for spec in measured_samplers()]
    assert len(labels) == len(set(labels))
    families = {reading.sampler for reading in READINGS}
    assert families <= set(labels)
    words, defaults = set(choices_in_words()) - set(READ_AS), set(defaults_in_words())
    assert set(labels) - families == words - defaults and defaults <= words
    for sampler, (default, choice) in READ_AS.items():
        assert {sampler, default} <= set(labels) and choice
    # A sampler's choices are told apart by their words.
    words = [(reading.sampler, reading.choice) for reading in READINGS]
    assert len(words) == len(set(words))


def test_what_changes_the_cost_of_an_image_is_compared_at_equal_cost():
    labels = [spec.label for spec in costly_samplers()]
    assert {"ours", "ours[upsampling=1]"} <= set(labels) and "ours[masking=False]" not in labels
    families = {spec.name for spec in costly_samplers() if not spec.parameters}
    assert families == {reading.sampler for reading in READINGS if costly(reading.sampler)}
    pairs = equal_costs(find_scale("paper"))
    assert {str(budget.equal) for _, budget in pairs} == {"rays", "time"}
    assert {spec.label for spec, _ in pairs} == set(labels)


def test_what_is_ruled_out_is_measured_and_no_default():
    assert set(RULED_OUT) <= set(choices_in_words()) - set(defaults_in_words())
