"""Every parameter of every sampler is among the readings, or there is a reason why not."""

from dataclasses import dataclass, field, fields
from typing import Literal, get_args, get_origin, get_type_hints

import pytest

from experiments.questions.readings import (
    READ_AS,
    SHARED,
    by_label,
    changes_cost,
    choices_in_words,
    costly,
    costly_samplers,
    equal_costs,
    every_reading,
    measured_samplers,
    ruled_out,
    same_as,
)
from experiments.run.sampler_spec import family_of
from experiments.run.scale import find_scale
from samplers import LightSampler, make_sampler, register, sampler_class, sampler_names
from samplers.base import REGISTERED, Reading

PARAMETERS = [
    (sampler, field.name) for sampler in sampler_names() for field in fields(sampler_class(sampler))
]


def values_of(sampler: str, name: str) -> set:
    """The values that the readings give to a parameter."""
    return {
        value
        for reading in every_reading()
        if reading.sampler == sampler
        for key, value in reading.parameters
        if key == name
    }


@pytest.mark.parametrize(("sampler", "name"), PARAMETERS, ids=lambda word: word)
def test_every_parameter_is_a_reading_or_has_a_reason(sampler, name):
    of = same_as(sampler)
    listed = values_of(of, name)
    (field,) = (one for one in fields(sampler_class(of)) if one.name == name)
    if field.metadata.get("fixed"):
        assert not listed
        return
    default = getattr(make_sampler(of), name)
    kind = get_type_hints(sampler_class(of))[name]
    if get_origin(kind) is Literal:
        assert listed == set(get_args(kind)), "every value has to be read"
    elif kind is bool:
        assert listed == {True, False}
    else:
        assert listed - {default}, (
            "say in the sampler's file which other values are read, or why none is: "
            'field(default=…, metadata={"readings": (…,)}) or {"fixed": "…"}'
        )


def test_nothing_is_listed_that_no_sampler_has():
    for sampler in sampler_names():
        assert {(sampler, name) for name in sampler_class(sampler).costly} <= set(PARAMETERS)
    for reading in every_reading():
        assert {(reading.sampler, name) for name, _ in reading.parameters} <= set(PARAMETERS)
        assert reading.spec.sampler.name == reading.sampler


def test_a_variant_has_its_parents_parameters_and_no_readings_of_its_own():
    variants = [name for name in sampler_names() if same_as(name) != name]
    assert "ours-no-upsampling" in variants
    for name in variants:
        assert [f.name for f in fields(sampler_class(name))] == [
            f.name for f in fields(sampler_class(same_as(name)))
        ]
        assert not any(reading.sampler == name for reading in every_reading())


def test_each_reading_is_measured_once_beside_its_default():
    labels = [spec.label for spec in measured_samplers()]
    assert len(labels) == len(set(labels))
    families = {reading.sampler for reading in every_reading()}
    assert families <= set(labels)
    words = {label for label in choices_in_words() if family_of(label) in families}
    assert set(labels) - families == words - set(READ_AS)
    for sampler, (default, choice) in READ_AS.items():
        assert {sampler, default} <= set(labels) and choice
    # A sampler's choices are told apart by their words.
    words = [(reading.sampler, reading.choice) for reading in every_reading()]
    assert len(words) == len(set(words))


def test_what_changes_the_cost_of_an_image_is_compared_at_equal_cost():
    labels = [spec.label for spec in costly_samplers()]
    assert {"ours", "ours[upsampling=1]"} <= set(labels) and "ours[masking=False]" not in labels
    families = {spec.name for spec in costly_samplers() if not spec.parameters}
    assert families == {one.sampler for one in every_reading() if costly(one.sampler)}
    pairs = equal_costs(find_scale("paper"))
    assert {str(budget.equal) for _, budget in pairs} == {"rays", "time"}
    assert {spec.label for spec, _ in pairs} == set(labels)


def test_what_is_ruled_out_is_no_default():
    assert set(ruled_out()) <= {*choices_in_words(), *(words for words, _ in SHARED.values())}
    assert not any(one.ruled_out for one in every_reading() if not one.spec.parameters)
    variant = "ours-no-upsampling[sets=independent]"
    assert ruled_out()[variant] == ruled_out()["ours[sets=independent]"] and changes_cost(variant)


def test_a_new_sampler_says_in_its_own_file_what_is_open():
    @register("newcomer")
    @dataclass(frozen=True)
    class Newcomer(LightSampler):
        """Has a parameter of every kind."""

        order: Literal["first", "last"] = "last"
        masked: bool = True
        width: float = field(default=0.5, metadata={"readings": (0.25,)})
        depth: int = field(default=4, metadata={"fixed": "its paper prints the value"})
        turns: int = 1
        readings = (
            Reading("one turn", {"turns": 1}),
            Reading("two turns", {"turns": 2}, "they take time"),
        )
        costly = ("turns",)

        def _prepare(self, environment, count, rng):
            raise NotImplementedError

    by_label.cache_clear()
    try:
        for parameter in fields(Newcomer):
            test_every_parameter_is_a_reading_or_has_a_reason("newcomer", parameter.name)
        assert ruled_out()["newcomer[turns=2]"] == "they take time"
        assert changes_cost("newcomer[turns=2]") and not changes_cost("newcomer[order=first]")
        others = {one.spec.label for one in every_reading() if one.sampler == "newcomer"}
    finally:
        del REGISTERED["newcomer"]
        by_label.cache_clear()
    changed = {"order=first", "masked=False", "width=0.25", "turns=2"}
    assert others == {"newcomer", *(f"newcomer[{one}]" for one in changed)}
