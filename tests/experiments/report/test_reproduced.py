"""The papers' orders stand beside those of runs whose errors are given."""

import math
from dataclasses import replace

import pytest

from experiments.report.across_runs import reproduced
from experiments.report.parts import Items, Table, Text
from experiments.wu2025.published import TABLE1
from tests.experiments.grid_rows import grid_run

PAPER = tuple(TABLE1.values)
"""The seven methods, in an order of no meaning."""


def published_run(tmp_path, errors, experiment="table1", budget="seconds=0.02"):
    run = grid_run(tmp_path, ("vase",), ("a", "b", "c"), PAPER, errors)
    rows = run.rows.assign(budget=budget)
    record = run.record | {"experiment": experiment, "budgets": [budget]}
    return replace(run, rows=rows, record=record)


def as_printed(scene, environment, sampler, count):
    return TABLE1.values[sampler]["rmse"][0], TABLE1.values[sampler]["flip"][0]


def test_the_papers_own_errors_are_its_own_order(tmp_path):
    _, text, table, _ = reproduced([published_run(tmp_path, as_printed)])
    assert isinstance(table, Table) and isinstance(text, Text)
    assert list(table.rows["metric"]) == ["RMSE", "FLIP"]
    assert (table.rows["spearman"] == 1.0).all() and (table.rows["place"] == 1).all()
    assert "measured 2 times" in text.text and "2 times they come out" in text.text


def test_an_order_that_is_turned_round_is_told(tmp_path):
    def turned(*which):
        return tuple(1.0 / value for value in as_printed(*which))

    _, text, table, _ = reproduced([published_run(tmp_path, turned)])
    assert table.rows["spearman"].to_list() == pytest.approx([-1.0, -1.0])
    assert (table.rows["place"] == len(PAPER)).all() and (table.rows["first"] == "ours").all()
    assert "0 times they come out" in text.text


def test_errors_that_the_references_cannot_tell_apart_are_equal(tmp_path):
    def tiny(*which):
        return tuple(1e-6 * value for value in as_printed(*which))

    _, _, table, _ = reproduced([published_run(tmp_path, tiny)])
    assert (table.rows["place"] == 1).all() and table.rows["spearman"].map(math.isnan).all()


def test_only_budgets_of_the_papers_kind_are_compared(tmp_path):
    assert not list(reproduced([published_run(tmp_path, as_printed, budget="lights=16")]))
    assert not list(reproduced([published_run(tmp_path, as_printed, experiment="convergence")]))


def test_an_experiment_that_examines_an_order_is_named_where_it_is_published(tmp_path):
    run = published_run(tmp_path / "plain", as_printed)
    *_, alone = reproduced([run])
    other = replace(run, folder=tmp_path / "why", record={"experiment": TABLE1.examined})
    *_, both = reproduced([run, other])
    assert isinstance(alone, Items) and not alone.sentences
    assert isinstance(both, Items)
    assert both.sentences == (
        "What the order of Table 1 of Wu 2025 depends on is told under `why`.",
    )
