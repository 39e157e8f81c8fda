"""Who won and how surely: checked on errors whose ranks and ratios are known."""

import math

import numpy as np
import pandas as pd
import pytest

from experiments.report import summary as described
from experiments.report.ranking_plots import merit_order
from experiments.report.rankings import results, verdict
from experiments.report.sections.ranks import by_league, exceeded, ranked_table
from experiments.report.style import SHADES, looks
from experiments.report.summary import ALIKE, COSTS, LEAGUE, LEAGUES, OVER, Column, summary
from experiments.report.tables import as_latex, as_markdown, print_summary, text_of
from experiments.report.write import write_tables
from metrics.ranking import critical_difference
from metrics.registry import leading_metric
from samplers import sampler_names
from tests.experiments.report.ranking_rows import ranking_of, rows_of

MAPS = 30

LADDER = {name: np.full(MAPS, 1.0 + k) for k, name in enumerate("dcba")}
"""Mean ranks 1, 2, 3, 4 exactly; d is the best."""


def test_groups_follow_the_critical_difference():
    found = ranking_of(LADDER)
    assert found.samplers == ("d", "c", "b", "a")
    # 4 samplers on 30 maps: the critical difference is 0.856, less than a rank.
    assert found.difference == pytest.approx(0.856, abs=1e-3)
    assert found.groups == ()
    few = ranking_of({name: values[:5] for name, values in LADDER.items()})
    # On 5 maps it is 2.1: ranks 1 to 3, and 2 to 4, are not told apart.
    assert critical_difference(4, 5) == pytest.approx(2.098, abs=1e-3)
    assert few.groups == ((0, 1, 2), (1, 2, 3))


def test_who_is_like_the_first_is_asked_of_the_two_alone():
    found = ranking_of(LADDER)
    assert found.like_first == (True, False, False, False)
    # All of 5 signs agree: Wilcoxon's p is 2 / 2^5 = 0.06 before any correction.
    few = ranking_of({name: values[:5] for name, values in LADDER.items()})
    assert few.like_first == (True, True, True, True)


def test_what_lies_near_the_floor_is_shared():
    errors = {"a": [0.10, 0.50, 0.50], "b": [0.20, 0.40, 0.60], "c": [0.31, 0.60, 0.40]}
    # Three floors are 0.3: on the first map a and b share the place and c is behind them.
    found = ranking_of(errors, floor=0.1)
    ranks = zip(found.samplers, found.ranks.T.tolist(), strict=True)
    assert dict(ranks) == {
        "a": [1, 2, 2], "b": [1, 1, 3], "c": [3, 3, 1],
    }  # fmt: skip
    assert found.per_map["a"].tolist() == errors["a"]
    assert found.resolved["a"].tolist() == pytest.approx([0.3, 0.5, 0.5])
    assert found.near.tolist() == [[True, True, False], [False] * 3, [False] * 3]
    a, b = found.samplers.index("a"), found.samplers.index("b")
    pairs = found.pairs
    assert (pairs.wins[a, b], pairs.ties[a, b], pairs.losses[a, b]) == (1, 1, 1)
    assert pairs.ratio[a, b] == pytest.approx((1.0 * 0.5 / 0.4 * 0.5 / 0.6) ** (1 / 3))
    # The mean ranks of the summary, by which tables are sorted, are those.
    table = summary(rows_of(errors, floor=0.1)).set_index("sampler")
    assert table[f"{leading_metric().name}_rank"].to_dict() == pytest.approx(
        {"a": 5 / 3, "b": 5 / 3, "c": 7 / 3}
    )
    assert table[leading_metric().name]["a"] == pytest.approx(1.1 / 3)


def test_a_floor_that_is_not_known_changes_nothing():
    errors = {name: values * np.linspace(1.0, 2.0, MAPS) for name, values in LADDER.items()}
    known, unknown = ranking_of(errors), ranking_of(errors, floor=math.nan)
    assert np.array_equal(known.ranks, unknown.ranks)
    assert not unknown.near.any()


def test_errors_of_zero_are_won_though_they_have_no_ratio():
    found = ranking_of({"a": [0.0, 0.0], "b": [0.0, 1.0]}, floor=0.0)
    assert found.ratio is None
    assert verdict(found) == (
        "2 maps are too few for a significant difference by FLIP among 2 samplers (p is at least "
        "0.5). a has the least mean rank, 1.00; against the next, b (1.50): wins 1, ties 1, loses "
        "0, p = 1. Ratios leave out 2 maps on which an error is 0."
    )


def test_a_run_without_a_complete_map_has_no_winner():
    rows = rows_of({"a": np.ones(2), "b": np.ones(2)})
    rows = rows[~((rows["sampler"] == "a") ^ (rows["environment"] == "map00"))]
    result = results(rows)[0]
    found = result.by(leading_metric().name)
    assert "there is no ranking" in verdict(found)
    assert math.isnan(found.difference)
    shown = text_of(ranked_table(result))
    assert [list(shown[label]) for label in (found.metric.label, "FLIP")] == [["–", "–"]] * 2


def over_budget(budget, **columns):
    """The ladder at a budget of which d, which is best, takes 1.5 times as much."""
    rows = rows_of(LADDER, budget=budget)
    first = rows["sampler"] == "d"
    return rows.assign(**{n: np.where(first, 1.5 * v, v) for n, v in columns.items()})


@pytest.mark.parametrize("rows", [
    over_budget("seconds=0.1", seconds_render=0.105), over_budget("rays=2", rays_shadow=10),
    over_budget("time=a:4", seconds_render=0.2).assign(allowed=0.2),
])  # fmt: skip
def test_who_is_over_the_budget_is_marked_and_not_ranked(rows, capsys):
    (result,) = results(rows)
    alone = results(rows[rows["sampler"] != "d"])[0].rankings[0]
    for found in result.rankings:
        assert found.samplers == ("c", "b", "a") and verdict(found).startswith("c is first by")
        np.testing.assert_array_equal(found.ranks, alone.ranks)
    table = ranked_table(result)
    line = text_of(table).iloc[-1]
    assert line["sampler"] == "d"
    assert list(line["rank"]) == ["–", "–"] and set(line[ALIKE]) == {OVER}
    assert OVER in table.caption and "1.5" in exceeded(rows)[0]
    print_summary(summary(rows), "t")
    assert "over the budget: d\n" in capsys.readouterr().out


def test_all_are_ranked_where_all_keep_the_budget_or_none_does():
    for seconds in (0.109, 0.2):
        rows = rows_of(LADDER, budget="seconds=0.1").assign(seconds_render=seconds)
        (result,) = results(rows)
        assert len(result.rankings[0].samplers) == len(LADDER)
        assert exceeded(rows) == [] and "Not ranked" not in ranked_table(result).caption


def test_mean_ranks_have_intervals_over_maps():
    """None where all maps agree; of two that change places by turns, the binomial's."""
    ends = [f"{leading_metric().name}_rank{end}" for end in ("_low", "_high", "_margin")]
    assert summary(rows_of(LADDER))[ends].T.to_numpy().tolist() == [[1, 2, 3, 4]] * 2 + [[0] * 4]
    turns = 1.0 + np.arange(MAPS) % 2
    low, high, margin = summary(rows_of({"a": turns, "b": 3.0 - turns}))[ends].T.to_numpy()
    # Half of 30 maps have rank 2: the share has a deviation of √(.25 / 30) = .091.
    np.testing.assert_allclose(high - low, 2 * 1.96 * 0.091, rtol=0.15)
    np.testing.assert_allclose(high + low, 3.0, atol=0.07)
    np.testing.assert_array_equal(margin, (high - low) / 2)


def test_maps_run_from_the_clearest_win_to_the_clearest_loss():
    found = ranking_of({"a": [1.0, 1.0, 1.0, 0.0], "b": [1.5, 0.9, 4.0, 0.0]}, floor=0.0)
    # Leads of a: 1 / 4, 1 / 1.5, none, 1 / 0.9.
    assert found.winner == "a"
    assert merit_order(found).tolist() == [2, 0, 3, 1]


def leagues_rows():
    rows = rows_of({name: LADDER[name] for name in "abcd"})
    names = dict(zip("abcd", (LEAGUES[0], LEAGUES[0], LEAGUES[3], LEAGUES[0]), strict=True))
    return rows.assign(**{LEAGUE: rows["sampler"].map(names)})


def test_leagues_are_told_in_the_table_and_ranked_apart():
    rows = leagues_rows()
    (result,) = results(rows)
    assert ranked_table(result).rows.set_index("sampler")[LEAGUE]["c"] == LEAGUES[3]
    (table,) = by_league(rows)
    assert not table.shown and set(table.rows[LEAGUE]) == {"fixed lights"}
    # c is alone in its league; the others are ranked as if it did not exist.
    assert list(table.rows["sampler"]) == ["d", "b", "a"]
    assert list(table.rows[f"{leading_metric().name}_rank"]) == [1.0, 2.0, 3.0]


def test_a_league_has_a_hue_and_its_members_shades():
    found = looks(list("abcd"), {"a": LEAGUES[0], "b": LEAGUES[0], "c": LEAGUES[3]})
    assert {found["a"].color, found["b"].color} < set(SHADES[LEAGUES[0]])
    assert found["a"] != found["b"] and found["c"].color in SHADES[LEAGUES[3]]
    assert found["d"] == looks(list("abcd"))["d"]


def test_a_sampler_looks_the_same_whatever_else_a_run_holds():
    """And no two of the registered ones look alike, with or without colour's help."""
    every = looks(sampler_names())
    assert all(looks([name])[name] == look for name, look in every.items())
    assert len({(look.color, look.marker) for look in every.values()}) == len(every)
    assert every["ours"].color in SHADES["layers"] and every["ris"].color in SHADES[LEAGUES[4]]


OWN = Column(
    "cast", "rays cast", ".0f", "cast", of=lambda rows: 1e3 * rows["rays_shadow"], better="less"
)


def test_another_column_is_one_entry(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(described, "COSTS", (*COSTS, OWN))
    rows = rows_of({"a": [0.1, 0.2], "b": [0.3, 0.4]})
    rows["rays_shadow"] = [4, 8, 20, 30]
    (result,) = results(rows)
    table = ranked_table(result)
    write_tables([table], tmp_path)
    written = pd.read_csv(tmp_path / "summary.csv").set_index("sampler")["cast"]
    assert written.to_dict() == {"a": 6000.0, "b": 25000.0}
    print_summary(summary(rows), "t")
    on_terminal = capsys.readouterr().out
    for text in (as_markdown(table), as_latex(table)):
        assert "rays cast" in text and "6000" in text and " 25000 " in text
    assert " cast" in on_terminal and " 25000" in on_terminal
