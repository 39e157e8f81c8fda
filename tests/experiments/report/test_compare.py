"""Two runs side by side: what agrees and how far, what differs, and chance not called a change."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import f

from experiments.report.changes import changes, headlines
from experiments.report.compare import (
    CLOSE,
    GRID,
    PARTIAL,
    agreement_table,
    compare,
    compare_runs,
    differing,
    sentences,
)
from experiments.report.publish import publish
from experiments.report.seed_noise import pooled
from experiments.run.loaded_run import ROWS, Run
from metrics.registry import ranked_metrics
from samplers import EnvlightError

NAMES = [metric.name for metric in ranked_metrics()]
LABELS = {metric.name: metric.label for metric in ranked_metrics()}
MACHINE = {
    "processor": "one", "cores": 2, "threads": 2, "system": "s", "python": "3", "commit": "a",
    "versions": {"numpy": "1"},
}  # fmt: skip


def run_of(
    maps: int = 12, seeds: int = 1, start: int = 0, machine: dict | None = None,
    budget: str = "lights=16", **factors: np.ndarray | float,
) -> Run:  # fmt: skip
    """Two samplers; `factors` multiply a column of "first", one per map or one for all.

    start : of the random numbers of the seeds, whose errors are normal with a spread of a tenth"""
    rows = []
    for sampler in ("first", "second"):
        for k in range(maps):
            means = np.random.default_rng(k).random(len(NAMES)) * 0.3 + 0.15
            for seed in range(seeds):
                rng = np.random.default_rng([start, k, seed])
                noise = 1.0 + 0.1 * rng.standard_normal(len(NAMES)) if seeds > 1 else 1.0
                row = {
                    "key": f"{sampler}{k}-{seed}-{start}", "scale": "quick", "scene": "vase",
                    "environment": f"map{k}", "budget": budget, "sampler": sampler, "seed": seed,
                    "seconds_lights": 0.0, "seconds_render": 1.0, "gaps": np.nan if k else True,
                    **dict(zip(NAMES, means * noise, strict=True)),
                }  # fmt: skip
                if sampler == "first":
                    for name, factor in factors.items():
                        row[name] *= np.broadcast_to(factor, maps)[k]
                rows.append(row)
    record = {"scale": {"name": "quick"}, "machine": {**MACHINE, **(machine or {})}}
    return Run(Path("runs"), pd.DataFrame(rows), record)


def kinds(first: Run, second: Run) -> dict[str, int]:
    return compare(first, second).rows["kind"].value_counts().to_dict()


@pytest.mark.parametrize("name", NAMES)
def test_a_last_digit_is_no_longer_the_same_and_a_percent_differs(name):
    assert kinds(run_of(), run_of(**{name: 1.0 + 1e-15})) == {"same": 12, "close": 12}
    assert kinds(run_of(), run_of(**{name: 1.0 + 0.9 * CLOSE})) == {"same": 12, "close": 12}
    found = compare(run_of(), run_of(**{name: 1.01}))
    assert found.rows["kind"].value_counts().to_dict() == {"same": 12, "differs": 12}
    assert not found.reproduced
    table = agreement_table(found).rows.set_index("sampler")
    assert table["differs"].to_dict() == {"first": 12, "second": 0}
    assert table["of"]["first"] == LABELS[name]
    assert table["largest"]["first"] == pytest.approx(0.01 / 1.01)
    assert sentences(found)[-1] == "Not reproduced."


def test_other_seeds_of_the_same_distribution_are_explained_and_another_mean_is_not():
    first, again = run_of(seeds=4), run_of(seeds=4, start=1)
    # Tests of each kind at 1 % together: another start would fail twice in a hundred.
    assert set(kinds(first, again)) == {"within seeds"}
    # Half as much again is hidden in four seeds of a case, but not where all of 12 cases have it:
    # 2 / 2^12 is less than 1 % over two samplers and the metrics.
    moved = kinds(first, run_of(seeds=4, start=1, **{NAMES[0]: 1.5}))
    assert moved == {"differs": 4 * 12, "within seeds": 4 * 12}


def test_images_in_a_time_are_not_judged():
    found = compare(run_of(budget="seconds=4"), run_of(budget="seconds=4", **{NAMES[0]: 2.0}))
    assert found.rows["kind"].eq("timed").all()
    assert (found.reproduced, found.status) == (False, PARTIAL)
    assert any("are not judged" in sentence for sentence in sentences(found))
    assert sentences(found)[-1] == "0 of 24 compared: partial."


@pytest.mark.parametrize(
    ("first", "second", "of"), [(12, 5, "10 of 24 and 10 of 10"), (5, 12, "10 of 10 and 10 of 24")]
)
def test_what_is_not_compared_is_not_called_reproduced(first, second, of):
    runs = run_of(maps=first), run_of(maps=second)
    found = compare(*runs)
    assert len(found.rows) == 10
    assert {found.only_first, found.only_second} == {0, 14}
    assert sentences(found)[-1] == f"{of} compared, all equal: partial."
    assert (found.reproduced, found.status) == (False, PARTIAL)
    runs[1].rows.loc[0, NAMES[0]] *= 1.0 + 0.5 * CLOSE
    assert sentences(compare(*runs))[-1] == f"{of} compared, none differs: partial."
    runs[1].rows.loc[0, NAMES[0]] *= 2.0
    assert (compare(*runs).status, sentences(compare(*runs))[-1]) == (1, "Not reproduced.")


def test_rows_that_stand_twice_are_not_compared():
    run = run_of()
    twice = Run(run.folder, pd.concat([run.rows, run.rows[:1]], ignore_index=True), run.record)
    assert sentences(compare(twice, run))[-1].startswith("24 of 25 and 24 of 24 compared")


def test_runs_without_a_shared_metric_are_refused():
    run = run_of()
    bare = Run(run.folder, run.rows.drop(columns=NAMES), run.record)
    with pytest.raises(EnvlightError, match="no value in common"):
        compare(bare, run_of())


SPREAD, SEEDS, MAPS = 0.1, 3, 20
FACTORS = (0.5, 0.9, 0.99, 1.01, 1.1, 1.5, 2, 5, 10, 100)
IMPOSSIBLE: dict[str, Callable] = {
    "sign": lambda x: -x,
    "NaN": lambda x: x * np.nan,
    "inf": lambda x: x + np.inf,
}
CHANGES = {f"times {k:g}": lambda x, k=k: k * x for k in FACTORS} | IMPOSSIBLE


def changed_in(run: Run, which: str, change: Callable) -> Run:
    """A run with one metric of "first" changed in one map: in its first seed, or in all."""
    rows = run.rows.copy()
    chosen = (rows["sampler"] == "first") & (rows["environment"] == "map7")
    if which == "one seed":
        chosen &= rows["seed"] == 0
    rows.loc[chosen, NAMES[0]] = change(rows.loc[chosen, NAMES[0]])
    return Run(run.folder, rows, run.record)


@pytest.mark.parametrize("which", ["one seed", "all seeds"])
@pytest.mark.parametrize("change", CHANGES)
def test_no_change_of_a_row_is_missed_where_the_same_random_numbers_were_drawn(which, change):
    """The other seeds, or the other cases, agree to the last digit: so must all."""
    run = run_of(maps=MAPS, seeds=SEEDS)
    changed = changed_in(run, which, CHANGES[change])
    for pair in ((run, changed), (changed, run)):
        found = compare(*pair)
        count = 1 if which == "one seed" else SEEDS
        assert (found.rows["kind"] == "differs").sum() == count and found.status == 1


@pytest.mark.parametrize("other", ["map7", "map3"])
def test_swapped_rows_are_found(other):
    """Of two seeds of a case, or of one seed of two cases."""
    run = run_of(maps=MAPS, seeds=SEEDS)
    rows = run.rows.copy()
    first = rows[rows["sampler"] == "first"].set_index(["environment", "seed"])["key"]
    keys = [first["map7", 0], first[other, 0 if other == "map3" else 1]]
    places = [int(rows.index[rows["key"] == key][0]) for key in keys]
    rows.loc[places, NAMES] = rows.loc[places[::-1], NAMES].to_numpy()
    assert (compare(run, Run(run.folder, rows, run.record)).rows["kind"] == "differs").sum() == 2


def least_found(which: str) -> float:
    """The least relative change of a value that other random numbers cannot hide.

    All cases are in doubt, so a test of one is made at 1 % over all of them, both samplers, the
    metrics and three tests; the pool is taken to have 8 degrees of freedom besides the case's own.
    One seed of n that is off by x has that run's variance be x² / n, and F says when it is too
    large; all seeds have their means be x apart. The case's own draws may lie against the change
    by three deviations."""
    level = 0.01 / (3 * len(NAMES) * 2 * MAPS)
    if which == "one seed":
        least = SPREAD * np.sqrt(SEEDS * f.isf(level, SEEDS - 1, 8 + SEEDS - 1))
    else:
        least = SPREAD * np.sqrt(2 / SEEDS * f.isf(level, 1, 8 + 2 * (SEEDS - 1)))
    return least + 3.0 * SPREAD


@pytest.mark.parametrize("which", ["one seed", "all seeds"])
@pytest.mark.parametrize("start", [1, 2, 3])
def test_what_noise_does_not_explain_is_found_among_other_random_numbers(which, start):
    first, again = (run_of(maps=MAPS, seeds=SEEDS, start=one) for one in (0, start))
    assert "differs" not in kinds(first, again)
    must = [factor for factor in FACTORS if abs(factor - 1.0) > least_found(which)]
    assert must[-3:] == [5, 10, 100] and 0.99 not in must
    for change in (*(CHANGES[f"times {factor:g}"] for factor in must), *IMPOSSIBLE.values()):
        found = compare(first, changed_in(again, which, change))
        bad = found.rows[found.rows["kind"] == "differs"]
        assert set(bad["environment"]) == {"map7"} and set(bad["sampler"]) == {"first"}


LEFT_OPEN = {
    *GRID,  # by which others are told
    "seconds_lights", "seconds_render", "peak_memory_mib", "machine",
}  # fmt: skip
RENAMED = ("key", "reference")


@pytest.mark.parametrize("programs", ["same", "other"])
def test_a_change_is_found_in_any_column(finished, programs):
    """Of one row of each sampler. Programs that compute the same have other hashes alone."""
    first, again = Run.load(finished), Run.load(finished)
    if programs == "other":
        for name in RENAMED:
            again.rows[name] = "other" + again.rows[name]
    assert compare(first, again).reproduced
    missed = []
    for name in set(first.rows) - LEFT_OPEN - ({"key"} if programs == "other" else set()):
        for place in first.rows.index[~first.rows["sampler"].duplicated()]:
            rows = again.rows.astype({name: object})
            old = rows.loc[place, name]
            number = isinstance(old, (int, float))
            other = min(1.01 * old + 1.0, 1e9) if number else f"{old}x"
            rows.loc[place, name] = not old if first.rows[name].dtype == bool else other
            changed = rows.astype({name: again.rows[name].dtype})
            if not compare(first, Run(again.folder, changed, again.record)).differs:
                missed.append((name, place))
    assert missed == []


@pytest.mark.parametrize("over", ["environment", "seed"])
def test_exchanged_errors_of_equal_keys_are_found(over):
    """All of a sampler's, backwards over maps or seeds: no row of it is as it was."""
    run = run_of(maps=MAPS, seeds=4)
    rows = run.rows.copy()
    for _, places in rows.groupby(["sampler", "seed" if over == "environment" else "environment"]):
        if places["sampler"].iloc[0] == "first":
            rows.loc[places.index, NAMES] = places[NAMES].to_numpy()[::-1]
    found = compare(run, Run(run.folder, rows, run.record)).rows
    assert (found["kind"] == "differs").to_numpy().tolist() == (
        found["sampler"] == "first"
    ).tolist()


def test_an_error_beyond_what_the_metric_can_have_is_found_among_other_random_numbers():
    """FLIP ends at 1, which its noise alone would let it pass."""
    first, again = (run_of(maps=MAPS, seeds=SEEDS, start=one) for one in (0, 1))
    for run in (first, again):
        run.rows["flip"] *= 1.6
    top = again.rows["flip"].idxmax()
    assert 0.6 < again.rows.loc[top, "flip"] < 1.0
    assert "differs" not in kinds(first, again)
    again.rows.loc[top, "flip"] = 1.0 + 1e-9
    assert "differs" in kinds(first, again)


def test_what_lies_near_the_floor_is_as_noisy_as_the_floor_allows():
    """Errors of 0 and near it, of which the references' noise was taken off, are no difference."""
    first, again = (run_of(maps=MAPS, seeds=SEEDS, start=one) for one in (0, 1))
    for run in (first, again):
        run.rows[f"{NAMES[0]}_floor"] = 0.01
    chosen = (again.rows["sampler"] == "first") & (again.rows["environment"] == "map7")
    first.rows.loc[chosen, NAMES[0]] = [0.0, 0.0, 0.0]
    again.rows.loc[chosen, NAMES[0]] = [0.0, 0.004, 0.02]
    assert "differs" not in kinds(first, again)
    again.rows.loc[chosen, NAMES[0]] = [0.0, 0.004, 0.2]
    assert "differs" in kinds(first, again)


@pytest.mark.parametrize("spread", [0.0, 0.5])
def test_a_pool_knows_scale_and_likeness_of_variances(spread):
    """Of 4000 variances of two degrees whose logarithms are spread by less or more than chance."""
    rng = np.random.default_rng(3)
    true = 0.04 * np.exp(spread * rng.standard_normal(4000))
    noise = pooled(true * rng.chisquare(2, 4000) / 2, np.full(4000, 2.0))
    # Quantiles of 4000 up to 97 % are within 5 % of the true ones: that turns infinite degrees of
    # freedom into 32 at the worst. A logarithm's variance of 0.25 is that of F with infinite and
    # some 8 degrees, as trigamma(4) = 0.28, and those that are tried are powers of two; the scale
    # of such an F is the harmonic mean of the variances, exp(-0.25 / 2) of the middle one.
    assert noise.variance == pytest.approx(0.04 * np.exp(-0.5 * spread**2), rel=0.1)
    assert noise.degrees >= 32 if spread == 0.0 else 4 <= noise.degrees <= 16


def test_runs_without_a_shared_measurement_are_refused():
    with pytest.raises(EnvlightError, match="share no measurement"):
        compare(run_of(), run_of(budget="lights=8"))
    with pytest.raises(EnvlightError, match="of different experiments"):
        compare(run_of(), study_of())
    untold = Run(Path("study"), pd.DataFrame({"points": [1]}), {"machine": MACHINE})
    with pytest.raises(EnvlightError, match="does not say which columns"):
        compare(untold, study_of())


def study_of(**changed: float) -> Run:
    """Two tables of a study in one file: the keys of either are missing in the other's rows."""
    rows = pd.DataFrame({
        "table": ["images", "images", "lights"], "scene": ["vase", "teapot", None],
        "method": ["a", "b", "a"], "count": [8, 8, 16],
        "flip": [0.1, 0.2, np.nan], "energy": [np.nan, np.nan, 1.0],
        "seconds_lights": [1.0, 2.0, 3.0], "load_average": [0.5, 0.5, 0.5],
    })  # fmt: skip
    for name, value in changed.items():
        rows.loc[0, name] = value
    record = {"machine": MACHINE, "keys": ["table", "scene", "method", "count"]}
    return Run(Path("study"), rows, record)


def test_rows_of_studies_are_paired_by_their_own_keys():
    assert kinds(study_of(), study_of()) == {"same": 3}
    # Times and load are the machine's.
    assert kinds(study_of(), study_of(seconds_lights=9.0, load_average=2.0)) == {"same": 3}
    found = compare(study_of(), study_of(flip=0.15))
    assert found.rows["kind"].value_counts().to_dict() == {"same": 2, "differs": 1}
    assert not found.reproduced
    assert "images · vase · a · 8: flip differs by 0.33 of the larger." in sentences(found)
    counted = agreement_table(found).rows.set_index("method")[["same", "differs"]]
    assert counted.to_numpy().tolist() == [[1, 1], [1, 0]]
    # Another key is another measurement.
    found = compare(study_of(), study_of(count=9))
    assert (len(found.rows), found.only_first, found.only_second) == (2, 1, 1)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"commit": "b"}, "commit"), ({"processor": "two"}, "machine"), ({"python": "4"}, "Python"),
        ({"versions": {"numpy": "2"}}, "numpy"), ({"versions": {"numpy": "1", "x": "1"}}, "x"),
    ],
)  # fmt: skip
def test_what_determines_a_result_and_differs_is_named(change, name):
    assert list(differing(run_of(), run_of(machine=change))) == [name]
    found = compare(run_of(), run_of(machine=change))
    assert found.reproduced
    assert any(f"They differ in {name}: " in sentence for sentence in sentences(found))


def by_name(first: Run, second: Run) -> dict[tuple[str, str], object]:
    found = changes(first.rows, second.rows).itertuples()
    return {(one.sampler, one.measure): one for one in found}


def test_a_common_factor_is_found_exactly():
    lead, other = NAMES[-1], NAMES[0]
    found = by_name(run_of(), run_of(**{other: 1.25, lead: 0.5, "seconds_render": 2.0}))
    worse, better = (found["first", LABELS[name]] for name in (other, lead))
    slower = found["first", "seconds"]
    assert worse.ratio == pytest.approx(1.25, rel=1e-12)
    assert better.ratio == pytest.approx(0.5, rel=1e-12)
    assert (worse.low, worse.high) == pytest.approx((1.25, 1.25), rel=1e-12)
    assert (worse.worse, better.better, slower.worse) == (12, 12, 12)
    assert (worse.verdict, better.verdict, slower.verdict) == ("worse", "better", "slower")
    # All of 12 signs agree: Wilcoxon's exact p is 2 / 2^12, doubled by Holm for two samplers.
    assert worse.p_value == pytest.approx(2 * 2 / 2**12, rel=1e-9)
    assert {one.verdict for (name, _), one in found.items() if name == "second"} == {"equal"}


def test_errors_of_zero_have_no_ratio_but_are_counted():
    change = by_name(run_of(**{NAMES[0]: 0.0}), run_of())["first", LABELS[NAMES[0]]]
    assert np.isnan(change.ratio)
    assert (change.worse, change.verdict) == (12, "unclear")


def test_headlines_say_what_the_table_does():
    found = changes(run_of().rows, run_of(**{NAMES[-1]: 1.5}).rows)
    assert headlines(found) == [
        f"first: {LABELS[NAMES[-1]]} worse, +50.0 % (smaller on 0, larger on 12 cases, p = 0.00098)"
    ]
    assert headlines(changes(run_of().rows, run_of().rows)) == [
        "No change that is not likely to be chance."
    ]


def test_a_published_folder_agrees_with_its_run(finished, tmp_path):
    publish(finished, tmp_path / "p")
    said, status = compare_runs(finished, tmp_path / "p")
    assert "25 measurements are in both: 25 agree to the last digit" in said and "…" not in said
    changed, better = compare_runs(finished, tmp_path / "p", better=True)
    assert "second / first" in changed and "1.000" in changed and "in both" not in changed
    assert (status, better) == (0, 0)


def test_the_command_fails_where_a_row_was_changed(copied, finished):
    rows = pd.read_csv(copied / ROWS, dtype=str)
    rows.loc[rows["environment"] == "sun", NAMES[0]] = "0.5"
    rows.to_csv(copied / ROWS, index=False)
    command = [sys.executable, "-m", "experiments.cli.main", "compare", str(copied), str(finished)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1, done.stderr
    assert "Not reproduced." in done.stdout
    assert "three-boxes · sun · median-cut · lights" in done.stdout
