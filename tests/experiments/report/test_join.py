"""Parts of a grid that were measured apart are, once joined, the grid."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
import pytest

from experiments.report.join import join
from experiments.run.loaded_run import Run, write_run
from samplers import EnvlightError

if TYPE_CHECKING:
    from collections.abc import Callable

WHOLE = Path(__file__).parents[3] / "results" / "table1-quick"


@pytest.fixture(scope="module")
def whole() -> Run:
    return Run.load(WHOLE)


@pytest.fixture
def part(tmp_path: Path, whole: Run) -> Callable[..., Path]:
    """Writes rows of the whole as a run of its own; `machine` and others replace facts."""

    def write(
        name: str, rows: pd.Series, machine: dict[str, Any] | None = None, **facts: Any
    ) -> Path:
        folder, record = tmp_path / name, dict(whole.record)
        folder.mkdir()
        record["machine"] = {**record["machine"], "command": f"envlight {name}", **(machine or {})}
        chosen = whole.rows[rows]
        write_run(folder, chosen, {**record, "planned": len(chosen), **facts})
        return folder

    return write


def in_half(run: Run) -> pd.Series:
    """Whether a row is of the first half of the maps, by name."""
    maps = sorted(run.rows["environment"].unique())
    return run.rows["environment"].isin(maps[: len(maps) // 2])


def test_parts_by_map_are_the_whole(tmp_path, part, whole):
    first = in_half(whole)
    parts = [part("late", ~first), part("early", first, {"commit": "0123456789ab"})]
    join(parts, tmp_path / "joined")
    joined = Run.load(tmp_path / "joined")
    pd.testing.assert_frame_equal(joined.rows, whole.rows)
    for name in ("experiment", "scale", "samplers", "budgets", "planned", "missing", "bad_maps"):
        assert joined.record[name] == whole.record[name], name

    report = (tmp_path / "joined" / "report.md").read_text(encoding="utf-8")
    # Bias and variance are found in images, which are not there.
    text, found, _ = (WHOLE / "report.md").read_text(encoding="utf-8").partition("## Bias and")
    assert found and report.startswith(text)
    commits = [whole.record["machine"]["commit"], "0123456789ab"]
    late, early = map("{} rows: commit {};".format, [(~first).sum(), first.sum()], commits)
    assert f", {late} {early} `run.json` has their commands." in report


def test_a_join_is_a_part_of_another(tmp_path, part, whole):
    first, last = in_half(whole), whole.rows["sampler"] == "ours"
    inner = [part("one", first & ~last), part("two", ~first & ~last)]
    join(inner, tmp_path / "inner")
    join([tmp_path / "inner", part("three", last)], tmp_path / "joined")
    joined = Run.load(tmp_path / "joined")
    pd.testing.assert_frame_equal(joined.rows, whole.rows)
    names = [one["command"] for one in joined.record["parts"]]
    assert names == ["envlight one", "envlight two", "envlight three"]
    assert joined.record["missing"] == {}


def test_a_join_is_made_anew_and_nothing_else_is_replaced(tmp_path, part, whole):
    parts = [part("one", in_half(whole)), part("two", ~in_half(whole))]
    first = [file.read_bytes() for file in join(parts, tmp_path / "joined")]
    assert [file.read_bytes() for file in join(parts, tmp_path / "joined")] == first
    with pytest.raises(EnvlightError, match="holds something that was not joined"):
        join(parts, parts[0])
    with pytest.raises(EnvlightError, match="which this command reads, is there"):
        join([tmp_path / "joined", part("three", whole.rows["sampler"] == "")], tmp_path / "joined")


def test_what_one_part_does_not_have_is_told(tmp_path, part, whole):
    half, ours = in_half(whole), whole.rows["sampler"] == "ours"
    join([part("one", half), part("two", ~half & ~ours)], tmp_path / "joined")
    missing = Run.load(tmp_path / "joined").record["missing"]
    rows = whole.rows[~half & ours]
    assert missing == {"ours": list((rows["scene"] + " · " + rows["environment"]).unique())}
    report = (tmp_path / "joined" / "report.md").read_text(encoding="utf-8")
    assert "Results are missing:" in report and "Ours (Wu 2025): vase · " in report


@pytest.mark.parametrize(
    ("machine", "facts", "message"),
    [
        ({"methods": "0" * 24}, {}, "differ in samplers, renderer or metrics"),
        ({"versions": {"numpy": "1.0"}}, {}, "differ in libraries"),
        ({}, {"experiment": "table2"}, r"differ in experiment \(table1; table2\)"),
        ({}, {"scale": {"name": "quick"}}, "differ in scale"),
    ],
)
def test_parts_that_were_not_measured_alike_are_refused(
    tmp_path, part, whole, machine, facts, message
):
    half = in_half(whole)
    parts = [part("one", half), part("two", ~half, machine, **facts)]
    with pytest.raises(EnvlightError, match=message):
        join(parts, tmp_path / "joined")
    assert not (tmp_path / "joined").exists()


def test_times_of_two_machines_are_refused_in_a_case(tmp_path, part, whole):
    """Cases of their own are ranked by what one machine timed."""

    timed = {"budget": "seconds=4", "load_average": 1.0, "spread": 0.0}

    def halves(name, first):
        parts = [part(f"{name}-a", first), part(f"{name}-b", ~first)]
        for one, machine in zip(parts, ("this", "another"), strict=True):
            run = Run.load(one)
            write_run(one, run.rows.assign(**timed, machine=machine), run.record)
        return parts

    join(halves("maps", in_half(whole)), tmp_path / "joined")
    with pytest.raises(EnvlightError, match=r"differ in the machine that timed vase · "):
        join(halves("samplers", whole.rows["sampler"] == "ours"), tmp_path / "other")


def test_errors_to_two_references_are_refused(tmp_path, part, whole):
    ours = whole.rows["sampler"] == "ours"
    parts = [part("one", ours), part("two", ~ours)]
    rows = Run.load(parts[1]).rows
    rows.loc[rows.index[-1], "reference"] = "0" * 24
    write_run(parts[1], rows, json.loads((parts[1] / "run.json").read_text(encoding="utf-8")))
    with pytest.raises(EnvlightError, match=r"differ in the reference of vase · "):
        join(parts, tmp_path / "joined")


def test_the_same_measurement_twice_is_refused(tmp_path, part, whole):
    half = in_half(whole)
    twice = whole.rows.index == half.idxmax()
    parts = [part("one", half), part("two", ~half | twice)]
    with pytest.raises(EnvlightError, match=r"both hold vase · [^;]* · \d; leave one"):
        join(parts, tmp_path / "joined")


def test_a_later_part_renews_its_samplers(tmp_path, part, whole):
    """Rows of two programs: of a sampler's older ones none is left, but in parts of other maps."""
    half = in_half(whole)
    new = half & whole.rows["sampler"].isin(["ours", "fhis"])
    old = part("old", ~half | half)
    parts = [old, part("new", new, {"methods": "0" * 24, "commit": "0123456789ab"})]
    rows = Run.load(parts[1]).rows.assign(reference="0" * 24)
    write_run(parts[1], rows, json.loads((parts[1] / "run.json").read_text(encoding="utf-8")))
    with pytest.raises(EnvlightError, match="differ in samplers, renderer or metrics"):
        join(parts, tmp_path / "joined")
    join(parts, tmp_path / "joined", renew=True)
    joined = Run.load(tmp_path / "joined")
    renewed = joined.rows["sampler"].isin(["ours", "fhis"])
    assert (joined.rows.loc[renewed, "reference"] == "0" * 24).all()
    assert renewed.sum() == new.sum()
    assert (~renewed).sum() == (~whole.rows["sampler"].isin(["ours", "fhis"])).sum()
    assert set(joined.record["missing"]) == {"ours", "fhis"}
    join([part("others", ~half), parts[1]], tmp_path / "more", renew=True)
    assert len(Run.load(tmp_path / "more").rows) == (~half | new).sum()
    assert [(one["rows"], one["commit"]) for one in joined.record["parts"]] == [
        ((~renewed).sum(), whole.record["machine"]["commit"]),
        (new.sum(), "0123456789ab"),
    ]


def test_one_part_alone_and_studies_are_refused(tmp_path, part, whole):
    one = part("one", in_half(whole))
    with pytest.raises(EnvlightError, match="two or more"):
        join([one], tmp_path / "joined")
    with pytest.raises(EnvlightError, match="the rows of stability are no grid's"):
        join([WHOLE.parent / "stability", one], tmp_path / "joined")
