"""Every parameter of every sampler is among the readings, or there is a reason why not."""

from dataclasses import dataclass, field, fields
from typing import Literal, get_args, get_origin, get_type_hints

import pytest

from experiments.questions.readings.choices import (
    COSTLY,
    NOT_OPEN,
    READ_AS,
    RULED_OUT,
    SAME_AS,
    choices_in_words,
    costly_samplers,
    defaults_in_words,
    measured_samplers,
    readings,
)
from experiments.questions.readings.grid import equal_costs
from experiments.run.scale import find_scale
from samplers import LightSampler, make_sampler, register, sampler_class, sampler_names
from samplers.base import REGISTERED

PARAMETERS = [
    (sampler, field.name) for sampler in sampler_names() for field in fields(sampler_class(sampler))
]


def values_of(sampler: str, name: str) -> set:
    """The values that the readings give to a parameter."""
    return {
        value
        for reading in readings()
        if reading.sampler == sampler
        for key, value in reading.parameters
        if key == name
    }


@pytest.mark.parametrize(("sampler", "name"), PARAMETERS, ids=lambda word: word)
def test_every_parameter_is_a_reading_or_has_a_reason(sampler, name):
    of = SAME_AS.get(sampler, sampler)
    listed = values_of(of, name)
    if (of, name) in NOT_OPEN:
        assert not listed and NOT_OPEN[of, name]
        return
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
    assert set(NOT_OPEN) <= set(PARAMETERS)
    for reading in readings():
        assert {(reading.sampler, name) for name, _ in reading.parameters} <= set(PARAMETERS)
        assert reading.spec.sampler.name == reading.sampler


def test_samplers_are_same_as_others_only_where_their_parameters_are():
    for sampler, other in SAME_AS.items():
        assert [f.name for f in fields(sampler_class(sampler))] == [
            f.name for f in fields(sampler_class(other))
        ]


def test_each_reading_is_measured_once_beside_its_default():
    labels = [spec.label for spec in measured_samplers()]
    assert len(labels) == len(set(labels))
    families = {reading.sampler for reading in readings()}
    assert families <= set(labels)
    words, defaults = set(choices_in_words()) - set(READ_AS), set(defaults_in_words())
    assert set(labels) - families == words - defaults and defaults <= words
    for sampler, (default, choice) in READ_AS.items():
        assert {sampler, default} <= set(labels) and choice
    # A sampler's choices are told apart by their words.
    words = [(reading.sampler, reading.choice) for reading in readings()]
    assert len(words) == len(set(words))


def test_what_changes_the_cost_of_an_image_is_compared_at_equal_cost():
    assert {(sampler, name) for sampler, names in COSTLY.items() for name in names} <= set(
        PARAMETERS
    )
    labels = [spec.label for spec in costly_samplers()]
    assert {"ours", "ours[upsampling=1]"} <= set(labels) and "ours[masking=False]" not in labels
    families = {spec.name for spec in costly_samplers() if not spec.parameters}
    assert families == set(COSTLY)
    pairs = equal_costs(find_scale("paper"))
    assert {str(budget.equal) for _, budget in pairs} == {"rays", "time"}
    assert {spec.label for spec, _ in pairs} == set(labels)


def test_what_is_ruled_out_is_measured_and_no_default():
    assert set(RULED_OUT) <= set(choices_in_words()) - set(defaults_in_words())


def test_a_new_sampler_says_in_its_own_file_what_is_open():
    @register("newcomer")
    @dataclass(frozen=True)
    class Newcomer(LightSampler):
        """Has a parameter of every kind."""

        order: Literal["first", "last"] = "last"
        masked: bool = True
        width: float = field(default=0.5, metadata={"readings": (0.25,)})
        depth: int = field(default=4, metadata={"fixed": "its paper prints the value"})

        def _prepare(self, environment, count, rng):
            raise NotImplementedError

    readings.cache_clear()
    try:
        for parameter in fields(Newcomer):
            test_every_parameter_is_a_reading_or_has_a_reason("newcomer", parameter.name)
        others = {one.spec.label for one in readings() if one.sampler == "newcomer"}
    finally:
        del REGISTERED["newcomer"]
        readings.cache_clear()
    changed = {"order=first", "masked=False", "width=0.25"}
    assert others == {"newcomer", *(f"newcomer[{one}]" for one in changed)}
