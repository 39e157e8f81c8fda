"""Published measurements made again: what is as it was, what is not, and what is drawn."""

import shutil
from functools import partial
from pathlib import Path

import pandas as pd
import pytest

from experiments.cli.commands import finish_study
from experiments.questions import measured_again as study
from experiments.run import scale
from experiments.run.experiment import find_experiment
from experiments.run.loaded_run import Run
from experiments.run.record import write_run
from experiments.run.request import RunRequest
from experiments.run.study_run import run_study
from samplers import EnvlightError
from tests.experiments.tiny import TINY

MAPS = frozenset({"black", "constant", "noise", "other", "sun"})


@pytest.fixture
def results(finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of published runs, with one of them."""
    folder = tmp_path / "results"
    shutil.copytree(finished, folder / "tiny")
    command = "envlight run table1 --environments some-folder"
    changed(folder / "tiny", lambda rows, record: record["machine"].update(command=command))
    monkeypatch.setattr(study, "RESULTS", folder)
    monkeypatch.setitem(scale.SCALES, TINY.name, TINY)
    return folder


@pytest.fixture
def request_for(maps_folder: Path, tmp_path: Path):
    return partial(
        RunRequest, study.MEASURED_AGAIN, "quick", str(maps_folder), [], [], [], [],
        tmp_path / "again", False, False, 0,
    )  # fmt: skip


def changed(folder: Path, change) -> None:
    """Write a run's rows and record anew."""
    run = Run.load(folder)
    rows, record = run.rows.copy(), dict(run.record)
    change(rows, record)
    write_run(folder, rows, record)


def made_again(request: RunRequest) -> Run:
    found = find_experiment(study.MEASURED_AGAIN)
    assert run_study(found, request, False, finish_study) == 0
    return Run.load(request.output)


def test_what_is_as_it_was_agrees_in_every_value(results, request_for):
    run = made_again(request_for())
    rows = run.rows
    assert len(rows) == study.DRAWN and (rows["kind"] == "same").all()
    assert (rows["largest"] == 0.0).all()
    # At least count, lights, five kinds of rays, and both errors.
    assert (rows["values"] >= 9).all()
    (said,) = study.findings(run)
    assert said == (
        "2 measurements of 1 published run, drawn at random and made again: 2 agree to the last "
        "digit, 0 within a relative 0.001, 0 within the noise of both references; 0 differ. "
        f"{rows['values'].sum()} values were compared."
    )


@pytest.mark.parametrize(
    ("column", "factor", "kind"),
    [
        ("rmse", 1.0 + 1e-4, "close"),
        ("flip", 1.01, "differs"),
        ("flip", 3.0, "differs"),
        ("rmse", 0.3, "differs"),
        ("rays_shadow", 1.01, "differs"),
    ],
)
def test_what_is_not_is_told(results, request_for, column, factor, kind):
    def falsify(rows, record):
        rows[column] = rows[column].where(rows[column] != 0.0, 1.0) * factor

    changed(results / "tiny", falsify)
    run = made_again(request_for())
    assert set(run.rows["kind"]) == {kind} and set(run.rows["of"]) == {column}
    worst = [said for said in study.findings(run) if said.startswith("The worst: ")]
    assert len(worst) == (kind == "differs")
    assert all(f"whose {column} differs by" in said for said in worst)


@pytest.mark.parametrize("name", ["rmse", "flip"])
def test_errors_to_references_made_otherwise_differ_by_their_noise(results, request_for, name):
    def shifted(share):
        def shift(rows, record):
            rows[name] += share * 2.0 * rows[f"{name}_floor"]
            rows["reference"] = "made otherwise"

        changed(results / "tiny", shift)
        return set(made_again(request_for()).rows["kind"])

    assert (Run.load(results / "tiny").rows[f"{name}_floor"] > 0.0).any()
    assert shifted(0.9) <= {"noise", "close", "same"}
    shutil.rmtree(request_for().output)
    assert "differs" in shifted(0.2)


def test_times_are_not_compared(results, request_for):
    def slower(rows, record):
        for name in ("seconds_render", "seconds_lights", "peak_memory_mib"):
            rows[name] *= 3.0

    changed(results / "tiny", slower)
    assert (made_again(request_for()).rows["kind"] == "same").all()


def test_runs_of_another_state_are_told_apart(results, request_for):
    changed(results / "tiny", lambda rows, record: record["machine"].update(methods="other"))
    said = study.findings(made_again(request_for()))
    assert said[1] == (
        "2 of them are of runs by 1 other state of samplers, renderer and metrics: 2 of these "
        "agree to the last digit."
    )


def test_a_count_that_a_time_allowed_is_taken_from_the_row(results, request_for):
    run = Run.load(results / "tiny")
    row = run.rows[run.rows["sampler"] == "mis"].iloc[0]
    timed = row.copy()
    timed["budget"] = "seconds=0.5"
    one = study.measurement_of(run, timed, request_for())
    assert one.budget.timed
    made = study.again(one, int(row["count"]), results.parent / "again")
    assert study.agreement(row, *made, one.case.reference_key)["kind"] == "same"


def test_the_same_rows_are_drawn_at_every_start_and_none_on_a_map_that_is_not_there(results):
    run = Run.load(results / "tiny")
    first, second = (study.drawn(run, MAPS) for _ in range(2))
    assert [row["key"] for row in first] == [row["key"] for row in second]
    assert {row["environment"] for row in study.drawn(run, frozenset({"sun"}))} == {"sun"}
    assert study.drawn(run, frozenset()) == []
    elsewhere = Run(run.folder, run.rows.assign(scene="of-a-file"), run.record)
    assert study.drawn(elsewhere, MAPS) == []
    unknown = Run(run.folder, run.rows.assign(sampler="of-a-file[a=1]"), run.record)
    assert study.drawn(unknown, MAPS) == []
    repaired = Run(run.folder, run.rows.assign(repaired=1), run.record)
    assert study.drawn(repaired, MAPS) == []


def test_references_are_as_deep_as_the_run_asked_for(results, request_for):
    run = Run.load(results / "tiny")
    machine = {**run.record["machine"], "command": "envlight run table1 --reference-noise 0.1"}
    row = run.rows.iloc[0]
    with pytest.raises(EnvlightError, match="environment"):  # an embedded map of that name
        study.measurement_of(Run(run.folder, run.rows, {**run.record, "machine": machine}),
                             row, request_for())  # fmt: skip
    machine["command"] += " --environments some-folder"
    one = study.measurement_of(
        Run(run.folder, run.rows, {**run.record, "machine": machine}), row, request_for()
    )
    assert one.case.scale == TINY.with_noise(0.1)


def test_images_have_the_size_that_the_run_has(results, request_for):
    changed(results / "tiny", lambda rows, record: record["scale"].update(height=12))
    run = Run.load(results / "tiny")
    one = study.measurement_of(run, run.rows.iloc[0], request_for())
    assert TINY.height != 12
    assert (one.case.scale.width, one.case.scale.height) == (TINY.width, 12)


def test_larger_images_than_the_scale_has_are_left_out(results, request_for):
    changed(results / "tiny", lambda rows, record: record["scale"].update(width=640))
    with pytest.raises(EnvlightError, match="no run over a grid"):
        study.groups(request_for())


def test_more_seeds_than_its_experiment_has_are_made_again(results, request_for):
    run = Run.load(results / "tiny")
    stochastic = run.rows[run.rows["seed"] > 0].iloc[0]
    one = study.measurement_of(run, pd.Series({**stochastic, "seed": 99}), request_for())
    assert (one.sampler.label, one.seed) == (stochastic["sampler"], 99)


def test_a_sampler_that_is_gone_is_told(results, request_for):
    run = Run.load(results / "tiny")
    fixed = set(run.rows["sampler"]) - set(run.rows.loc[run.rows["seed"] > 0, "sampler"])
    row = pd.Series({**run.rows[run.rows["sampler"].isin(fixed)].iloc[0], "seed": 99})
    with pytest.raises(EnvlightError, match="no measurement of its experiment any more"):
        study.measurement_of(run, row, request_for())


def test_scenes_of_an_experiment_of_its_own_are_found_by_their_names():
    found = find_experiment("kd-tree-quality")
    named = study.scenes_of(found)
    assert {"vase", "ward-teapot", "brushed-metal"} <= set(named)
    assert Path(named["brushed-metal"]).is_file() and named["vase"] == "vase"
