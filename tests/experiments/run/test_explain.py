"""A stored result tells what determines it, what differs, and what has changed since."""

import json
from dataclasses import replace
from functools import partial

import pytest

from experiments.cli.commands import finish
from experiments.run.explain import differences, explain
from experiments.run.identity import Shared, plain
from experiments.run.runner import rows_of
from experiments.run.store import IMAGE, Store
from experiments.wu2025.table1 import table1
from samplers import EnvlightError
from tests.experiments.stored import alter_identity, run_plan


@pytest.fixture
def first(grid):
    return grid.measurements()[0]


def test_a_result_tells_all_that_determines_it(finished, first):
    with Store.reading(finished) as store:
        text = explain(store, [first.key[:10]])
    parts, _, ranking = text.rpartition("\n\n")
    assert json.loads(parts) == plain(first.identity)
    assert ranking == (
        f"{first.key} is what the project would measure now; it belongs to the newest start"
    )


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
        ("sampler", {"source": "0"}, "sampler.source: 0"),
        ("program", {"renderer_source": "0"}, "program.renderer_source: 0"),
        ("case", {"scene_source": "0"}, "case.scene_source: 0"),
    ],
)
def test_a_stale_result_tells_what_has_changed(copied, first, part, fields, told):
    with Store.writing(copied) as store:
        alter_identity(store, first.key, part, "aged", **fields)
        text = explain(store, ["aged"])
    assert "aged is stale: it enters no table" in text
    assert f"\n{told}" in text


def test_a_stale_score_tells_that_it_is_one(copied, first):
    flip = first.case.score_identities["flip"]
    aged = Shared({**flip.value, "metric_source": "0"})
    with Store.writing(copied) as store:
        store._put_shared(aged)
        store.selection.plan[:] = [
            replace(one, scores=tuple(aged.key if key == flip.key else key for key in one.scores))
            for one in store.plan
        ]
        text = explain(store, [first.key])
    assert f"{first.key} is stale" in text
    assert "\nscore by flip: metric_source: 0" in text and "score by rmse" not in text


def test_of_a_sampler_that_is_gone_nothing_is_claimed(copied, first):
    with Store.writing(copied) as store:
        alter_identity(store, first.key, "sampler", "aged", name="median-cat")
        text = explain(store, ["aged"])
    assert "whether aged is stale cannot be told: no sampler is called 'median-cat'" in text


def test_stale_results_enter_no_table(copied, grid, first):
    with Store.writing(copied) as store:
        alter_identity(store, first.key, "program", "aged", renderer_source="0")
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
