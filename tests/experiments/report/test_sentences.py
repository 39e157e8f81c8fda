"""Every sentence about a ranking says what the rows say: read back, and computed in plain loops.

Errors are random, some equal, some near their floor. What is computed here shares no code with what
is tested: ranks are counted, ratios multiplied, p-values enumerated, intervals drawn anew.
"""

import itertools
import math
import random
import re
import statistics
from dataclasses import dataclass

import numpy as np
import pytest

from experiments.report import rankings
from experiments.report.parts import listed
from experiments.report.rankings import Ranking
from experiments.report.style import label_of
from tests.experiments.report.ranking_rows import ranking_of

NAMES = ("tmms", "mis", "ours", "fhis", "median-cut")
SCENES = ("vase", "teapot")
NUMBER = r"[\d.e+-]+?"
AGAINST = (
    r"wins (?P<wins>\d+), ties (?P<ties>\d+), loses (?P<losses>\d+), "
    rf"ratio (?P<ratio>{NUMBER}) \[(?P<low>{NUMBER}), (?P<high>{NUMBER})\], p = (?P<p>{NUMBER})"
)
VERDICT = re.compile(
    rf"(?P<test>[^.]*?(\(p is at least {NUMBER}\))?)\. (?P<first>[^.]+) (has|share) the least mean "
    rf"rank, (?P<rank>{NUMBER}); against the next, (?P<second>[\w-]+) \((?P<next>{NUMBER})\): "
    rf"{AGAINST}\.(?P<limits> .*)?"
)


def verdict(ranking: Ranking) -> str:
    """The verdict with names instead of labels."""
    said = rankings.verdict(ranking)
    assert not any(label_of(name) != name and name in said.split() for name in ranking.samplers)
    for name in ranking.samplers:
        said = said.replace(label_of(name), name)
    return said


@dataclass(frozen=True)
class Made:
    """Errors by sampler and map of one scene, their floors by map, and the ranking of the rows."""

    errors: dict[str, list[float]]
    floors: list[float]
    ranking: Ranking

    @property
    def maps(self) -> range:
        return range(len(self.floors))

    def counted(self, name: str) -> list[float]:
        """A sampler's errors by map as they are ranked: means over the scenes, or 3 floors."""
        means = [1.5 * error for error in self.errors[name]]  # scenes have 1 and 2 times the error
        return [max(e, 3.0 * f) for e, f in zip(means, self.floors, strict=True)]

    def ranks(self, name: str) -> list[int]:
        mine = self.counted(name)
        rest = [self.counted(other) for other in self.errors]
        return [1 + sum(theirs[k] < mine[k] for theirs in rest) for k in self.maps]

    def mean_rank(self, name: str) -> float:
        return sum(self.ranks(name)) / len(self.floors)


@pytest.fixture(scope="module", params=range(12))
def made(request) -> Made:
    rng = np.random.default_rng(request.param)
    maps = int(rng.integers(5, 10))
    names = NAMES if request.param % 2 else NAMES[:-1]  # with the baseline and without
    scale = rng.lognormal(0.0, 0.5, len(names))
    errors = {n: list(s * rng.lognormal(0.0, 0.4, maps)) for n, s in zip(names, scale, strict=True)}
    if request.param % 3 == 0:
        errors["mis"][0] = errors["ours"][0]
    near = (0.0, 0.2, 0.4)[request.param % 3]
    floors = list(near * rng.lognormal(0.0, 0.3, maps) + 1e-12)
    return Made(errors, floors, ranking_of(errors, scenes=SCENES, floor=floors))


def exact_p(differences: list[float]) -> float:
    """Wilcoxon's two-sided p-value, over all signs of the differences that are not zero."""
    changed = [d for d in differences if d != 0.0]
    sizes = [abs(d) for d in changed]
    ranks = [sum(s < size for s in sizes) + 0.5 * (sizes.count(size) + 1) for size in sizes]
    total = sum(ranks)
    seen = abs(sum(r for r, d in zip(ranks, changed, strict=True) if d > 0) - total / 2)
    sums = (
        sum(r for r, sign in zip(ranks, signs, strict=True) if sign)
        for signs in itertools.product((0, 1), repeat=len(ranks))
    )
    far = [abs(found - total / 2) >= seen - 1e-9 for found in sums]
    return sum(far) / len(far)


def corrected_p(made: Made) -> dict[frozenset[str], float]:
    """p-values of all pairs, the k-th smallest of n times n + 1 - k, never falling."""
    found = {
        frozenset(pair): exact_p(
            [math.log(a / b) for a, b in zip(*map(made.counted, pair), strict=True)]
        )
        for pair in itertools.combinations(made.errors, 2)
    }
    largest, corrected = 0.0, {}
    for k, pair in enumerate(sorted(found, key=found.__getitem__)):
        largest = max(largest, min(1.0, found[pair] * (len(found) - k)))
        corrected[pair] = largest
    return corrected


def check_pair(said: re.Match, made: Made, one: str, other: str) -> None:
    """What a sentence says of one sampler against another."""
    mine, theirs = made.counted(one), made.counted(other)
    assert said["wins"] == str(sum(a < b for a, b in zip(mine, theirs, strict=True)))
    assert said["ties"] == str(sum(a == b for a, b in zip(mine, theirs, strict=True)))
    assert said["losses"] == str(sum(a > b for a, b in zip(mine, theirs, strict=True)))
    ratios = [a / b for a, b in zip(mine, theirs, strict=True)]
    # Two decimals are printed.
    assert float(said["ratio"]) == pytest.approx(statistics.geometric_mean(ratios), abs=0.0051)
    # Two digits are printed: half a unit of the second is at most 5 %.
    assert float(said["p"]) == pytest.approx(corrected_p(made)[frozenset((one, other))], rel=0.051)
    logs, draw = [math.log(r) for r in ratios], random.Random(0)
    means = sorted(statistics.fmean(draw.choices(logs, k=len(logs))) for _ in range(2000))
    # A 2.5 % quantile of n draws of a normal has a standard error of √(.025 · .975 / n) / .0584 of
    # its width: 6 % for 2000 draws, 2.7 % for 10⁴, together 6.6 %; 4.5 times that are 0.3. The few
    # logarithms make the distribution a staircase, which adds at most one step of their range.
    width = 0.3 * statistics.pstdev(logs) / math.sqrt(len(logs))
    step = (max(logs) - min(logs)) / len(logs) / 4
    for name, place in (("low", 50), ("high", 1949)):
        expected = means[place]
        low, high = (math.exp(expected + sign * (width + step)) for sign in (-1, 1))
        assert low - 0.0051 <= float(said[name]) <= high + 0.0051
    assert float(said["low"]) <= float(said["ratio"]) <= float(said["high"])


def test_the_verdict_says_who_is_first_and_how_the_next_compares(made: Made):
    means = {name: made.mean_rank(name) for name in made.errors}
    first, second = sorted(set(means.values()))[:2]
    said = VERDICT.fullmatch(verdict(made.ranking))
    assert said is not None, verdict(made.ranking)
    assert set(re.split(r", | and ", said["first"])) == {n for n in means if means[n] == first}
    assert (said["rank"], said["next"]) == (f"{first:.2f}", f"{second:.2f}")
    assert means[said["second"]] == second
    check_pair(said, made, made.ranking.samplers[0], said["second"])


def test_the_verdict_says_from_whom_the_first_is_not_significantly_different(made: Made):
    first, *rest = made.ranking.samplers
    p = corrected_p(made)
    alike = [name for name in rest if p[frozenset((first, name))] > 0.05]
    text = VERDICT.fullmatch(verdict(made.ranking))["test"]
    count, maps = len(made.errors), len(made.floors)
    surest = min(1.0, math.comb(count, 2) / 2 ** (maps - 1))
    if len(alike) == len(rest) and surest > 0.05:
        assert text == f"{maps} maps are too few for a significant difference by FLIP among " + (
            f"{count} samplers (p is at least {surest:.2g})"
        )
        assert min(p.values()) >= 0.99 * surest
    elif alike:
        tied = listed([first, *alike])
        assert text == f"{tied} tie for first by FLIP over {maps} maps: no significant difference"
    else:
        said = f"{first} is first by FLIP over {maps} maps, significantly different from all others"
        assert text == said


def test_the_verdict_counts_what_ties_at_the_noise_floor(made: Made):
    near = sum(
        1.5 * errors[k] < 3.0 * made.floors[k] for errors in made.errors.values() for k in made.maps
    )
    size = len(made.errors) * len(made.floors)
    said = f" {near} of {size} errors lie within 3× of the noise floor and tie there."
    limits = VERDICT.fullmatch(verdict(made.ranking))["limits"]
    assert limits == (said if near else None)


def test_names_are_listed_up_to_four():
    assert listed(["a"]) == "a"
    assert listed(["a", "b"]) == "a and b"
    assert listed(["a", "b", "c", "d"]) == "a, b, c and d"
    assert listed(list("abcdef")) == "a, b, c, d and 2 more"


def test_where_all_are_equal_nobody_is_first():
    found = ranking_of({name: [1.0, 2.0] for name in "abc"})
    assert verdict(found) == "By FLIP, all 3 samplers tie at the mean rank 1.00."
    near = ranking_of({"a": [0.1, 0.2], "b": [0.2, 0.1]}, floor=1.0)
    assert verdict(near) == (
        "By FLIP, all 2 samplers tie at the mean rank 1.00. 4 of 4 errors lie within 3× of the "
        "noise floor and tie there."
    )


def test_one_map_has_neither_an_interval_nor_a_test():
    found = ranking_of({"a": [1.0], "b": [3.0]})
    assert verdict(found) == (
        "1 map is too few for a significant difference by FLIP among 2 samplers (p is at least 1). "
        "a has the least mean rank, 1.00; against the next, b (2.00): wins 1, ties 0, loses 0, "
        "ratio 0.33, p = 1."
    )


def test_without_a_map_or_a_rival_there_is_nothing_to_say():
    assert verdict(ranking_of({"only": [1.0, 2.0, 3.0]})) == "only is the only sampler."
