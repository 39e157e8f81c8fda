"""Two runs side by side: paired by measurement, changes found, chance not called a change."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from experiments.report.compare import (
    change_table,
    compare,
    compare_runs,
    headlines,
    holm,
    markdown,
    signed_rank,
)
from experiments.report.run_data import RunData
from samplers import EnvlightError

SESSION = {"processor": "one", "cores": 2, "threads": 2}


def run_of(name: str, maps: int = 12, seeds: int = 1, **factors: np.ndarray | float) -> RunData:
    """Two samplers; `factors` multiply a measure of "first", one per map or one for all."""
    rng = np.random.default_rng(7)
    rows = []
    for sampler in ("first", "second"):
        for k in range(maps):
            for seed in range(seeds):
                values = dict(
                    zip(("rmse", "flip", "seconds_render"), rng.random(3) + 0.1, strict=True)
                )
                if sampler == "first":
                    for measure, factor in factors.items():
                        values[measure] *= np.broadcast_to(factor, maps)[k]
                rows.append(
                    {"key": f"{sampler}{k}-{seed}", "scale": "quick", "scene": "vase",
                     "environment": f"map{k}", "budget": "lights=16", "sampler": sampler,
                     "seed": seed, "seconds_lights": 0.0, **values}
                )  # fmt: skip
    table = pd.DataFrame(rows)
    identities = {key: {"case": {"view": [4, 3, 1]}} for key in table["key"]}
    return RunData(Path(name), table, identities, len(table), [SESSION])


def by_name(found) -> dict[tuple[str, str], object]:
    return {(change.sampler, change.measure): change for change in found.changes}


def test_a_run_equals_itself():
    found = compare(run_of("a"), run_of("a"))
    assert found.measurements == 24
    for change in found.changes:
        assert (change.better, change.worse, change.equal) == (0, 0, 12)
        assert (change.ratio, change.p_value, change.verdict) == (1.0, 1.0, "equal")
    assert headlines(found) == ["No change that is not likely to be chance."]


def test_a_common_factor_is_found_exactly():
    found = by_name(compare(run_of("a"), run_of("b", rmse=1.25, flip=0.5, seconds_render=2.0)))
    worse, better, slower = (found["first", m] for m in ("rmse", "flip", "seconds"))
    assert worse.ratio == pytest.approx(1.25, rel=1e-12)
    assert better.ratio == pytest.approx(0.5, rel=1e-12)
    assert (worse.worse, better.better, slower.worse) == (12, 12, 12)
    assert (worse.verdict, better.verdict, slower.verdict) == ("worse", "better", "slower")
    # All of 12 signs agree: Wilcoxon's exact p is 2 / 2^12, doubled by Holm for two samplers.
    assert worse.p_value == pytest.approx(2 * 2 / 2**12, rel=1e-9)
    assert all(found["second", m].verdict == "equal" for m in ("rmse", "flip", "seconds"))


def test_swapping_the_runs_inverts_the_ratio():
    a, b = run_of("a"), run_of("b", rmse=np.linspace(0.8, 1.5, 12))
    forth, back = by_name(compare(a, b))["first", "rmse"], by_name(compare(b, a))["first", "rmse"]
    assert forth.ratio * back.ratio == pytest.approx(1.0, rel=1e-12)
    assert (forth.better, forth.worse) == (back.worse, back.better)
    assert forth.p_value == pytest.approx(back.p_value, rel=1e-12)


def test_balanced_changes_are_unclear():
    factors = np.exp(np.tile([0.1, -0.1], 6) * np.repeat(np.arange(1, 7), 2))
    change = by_name(compare(run_of("a"), run_of("b", rmse=factors)))["first", "rmse"]
    assert change.ratio == pytest.approx(1.0, abs=1e-12)
    assert (change.better, change.worse, change.verdict) == (6, 6, "unclear")


def test_only_shared_measurements_count():
    found = compare(run_of("a", maps=12), run_of("b", maps=5, seeds=2))
    assert (found.measurements, found.only_before, found.only_after) == (10, 14, 10)
    assert all(change.better + change.worse + change.equal == 5 for change in found.changes)


def test_runs_without_a_shared_measurement_are_refused():
    other = run_of("b")
    other.rows["budget"] = "lights=8"
    with pytest.raises(EnvlightError, match="share no measurement"):
        compare(run_of("a"), other)


def test_other_references_machines_and_gaps_are_noted():
    other = run_of("b")
    other.identities["first0-0"]["case"] = {"view": [8, 6, 1]}
    other = RunData(
        other.folder, other.rows, other.identities, other.planned + 3,
        [{**SESSION, "processor": "two"}],
    )  # fmt: skip
    notes = compare(run_of("a"), other).notes
    assert [
        any(word in note for note in notes) for word in ("cases", "machines", "3 measurements")
    ] == [True] * 3
    assert compare(run_of("a"), run_of("b")).notes == ()


def test_errors_of_zero_have_no_ratio_but_are_counted():
    change = by_name(compare(run_of("a", rmse=0.0), run_of("b")))["first", "rmse"]
    assert np.isnan(change.ratio)
    assert (change.worse, change.verdict) == (12, "unclear")


def test_holm_multiplies_the_smallest_most():
    corrected = holm(np.array([0.03, 0.01, 0.02, 0.9]))
    # 0.01 · 4, then 0.02 · 3, then 0.03 · 2 = 0.06, 0.9 · 1.
    assert corrected == pytest.approx([0.06, 0.04, 0.06, 0.9])
    assert holm(np.array([0.5, 0.6])).max() == 1.0


def test_signed_rank_is_the_exact_test_for_few_cases():
    assert signed_rank(np.array([1.0, 2.0, 3.0, 4.0, 5.0])) == pytest.approx(2 / 2**5)
    assert signed_rank(np.zeros(4)) == 1.0


def test_markdown_holds_the_table_and_the_findings():
    a, b = run_of("a"), run_of("b", flip=1.5)
    found = compare(a, b)
    text = markdown(a, b, found)
    assert "first: FLIP worse, +50.0 %" in text
    lines = [line for line in text.splitlines() if line.startswith("|")][2:]
    measurements = [
        [measurement.strip() for measurement in line.strip("|").split("|")] for line in lines
    ]
    assert measurements == change_table(found).to_numpy().tolist()


def test_the_command_reads_run_folders(finished, tmp_path, capsys):
    compare_runs(finished, finished, tmp_path / "change.md")
    assert "equal" in capsys.readouterr().out
    assert "25 measurements are in both runs" in (tmp_path / "change.md").read_text(
        encoding="utf-8"
    )


def test_nothing_is_cut_in_a_file(finished, capsys):
    compare_runs(finished, finished, None)
    assert "…" not in capsys.readouterr().out
