"""A stored result tells what determines it, what differs, and what has changed since."""

import json
from dataclasses import replace
from functools import partial

import pytest

from experiments.cli.commands import finish
from experiments.run.explain import Present, differences, explain
from experiments.run.identity import Shared
from experiments.run.runner import rows_of
from experiments.run.store import IMAGE, Store
from experiments.wu2025.table1 import table1
from samplers import EnvlightError
from tests.experiments.stored import alter, alter_identity, run_plan


@pytest.fixture
def first(grid):
    return grid.measurements()[0]


def test_a_result_tells_all_that_determines_it(finished, first):
    with Store.reading(finished) as store:
        text = explain(store, [first.key[:10]])
    parts, _, told = text.rpartition("\n\n")
    plain = json.dumps(first.identity, default=lambda shared: shared.value)
    assert json.loads(parts) == json.loads(plain)
    assert told == f"{first.key} is what would be measured now"


def test_two_results_tell_in_what_they_differ(finished, measurements_of):
    one, other = (measurements_of((name,), ("mis",)) for name in ("noise", "sun"))
    with Store.reading(finished) as store:
        seeds = explain(store, [one[0].key, one[2].key]).splitlines()
        maps = explain(store, [one[0].key, other[0].key]).splitlines()
    assert seeds[1:] == ["seed: 0 → 2"]
    assert maps[1].startswith("case.environment.file: ")
    assert maps[2] == "case.environment.name: noise → sun"
    assert len(maps) == 3


@pytest.mark.parametrize(
    ("part", "fields", "told"),
    [
        ("sampler", {"libraries": {"numba": "0.1"}}, "sampler.libraries.numba: 0.1"),
        ("sampler", {"programs": {"samplers.median_cut": "0"}}, "samplers.median_cut: 0"),
        ("sampler", {"programs": {"samplers.median_cat": "0"}}, "samplers.median_cat: 0"),
        ("program", {"programs": {"renderer.render": "0"}}, "program.programs.renderer.render: 0"),
        ("program", {"programs": {"renderer.render alone": "0"}}, "renderer.render alone: 0"),
        ("case", {"programs": {"renderer.scenes.vase": "0"}}, "case.programs.renderer.scenes"),
    ],
)
def test_a_stale_result_tells_what_has_changed(copied, first, part, fields, told):
    with Store.writing(copied) as store:
        alter_identity(store, first.key, part, "aged", **fields)
        text = explain(store, ["aged"])
    assert "aged is stale" in text and told in text.rpartition("have changed:\n")[2]


@pytest.mark.parametrize("part", ["image", "score", "reference", "features"])
def test_a_row_is_stale_by_any_of_its_parts(copied, first, part):
    flip = first.case.score_identities["flip"]
    aged = Shared({**flip.value, "programs": {"metrics.flip": "0"}})
    old = json.dumps({"programs": {"renderer.render": "0"}})
    with Store.writing(copied) as store:
        (one,) = (one for one in store.plan if one.key == first.key)
        stored = store.get(one.key)
        assert Present(store).has(one, stored)
        if part == "score":
            store._put_shared(aged)
            one = replace(one, scores=(aged.key,))
        elif part == "image":
            stored = replace(stored, identity_text=old)
        else:
            alter(store, {"reference": one.reference, "features": one.features[0]}[part],
                  identity_text=old)  # fmt: skip
        assert not Present(store).has(one, stored)


def test_stale_results_enter_no_table(copied, grid, first):
    with Store.writing(copied) as store:
        alter_identity(store, first.key, "program", "aged", programs={"renderer.render": "0"})
        before = store.count(IMAGE)
        made = partial(finish, images=False)
        assert run_plan(table1(), store, grid.measurements(), made, images=False) == 0
        rows = rows_of(store)
        assert store.count(IMAGE) == before + 1
    assert "aged" not in set(rows["key"])
    assert set(rows["key"]) == {measurement.key for measurement in grid.measurements()}


def test_keys_that_name_no_measurement_are_refused(finished):
    with Store.reading(finished) as store:
        with pytest.raises(EnvlightError, match="0 measurements have a key that begins with 'zzz'"):
            explain(store, ["zzz"])
        with pytest.raises(EnvlightError, match="25 measurements"):
            explain(store, [""])
        with pytest.raises(EnvlightError, match="of one measurement, or of two"):
            explain(store, [])


def test_what_only_one_has_is_told():
    assert differences({"a": 1, "b": {"c": 2}}, {"b": {"c": 3, "d": [4]}}) == [
        "a: 1 → nothing",
        "b.c: 2 → 3",
        "b.d: nothing → [4]",
    ]
