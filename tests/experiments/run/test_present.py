"""A stored row is known for stale by any part of what determined it."""

import json
from dataclasses import replace
from functools import partial

import pytest

from experiments.cli.commands import finish
from experiments.run.identity import Shared
from experiments.run.runner import Present, rows_of
from experiments.run.store import IMAGE, Store
from experiments.wu2025.table1 import table1
from tests.experiments.stored import alter, alter_identity, run_plan


@pytest.fixture
def first(grid):
    return grid.measurements()[0]


@pytest.mark.parametrize(
    ("part", "fields"),
    [
        ("sampler", {"libraries": {"numba": "0.1"}}),
        ("sampler", {"programs": {"samplers.median_cut": "0"}}),
        ("program", {"programs": {"renderer.render": "0"}}),
        ("program", {"programs": {"experiments.run.rendering alone": "0"}}),
        ("case", {"programs": {"renderer.scenes.vase": "0"}}),
    ],
)
def test_a_row_is_stale_by_any_part_of_its_image(copied, first, part, fields):
    with Store.writing(copied) as store:
        (one,) = (one for one in store.plan if one.key == first.key)
        assert Present(store).has(one, store.get(one.key))
        alter_identity(store, first.key, part, "aged", **fields)
        assert not Present(store).has(one, store.get("aged"))


@pytest.mark.parametrize("part", ["score", "reference", "features"])
def test_a_row_is_stale_by_what_stands_in_it_besides(copied, first, part):
    flip = first.case.score_identities["flip"]
    aged = Shared({**flip.value, "programs": {"metrics.flip": "0"}})
    with Store.writing(copied) as store:
        (one,) = (one for one in store.plan if one.key == first.key)
        if part == "score":
            store._put_shared(aged)
            one = replace(one, scores=(aged.key,))
        else:
            old = json.dumps({"programs": {"renderer.render": "0"}})
            alter(store, {"reference": one.reference, "features": one.features[0]}[part],
                  identity_text=old)  # fmt: skip
        assert not Present(store).has(one, store.get(one.key))


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
