"""References, budgets and published rows: tiny campaigns, and what a published row may not be."""

import shutil
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from experiments.run import scale
from experiments.run.loaded_run import Run, write_run
from experiments.run.registry import find_experiment
from experiments.wu2025.table1 import table1
from samplers import EnvlightError
from tests.benchmarks import measured_again as again
from tests.benchmarks import paper_budget, reference_time, table
from tests.experiments.conftest import environments, finished, grid, maps_folder, suffixes_of_plots  # noqa: F401
from tests.experiments.tiny import TINY


@pytest.fixture
def results(finished, tmp_path, monkeypatch) -> Path:  # noqa: F811
    """A folder of published runs, with one of them."""
    folder = tmp_path / "results"
    shutil.copytree(finished, folder / "tiny")
    command = "envlight run table1 --environments some-folder"
    changed(folder / "tiny", lambda rows, record: record["machine"].update(command=command))
    monkeypatch.setitem(scale.SCALES, TINY.name, TINY)
    return folder


def changed(folder: Path, change) -> None:
    """Write a run's rows and record anew."""
    run = Run.load(folder)
    rows, record = run.rows.copy(), dict(run.record)
    write_run(folder, *(change(rows, record) or (rows, record)))


def made_again(results: Path, maps: Path, count: int = 2) -> pd.DataFrame:
    return again.made_again(again.drawn(results, str(maps), count), str(maps), results / "none")


def test_what_is_as_it_was_agrees_in_every_value(results, maps_folder):  # noqa: F811
    def slower(rows, record):
        for name in ("seconds_render", "seconds_lights", "peak_memory_mib"):
            rows[name] *= 3.0

    changed(results / "tiny", slower)  # times are the machine's
    rows = made_again(results, maps_folder)
    assert len(rows) == 2 and (rows["kind"] == "same").all()
    # At least count, lights, five kinds of rays, and both errors.
    assert (rows["values"] >= 9).all()
    line = again.by_kind(rows).iloc[0]
    assert line["same"] == line["drawn"] == 2 and line["differs"] == 0


@pytest.mark.parametrize(
    ("column", "factor", "kind"),
    [("rmse", 1.0 + 1e-4, "close"), ("flip", 1.01, "differs"), ("rays_shadow", 1.01, "differs")],
)
def test_what_is_not_is_told(results, maps_folder, column, factor, kind):  # noqa: F811
    def falsify(rows, record):
        rows[column] *= factor
        return rows[rows[column] > 0.0], record

    changed(results / "tiny", falsify)
    rows = made_again(results, maps_folder)
    assert set(rows["kind"]) == {kind} and set(rows["of"]) == {column}


@pytest.mark.parametrize(
    ("share", "kinds"), [(0.9, {"noise", "close", "same"}), (1.1, {"differs"})]
)
def test_errors_to_references_made_otherwise_differ_by_their_noise(
    results, maps_folder, share, kinds  # noqa: F811
):  # fmt: skip
    def shift(rows, record):
        rows["rmse"] += share * 2.0 * rows["rmse_floor"]
        rows["reference"] = "made otherwise"
        return rows[rows["rmse_floor"] > 0.0], record

    changed(results / "tiny", shift)
    assert set(made_again(results, maps_folder)["kind"]) <= kinds


def test_rows_are_drawn_alike_for_a_seed_and_none_on_a_map_that_is_not_there(
    results, maps_folder, tmp_path  # noqa: F811
):  # fmt: skip
    def keys(maps: Path, seed: int = 0):
        return [row["key"] for _, row in again.drawn(results, str(maps), 5, seed)]

    assert keys(maps_folder) == keys(maps_folder) != keys(maps_folder, 1)
    one = tmp_path / "one"
    one.mkdir()
    shutil.copyfile(maps_folder / "sun.exr", one / "sun.exr")
    assert {row["environment"] for _, row in again.drawn(results, str(one), 5)} == {"sun"}
    with pytest.raises(EnvlightError, match="no run over a grid"):
        again.drawn(results, str(maps_folder), 5, widest=TINY.width - 1)
    changed(results / "tiny", lambda rows, record: rows.__setitem__("sampler", "of-a-file[a=1]"))
    with pytest.raises(EnvlightError, match="no run over a grid"):
        keys(maps_folder)


def test_counts_noise_and_size_are_those_of_the_run(results, maps_folder):  # noqa: F811
    run = Run.load(results / "tiny")
    row = run.rows[run.rows["sampler"] == "mis"].iloc[0].copy()
    row["budget"] = "seconds=0.5"
    machine = {**run.record["machine"]}
    machine["command"] += " --reference-noise 0.1"
    size = {**run.record["scale"], "height": 12}
    asked = Run(run.folder, run.rows, {**run.record, "machine": machine, "scale": size})
    one = again.measurement_of(asked, row, str(maps_folder))
    assert one.budget.timed
    assert one.case.scale == replace(TINY.with_noise(0.1), height=12)
    plain = again.measurement_of(run, row, str(maps_folder))
    made = again.again(plain, int(row["count"]), results.parent / "again", results / "none")
    assert again.agreement(row, *made, plain.case.reference_key)["kind"] == "same"
    gone = pd.Series({**run.rows[run.rows["sampler"] == "median-cut"].iloc[0], "seed": 99})
    with pytest.raises(EnvlightError, match="no measurement of its experiment any more"):
        again.measurement_of(run, gone, str(maps_folder))


def test_scenes_of_an_experiment_of_its_own_are_found_by_their_names():
    named = again.scenes_of(find_experiment("kd-tree-quality"))
    assert {"vase", "ward-teapot", "brushed-metal"} <= set(named)
    assert Path(named["brushed-metal"]).is_file() and named["vase"] == "vase"
    assert "vase" in again.scenes_of(table1())


def test_references_are_timed_by_scene(maps_folder, monkeypatch):  # noqa: F811
    monkeypatch.setattr(reference_time, "TEST_SCENES", ("three-boxes",))
    rows = reference_time.times(str(maps_folder), ["sun"], TINY)
    assert (rows[["seconds", "samples", "rays", "peak_mib"]] > 0.0).all(axis=None)
    rows = pd.concat([rows, rows.assign(scene="vase")], ignore_index=True)
    lines = reference_time.by_scene(rows).set_index("scene")
    assert list(lines.index) == ["three-boxes", "vase", "all"]
    assert lines.loc["all", "total_seconds"] == pytest.approx(rows["seconds"].sum())
    assert (lines["slowest"] == "sun").all() and (lines["maps"] == 1).all()


def test_shares_of_a_budget_are_told_for_every_sampler():
    rows = paper_budget.shares(["q2-tree"], 0.01, TINY)
    assert list(rows["sampler"]) == ["q2-tree"]
    assert rows["ratio"].to_numpy() == pytest.approx(rows["seconds"].to_numpy() / 0.01)
    assert (rows["count"] >= rows["least_count"]).all()
    assert (rows[["seconds_view", "peak_mib"]] > 0.0).all(axis=None)


def test_a_table_replaces_its_own_alone(tmp_path, capsys):
    rows = pd.DataFrame({"what": ["a"], "count": [1]})
    table.publish("killed-runs", rows, tmp_path)
    table.publish("damaged-files", rows.assign(count=2), tmp_path)
    table.publish("damaged-files", rows.assign(count=3), tmp_path)
    page = (tmp_path / table.PAGE).read_text(encoding="utf-8")
    assert page.count("| a ") == 2 and page.count("## ") == 2
    assert pd.read_csv(tmp_path / "damaged-files.csv")["count"].tolist() == [3]
