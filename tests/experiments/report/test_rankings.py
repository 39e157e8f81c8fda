"""Who won and how surely: checked on errors whose ranks and ratios are known."""

import dataclasses
import math
import re
import statistics

import numpy as np
import pandas as pd
import pytest

from experiments.report.palette import looks
from experiments.report.ranking_table import doubt, ranking_table, remarks, sentence
from experiments.report.rankings import Ranking, results
from metrics.ranking import critical_difference

MAPS = 30


def rows_of(errors: dict[str, np.ndarray], scenes: tuple[str, ...] = ("vase",)) -> pd.DataFrame:
    """One error per map; the second scene has twice the error. FLIP equals RMSE."""
    return pd.DataFrame(
        [
            {
                "scene": scene, "environment": f"map{k:02d}", "sampler": sampler,
                "budget": "lights=4", "seed": 0, "rmse": (1 + place) * error,
                "flip": (1 + place) * error, "lights": 4, "rays_shadow": 10, "rays_brdf": 0,
                "rays_primary": 5, "seconds_lights": 0.0, "seconds_render": 1.0,
                "noise_floor": 0.01, "over_budget": False, "near_noise_floor": False,
            }
            for sampler, values in errors.items()
            for k, error in enumerate(values)
            for place, scene in enumerate(scenes)
        ]
    )  # fmt: skip


def ranking_of(errors: dict[str, np.ndarray], **options) -> Ranking:
    return results(rows_of(errors, **options))[0].rmse


LADDER = {name: np.full(MAPS, 1.0 + k) for k, name in enumerate("dcba")}
"""Mean ranks 1, 2, 3, 4 exactly; d is the best."""


def test_letters_follow_the_critical_difference():
    found = ranking_of(LADDER)
    assert found.samplers == ("d", "c", "b", "a")
    # 4 samplers on 30 maps: the critical difference is 0.856, less than a rank.
    assert found.difference == pytest.approx(0.856, abs=1e-3)
    assert found.letters == ("a", "b", "c", "d")
    assert found.tied == (True, False, False, False)
    few = ranking_of({name: values[:5] for name, values in LADDER.items()})
    # On 5 maps it is 2.1: ranks 1 to 3, and 2 to 4, are not told apart.
    assert critical_difference(4, 5) == pytest.approx(2.098, abs=1e-3)
    assert few.letters == ("a", "ab", "ab", "b")
    assert few.tied == (True, True, True, False)


def test_the_ratio_has_no_spread_where_all_maps_agree():
    found = ranking_of(LADDER)
    for values in (found.ratio.ratio, found.ratio.low, found.ratio.high):
        np.testing.assert_allclose(values, [1.0, 2.0, 3.0, 4.0], rtol=1e-12)
    assert found.losses == ()
    assert sentence(found) == (
        "d has the best mean rank by RMSE, 1.00, and is first on 30 of 30 maps. The next, c "
        "(2.00), has 2.00 times the RMSE of d (geometric mean over maps, 95 % interval 2.00 to "
        "2.00)."
    )
    assert doubt(found) == ""


def test_doubt_names_those_that_are_not_told_apart():
    few = ranking_of({name: values[:5] for name, values in LADDER.items()})
    assert doubt(few).endswith("d is not told apart from c, b.")


def test_a_loss_names_who_is_better_and_by_how_much():
    errors = {name: values.copy() for name, values in LADDER.items()}
    errors["c"][3] = 0.5
    errors["b"][7] = 0.25
    found = ranking_of(errors, scenes=("vase", "teapot"))
    assert [(x.scene, x.environment, x.best, x.ratio) for x in found.losses] == [
        ("teapot", "map07", "b", 4.0), ("vase", "map07", "b", 4.0),
        ("teapot", "map03", "c", 2.0), ("vase", "map03", "c", 2.0),
    ]  # fmt: skip
    assert (found.firsts[0], found.cases, len(found.per_map)) == (MAPS - 2, 2 * MAPS, MAPS)
    result = results(rows_of(errors, scenes=("vase", "teapot")))[0]
    files = {(x.scene, x.environment): "page.html" for x in found.losses}
    shown = ranking_table(result, found, looks(list("abcd")), files)
    assert shown.rivals == "b on 2, c on 2"
    assert [loss["ratio"] for loss in shown.losses] == ["4.00", "4.00", "2.00", "2.00"]


def test_whiskers_lie_in_order_on_the_axis():
    rng = np.random.default_rng(3)
    errors = {name: values * rng.uniform(0.5, 2.0, MAPS) for name, values in LADDER.items()}
    result = results(rows_of(errors))[0]
    files = {(x.scene, x.environment): "" for x in result.rmse.losses}
    shown = ranking_table(result, result.rmse, looks(list("abcd")), files)
    for line in shown.lines:
        assert 0.0 <= line.whisker.low <= line.whisker.middle <= line.whisker.high <= 100.0
    ratios = result.rmse.ratio.ratio
    order = np.argsort(ratios, kind="stable")
    places = np.array([line.whisker.middle for line in shown.lines])[order]
    assert (np.diff(places) > 0).all()
    one = shown.ticks[0]
    assert one[1] == "1×"
    assert one[0] == shown.lines[0].whisker.middle


def test_errors_of_zero_everywhere_have_ranks_but_no_ratio():
    found = ranking_of({name: np.zeros(3) for name in "abc"})
    assert found.ratio is None
    assert found.tied == (True, True, True)
    assert found.friedman.p_value == 1.0
    assert remarks(found) == [
        "Friedman test that all 3 samplers are alike: χ² = 0.0, p = 1.",
        "Ratios leave out 3 maps on which a sampler has no error at all.",
    ]
    assert sentence(found) == (
        "a has the best mean rank by RMSE, 1.00, and is first on 3 of 3 maps."
    )


def test_a_run_without_a_complete_map_has_no_winner():
    rows = rows_of({"a": np.ones(2), "b": np.ones(2)})
    rows = rows[~((rows["sampler"] == "a") ^ (rows["environment"] == "map00"))]
    result = results(rows)[0]
    assert "nobody has won" in sentence(result.flip)
    assert math.isnan(result.flip.difference)
    shown = ranking_table(result, result.flip, looks(["a", "b"]), {})
    assert [line.error for line in shown.lines] == ["–", "–"]


SENTENCE = re.compile(
    r"(?P<first>[\w-]+) has the best mean rank by (RMSE|FLIP), (?P<rank>[\d.]+), and is first on "
    r"(?P<firsts>\d+) of (?P<maps>\d+) maps\. The next, (?P<second>[\w-]+) \((?P<next>[\d.]+)\), "
    r"has (?P<ratio>[\d.]+) times the (RMSE|FLIP) of (?P<base>[\w-]+) \(geometric mean over maps, "
    r"95 % interval (?P<low>[\d.]+) to (?P<high>[\d.]+)\)\."
)


@pytest.mark.parametrize("baseline", [True, False], ids=["with baseline", "without"])
@pytest.mark.parametrize("seed", range(20))
def test_the_sentence_says_what_the_rows_say(seed, baseline):
    """Read back from the sentence and computed from the rows in plain loops: the same figures."""
    rng = np.random.default_rng(seed)
    names = ["tmms", "mis", "ours", "fhis", *(["median-cut"] if baseline else [])]
    maps = int(rng.integers(3, 12))
    scale = rng.lognormal(0.0, 0.6, len(names))
    errors = {n: s * rng.lognormal(0.0, 0.4, maps) for n, s in zip(names, scale, strict=True)}
    said = SENTENCE.fullmatch(sentence(ranking_of(errors)))
    assert said is not None
    places = {
        name: [1 + sum(errors[other][k] < errors[name][k] for other in names) for k in range(maps)]
        for name in names
    }
    means = {name: sum(ranks) / maps for name, ranks in places.items()}
    first, second = said["first"], said["second"]
    assert sorted(means.values())[:2] == [means[first], means[second]]
    assert (said["rank"], said["next"]) == (f"{means[first]:.2f}", f"{means[second]:.2f}")
    assert (said["firsts"], said["maps"]) == (str(places[first].count(1)), str(maps))
    assert said["base"] == first
    ratios = [errors[second][k] / errors[first][k] for k in range(maps)]
    assert said["ratio"] == f"{statistics.geometric_mean(ratios):.2f}"
    assert min(ratios) - 5e-3 <= float(said["low"]) <= float(said["ratio"])
    assert float(said["ratio"]) <= float(said["high"]) <= max(ratios) + 5e-3


def test_a_single_sampler_is_reported():
    found = ranking_of({"only": np.ones(3)})
    assert sentence(found) == "only is the only sampler."
    assert found.letters == ("a",)
    assert dataclasses.replace(found).winner == "only"
