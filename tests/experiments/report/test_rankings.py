"""Who won and how surely: checked on errors whose ranks and ratios are known."""

import math

import numpy as np
import pytest

from experiments.report.index_page import ranking_table
from experiments.report.ranking_plots import merit_order
from experiments.report.rankings import results
from experiments.report.sections.ranks import by_league, ranked_table
from experiments.report.sentences import doubt, remarks, verdict
from experiments.report.style import SHADES, looks
from experiments.report.summary import LEAGUE, LEAGUES, summary
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


def test_the_ratio_has_no_spread_where_all_maps_agree():
    found = ranking_of(LADDER)
    for values in (found.ratio.ratio, found.ratio.low, found.ratio.high):
        np.testing.assert_allclose(values, [1.0, 2.0, 3.0, 4.0], rtol=1e-12)
    assert found.losses == ()
    # Wilcoxon's exact p over 30 maps is 2 / 2^30; times the 6 pairs it is 1.1e-08.
    assert verdict(found) == (
        "d has the best mean rank by FLIP, 1.00, and is first on 30 of 30 maps. The next, c "
        "(2.00), has 2.00 times the FLIP of d (geometric mean over maps, 95 % interval 2.00 to "
        "2.00): a smaller FLIP on 0, an equal one on 0 and a larger one on 30 of 30 maps "
        f"(p = {found.pairs.p_value[1, 0]:.2g})."
    )
    assert found.pairs.p_value[1, 0] < 1e-5
    assert doubt(found) == ""


def test_doubt_names_those_that_are_not_told_apart():
    few = ranking_of({name: values[:5] for name, values in LADDER.items()})
    # 6 pairs × 2 / 2^5
    assert doubt(few).startswith(
        "5 maps are too few to tell any two of 4 samplers apart: p is at least 0.38 ("
    )
    halves = {name: np.where(np.arange(12) < 6, values[:12], 1.0 / values[:12])
              for name, values in LADDER.items()}  # fmt: skip
    assert " is not told apart from " in doubt(ranking_of(halves))


def test_a_loss_names_who_is_better_and_by_how_much():
    errors = {name: values.copy() for name, values in LADDER.items()}
    errors["c"][3] = 0.5
    errors["b"][7] = 0.25
    found = ranking_of(errors, scenes=("vase", "teapot"))
    assert [(x.scene, x.environment, x.best, x.ratio) for x in found.losses] == [
        ("teapot", "map07", ("b",), 4.0), ("vase", "map07", ("b",), 4.0),
        ("teapot", "map03", ("c",), 2.0), ("vase", "map03", ("c",), 2.0),
    ]  # fmt: skip
    assert (found.firsts[0], found.cases, len(found.per_map)) == (MAPS - 2, 2 * MAPS, MAPS)
    result = results(rows_of(errors, scenes=("vase", "teapot")))[0]
    files = {(x.scene, x.environment): "page.html" for x in found.losses}
    shown = ranking_table(result, found, looks(list("abcd")), files)
    assert shown["rivals"] == "b on 2, c on 2"
    assert [loss["case"] for loss in shown["losses"]][:2] == ["teapot · map07", "vase · map07"]
    assert shown["losses"][0]["sentence"] == (
        "b is better; d has 4.00 times its FLIP (2.0000 against 0.5000)"
    )


def test_whiskers_lie_in_order_on_the_axis():
    rng = np.random.default_rng(3)
    errors = {name: values * rng.uniform(0.5, 2.0, MAPS) for name, values in LADDER.items()}
    result = results(rows_of(errors))[0]
    files = {(x.scene, x.environment): "" for x in result.rankings[0].losses}
    shown = ranking_table(result, result.rankings[0], looks(list("abcd")), files)
    for line in shown["lines"]:
        low, middle, high = line["whisker"].values()
        assert 0.0 <= low <= middle <= high <= 100.0
    ratios = result.rankings[0].ratio.ratio
    order = np.argsort(ratios, kind="stable")
    places = np.array([line["whisker"]["middle"] for line in shown["lines"]])[order]
    assert (np.diff(places) > 0).all()
    one = next(place for place, text in shown["ticks"] if text == "1×")
    assert one == shown["lines"][0]["whisker"]["middle"]


def test_errors_of_zero_everywhere_have_ranks_but_no_ratio():
    found = ranking_of({name: np.zeros(3) for name in "abc"}, floor=0.0)
    assert found.ratio is None
    assert found.like_first == (True, True, True)
    assert found.friedman.p_value == 1.0
    assert remarks(found) == ["Ratios leave out 3 maps on which a sampler has no error at all."]
    assert verdict(found) == "By FLIP all 3 samplers share the mean rank 1.00."


def test_errors_of_zero_are_won_though_they_have_no_ratio():
    found = ranking_of({"a": [0.0, 0.0], "b": [0.0, 1.0]}, floor=0.0)
    assert found.ratio is None
    assert verdict(found) == (
        "a has the best mean rank by FLIP, 1.00, and is first on 2 of 2 maps, sharing the place on "
        "1. The next, b (1.50), has a smaller FLIP on 0, an equal one on 1 and a larger one on 1 "
        "of 2 maps (p = 1)."
    )


def test_a_run_without_a_complete_map_has_no_winner():
    rows = rows_of({"a": np.ones(2), "b": np.ones(2)})
    rows = rows[~((rows["sampler"] == "a") ^ (rows["environment"] == "map00"))]
    result = results(rows)[0]
    found = result.by(leading_metric().name)
    assert "nobody has won" in verdict(found)
    assert math.isnan(found.difference)
    shown = ranking_table(result, found, looks(["a", "b"]), {})
    assert [line["error"] for line in shown["lines"]] == ["–", "–"]


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
    heading, table, *_ = by_league(rows)
    assert heading.text == "lights=4: fixed lights"
    # c is alone in its league; the others are ranked as if it did not exist.
    assert list(table.rows["sampler"]) == ["d", "b", "a"]
    assert list(table.rows[f"{leading_metric().name}_rank"]) == [1.0, 2.0, 3.0]
    assert len([part for part in by_league(rows) if part == heading]) == 1


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
