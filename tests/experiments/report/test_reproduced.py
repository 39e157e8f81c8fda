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
KINDS = "spearman", "place"


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
    (line,) = table.rows.to_dict("records")
    assert [line[f"{what}_{name}"] for what in KINDS for name in ("rmse", "flip")] == [1.0] * 4
    assert "measured 2 times" in text.text and "2 times they come out" in text.text


def test_an_order_that_is_turned_round_is_told(tmp_path):
    def turned(*which):
        return tuple(1.0 / value for value in as_printed(*which))

    _, text, table, _ = reproduced([published_run(tmp_path, turned)])
    (line,) = table.rows.to_dict("records")
    assert [line[f"spearman_{name}"] for name in ("rmse", "flip")] == pytest.approx([-1.0, -1.0])
    assert line["place_rmse"] == line["place_flip"] == len(PAPER) and line["first"] == "ours"
    assert "0 times they come out" in text.text


def test_errors_that_the_references_cannot_tell_apart_are_equal(tmp_path):
    def tiny(*which):
        return tuple(1e-6 * value for value in as_printed(*which))

    _, _, table, _ = reproduced([published_run(tmp_path, tiny)])
    (line,) = table.rows.to_dict("records")
    assert line["place_rmse"] == line["place_flip"] == 1
    assert math.isnan(line["spearman_rmse"]) and math.isnan(line["spearman_flip"])


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
