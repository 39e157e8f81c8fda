"""Time of references: the target is that of scale standard, slow ones stop, rows are kept."""

import math
from dataclasses import replace

import pandas as pd
import pytest

from experiments.cli.commands import finish_study
from experiments.maps.sources import find_environments
from experiments.questions import reference_time as experiment
from experiments.report.write import write_report
from experiments.run.case import Case
from experiments.run.experiment import find_experiment
from experiments.run.kept_images import has_reference
from experiments.run.loaded_run import Run
from experiments.run.measure import ReferenceTask, measure_reference
from experiments.run.request import RunRequest
from experiments.run.scale import SCALES
from experiments.run.shared_results import take_reference
from experiments.run.study_run import run_study
from renderer import reference, scenes
from renderer.view import make_view
from tests.experiments.tiny import TINY

FINE = replace(TINY, noise_target=0.05, max_samples=1024)


@pytest.fixture
def task(tmp_path, maps_folder) -> ReferenceTask:
    (source,) = find_environments(str(maps_folder), ["noise"], 16)
    return ReferenceTask(Case("three-boxes", source, FINE), str(tmp_path))


def test_quality_is_that_of_scale_standard_at_every_size():
    standard = SCALES["standard"]
    for name in SCALES:
        scale = experiment.reference_scale(name)
        assert scale.noise_target == standard.noise_target
        assert scale.max_samples == standard.max_samples
    assert experiment.reference_scale("standard") == standard


def test_the_reference_is_that_of_a_run(task):
    row, kept = experiment._measure(task, 60.0)
    again = measure_reference(task)
    assert {**kept, "seconds": 0.0} == {**again, "seconds": 0.0}
    assert not row["stopped"] and row["seconds"] > 0.0
    assert row["samples"] == again["samples"]
    assert row["rays_shadow"] + row["rays_brdf"] == again["rays"]
    # Every sample is a ray of its kind, or skipped.
    drawn = sum(row[f"rays_{kind}"] for kind in experiment.KINDS)
    assert drawn == row["samples"] * len(make_view(scenes.make("three-boxes"), 24, 18, 1))
    assert 0.0 < row["noise"] <= FINE.noise_target * (1.0 + experiment.ROUNDING)


def test_what_takes_too_long_is_stopped(task):
    row, kept = experiment._measure(task, 0.0)
    assert kept == {} and row["stopped"] and row["seconds"] == 0.0 and math.isnan(row["noise"])


def test_state_at_the_stop_is_that_of_the_last_pass_kept(task, monkeypatch):
    class Stopped(Exception):
        pass

    def save_and_stop(state, checkpoint):
        save(state, checkpoint)
        raise Stopped

    save = reference._State.save
    with monkeypatch.context() as patch:
        patch.setattr(reference, "CHECKPOINT_SECONDS", -1.0)
        patch.setattr(reference._State, "save", save_and_stop)
        with pytest.raises(Stopped):
            measure_reference(task)
    state = experiment._state_at_stop(task)
    # The first pass alone: as many samples in each half of every point.
    assert state["samples"] == 2 * reference.FIRST_SAMPLES
    assert state["noise"] > FINE.noise_target and state["rays_shadow"] > 0


def row(environment: str, scene: str, seconds: float, noise: float, stopped: bool = False) -> dict:
    return {
        "environment": environment, "scene": scene, "seconds": seconds, "noise": noise,
        "target": 0.01, "most_samples": 4096, "stopped": stopped,
        "rays_shadow": 30, "rays_brdf": 90, "rays_skipped": 80,
    }  # fmt: skip


def test_verdicts_and_summary_count_what_was_reached_and_when():
    rows = [
        row("a", "vase", 10.0, 0.0099), row("a", "teapot", 89.0, 0.01),
        row("b", "vase", 135.0, 0.0099), row("b", "teapot", 180.0, 0.02, stopped=True),
        row("c", "vase", 20.0, 0.0099), row("c", "teapot", 30.0, 0.011),
    ]  # fmt: skip
    shown = experiment.with_verdicts(pd.DataFrame(rows))
    assert list(shown["verdict"]) == [
        "met", "met", "missed by a factor of 1.50", "stopped at 180 s", "met",
        "target missed at the cap of 4096 samples",
    ]  # fmt: skip
    table = experiment.summary(shown).set_index("scene")
    counts = table[["in_time", "reached", "at_cap", "stopped"]]
    assert counts.loc["vase"].tolist() == [2, 3, 0, 0]
    assert counts.loc["teapot"].tolist() == [1, 1, 1, 1]
    assert counts.loc[experiment.ALL].tolist() == [1, 1, 1, 1]
    assert table.loc[experiment.ALL, "total_seconds"] == 464.0
    assert table.loc["vase", "slowest"] == "b"
    assert experiment.in_time_sentence(table.reset_index()) == (
        "On 1 of 3 maps every scene reaches the target within 90 s. All references together take "
        "464 s."
    )
    assert experiment.mean_sentence(shown) == (
        "A reference takes 77.3 s in the mean at least, as some were stopped; wanted 14 s: missed "
        "by a factor of 5.52."
    )
    assert experiment.mean_sentence(shown.head(1)) == (
        "A reference takes 10.0 s in the mean; wanted 14 s: met."
    )
    assert experiment.rays_sentence(table.reset_index()) == (
        "Of the rays 25 % go toward samples of the map (25 to 25 % by scene), the others along "
        "samples of the BRDF; of all samples 40 % need no ray."
    )


def test_rows_are_kept_one_by_one_and_tables_written(tmp_path, monkeypatch, maps_folder, capsys):
    monkeypatch.setitem(experiment.SIZES, "quick", (24, 18))
    calls = []

    def measure(task, stop):
        calls.append(task.case.scene)
        if len(calls) == 2:
            raise KeyboardInterrupt
        row = {"samples": 64.0, "rays_shadow": 4, "rays_brdf": 5, "rays_skipped": 1,
               "noise": 0.009, "peak_mib": 99.0, "seconds": 1.0, "stopped": False}  # fmt: skip
        return row, {}

    monkeypatch.setattr(experiment, "_measure", measure)
    request = RunRequest(
        "reference-time", "quick", str(maps_folder), ["sun"], ["vase", "teapot"], [], [],
        tmp_path / "run", False, True, 0,
    )  # fmt: skip
    study = experiment.reference_time()
    assert run_study(study, request, False, finish_study) == 130
    assert run_study(study, request, False, finish_study) == 0
    assert calls == ["vase", "teapot", "teapot"]
    assert "1 rows measured, 1 were stored" in capsys.readouterr().out
    assert len(pd.read_csv(tmp_path / "run" / "reference_time.csv")) == 2
    report = tmp_path / "run" / "report.md"
    text = report.read_text(encoding="utf-8")
    assert "On 1 of 1 maps every scene" in text
    report.unlink()
    write_report(study, Run.load(tmp_path / "run"))
    assert report.read_text(encoding="utf-8") == text


def test_grids_beside_it_take_its_references(tmp_path, monkeypatch, maps_folder):
    monkeypatch.setitem(experiment.SIZES, "standard", (24, 18))
    monkeypatch.setitem(SCALES, "standard", replace(FINE, name="standard"))
    request = RunRequest(
        "reference-time", "standard", str(maps_folder), ["noise"], ["vase"], [], [],
        tmp_path / "timed", False, True, 0,
    )  # fmt: skip
    assert run_study(experiment.reference_time(), request, False, finish_study) == 0
    (case,) = {
        measurement.case for measurement in find_experiment("table1").grid(request).measurements()
    }
    mine = tmp_path / "mine"
    taken = take_reference(case, mine, tmp_path)
    assert taken["seconds"] == pd.read_csv(tmp_path / "timed/reference_time.csv")["seconds"].item()
    assert has_reference(mine, case, taken)
