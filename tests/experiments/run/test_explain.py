"""A stored result tells what determines it, what differs, and what has changed since."""

import json
from functools import partial

import pytest

from experiments.cli.commands import finish_grid
from experiments.run.explain import differences, explain
from experiments.run.grid_run import rows_of, run_plan
from experiments.run.store import Store
from experiments.wu2025.table1 import table1
from samplers import EnvlightError
from tests.experiments.stored import store_instead


@pytest.fixture
def first(grid):
    return grid.measurements()[0]


def age(store, key, old, new):
    """Let a stored result be of another state of the project."""
    store_instead(store, "image", key, old, new, "aged")


def test_a_result_tells_all_that_determines_it(finished, first):
    with Store.reading(finished) as store:
        text = explain(store, [first.key[:10]])
    parts, _, ranking = text.rpartition("\n\n")
    assert json.loads(parts) == first.identity
    assert ranking == (
        f"{first.key} is what the project would measure now; it belongs to the newest start"
    )


def test_two_results_tell_in_what_they_differ(finished, measurements_of):
    one, other = (measurements_of((name,), ("mis",)) for name in ("noise", "sun"))
    with Store.reading(finished) as store:
        seeds = explain(store, [one[0].key, one[2].key]).splitlines()
        maps = explain(store, [one[0].key, other[0].key]).splitlines()
    assert seeds[1:] == ["seed: 0 → 2"]
    assert maps[1] == "case.environment.name: noise → sun"
    assert maps[2].startswith("case.environment.file: ")
    assert len(maps) == 3


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('"numba": "', '"numba": "0.', "sampler.libraries.numba: 0."),
        ('"source": "', '"source": "0', "sampler.source: 0"),
        ('"renderer_source": "', '"renderer_source": "0', "renderer_source: 0"),
        ('"scene_source": "', '"scene_source": "0', "case.scene_source: 0"),
    ],
)
def test_a_stale_result_tells_what_has_changed(copied, first, old, new, told):
    with Store.writing(copied) as store:
        age(store, first.key, old, new)
        text = explain(store, ["aged"])
    assert "aged is stale: it enters no table" in text
    assert f"\n{told}" in text


def test_a_stale_score_tells_that_it_is_one(copied, first):
    key = first.score_keys["flip"]
    with Store.writing(copied) as store:
        store_instead(store, "score", key, '"metric_source": "', '"metric_source": "0')
        text = explain(store, [first.key])
    assert f"{first.key} is stale" in text
    assert "\nscore by flip: metric_source: 0" in text and "score by rmse" not in text


def test_of_a_sampler_that_is_gone_nothing_is_claimed(copied, first):
    with Store.writing(copied) as store:
        age(store, first.key, '"name": "median-cut"', '"name": "median-cat"')
        text = explain(store, ["aged"])
    assert "whether aged is stale cannot be told: no sampler is called 'median-cat'" in text


def test_stale_results_enter_no_table(copied, grid, first):
    with Store.writing(copied) as store:
        age(store, first.key, '"renderer_source": "', '"renderer_source": "0')
        before = len(store.results("image"))
        finish = partial(finish_grid, images=False)
        assert run_plan(table1(), store, grid.measurements(), finish, images=False) == 0
        rows = rows_of(store, store.plan())
        assert len(store.results("image")) == before + 1
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
