"""Studies: rows are kept as they are measured, and measured only where they are missing."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from experiments.cli.commands import show
from experiments.report.write import write_report
from experiments.run.experiment import Group, RunRequest, Study
from experiments.run.loaded_run import Run
from experiments.run.runner import Outcome
from experiments.run.start import run_experiment
from experiments.run.store import PLAN, ROW, Store
from experiments.run.study import study_environments
from renderer.image import write_exr
from samplers import EnvlightError


def request_in(folder: Path) -> RunRequest:
    return RunRequest("study", output=folder, images=False)


def study_of(calls: list[list[str]], names: str = "ab", source: str = "samplers") -> Study:
    def measure(missing: list[str]) -> list[dict]:
        calls.append(missing)
        if "!" in missing:
            raise ValueError("out of order")
        return [{"note": "not here"} if n == "-" else {"value": ord(n)} for n in missing]

    asked = [({"name": name}, {}, name) for name in names]
    return Study(
        title="Letters", sections=(), groups=lambda request: [Group("letters", asked, measure)],
        sources=(source,), name="study",
    )  # fmt: skip


def run(study: Study, folder: Path, seen: list[pd.DataFrame], dry_run: bool = False) -> int:
    def finish(study: Study, run: Run, outcome: Outcome) -> list[Path]:
        seen.append(run.rows)
        print(f"{outcome.left_out} left out")
        return []

    return run_experiment(study, request_in(folder), dry_run, finish)


def test_rows_are_measured_once(tmp_path):
    calls: list[list[str]] = []
    seen: list[pd.DataFrame] = []
    for names in ("ab", "ab", "abc"):
        assert run(study_of(calls, names), tmp_path / "run", seen) == 0
    assert calls == [["a", "b"], ["c"]]
    assert [list(rows["value"]) for rows in seen] == [[97, 98], [97, 98], [97, 98, 99]]


def names_of(folder: Path) -> list[str]:
    return list(Run.load(folder).rows["name"])


def test_a_narrower_start_keeps_the_rows_and_their_order(tmp_path):
    for names in ("dab", "a", "ca", "b-"):
        assert run(study_of([], names), tmp_path / "run", []) == 0
    assert names_of(tmp_path / "run") == ["d", "a", "b", "c", "-"]
    assert run(study_of([], "ab"), tmp_path / "run", []) == 0
    assert names_of(tmp_path / "run") == ["d", "a", "b", "c", "-"]  # what was left out, too
    assert Run.load(tmp_path / "run").rows["note"].dropna().to_list() == ["not here"]
    calls: list[list[str]] = []
    assert run(study_of(calls, "abcd"), tmp_path / "run", []) == 0
    assert names_of(tmp_path / "run") == ["a", "b", "c", "d", "-"] and not calls


def test_rows_of_other_programs_leave_the_tables(tmp_path, capsys):
    assert run(study_of([], "ab"), tmp_path / "run", []) == 0
    assert run(study_of([], "a", "metrics.errors"), tmp_path / "run", []) == 0
    assert names_of(tmp_path / "run") == ["a"]
    assert "1 rows in" in capsys.readouterr().err
    with Store.reading(tmp_path / "run") as store:
        assert store.count(ROW) == 3


@pytest.mark.parametrize("change", ["experiment", "scale", "published"])
def test_a_folder_of_another_run_is_refused(tmp_path, change):
    assert run(study_of([], "ab"), tmp_path / "run", []) == 0
    before = (tmp_path / "run" / "run.json").read_bytes()
    study, request = study_of([], "a"), request_in(tmp_path / "run")
    if change == "experiment":
        study = replace(study, name="other")
    elif change == "scale":
        request = replace(request, scale="standard")
    else:
        (tmp_path / "run" / PLAN).unlink()
    with pytest.raises(EnvlightError, match="give another folder by --output"):
        run_experiment(study, request, False, lambda *_: [])
    assert (tmp_path / "run" / "run.json").read_bytes() == before


@pytest.mark.parametrize("name", ["run.json", "measurements.csv", "report.md"])
def test_a_folder_of_files_that_are_no_runs_is_refused(tmp_path, name):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / name).write_text("mine")
    with pytest.raises(EnvlightError, match=f"{name} is there and was not written by a run"):
        run(study_of([], "a"), tmp_path / "run", [])
    assert [file.read_text() for file in (tmp_path / "run").iterdir()] == ["mine"]


def test_what_repairs_did_is_told_and_recorded(tmp_path, capsys):
    write_exr(tmp_path / "bad.exr", np.full((4, 8, 3), np.nan, np.float32))
    study, folder = study_of([], "a"), tmp_path / "run"
    group, told = study.groups(request_in(folder)), "96 values changed: 96 NaN became 0"
    study = replace(study, groups=lambda request: group * len(study_environments(request, [], 0)))
    request = replace(request_in(folder), environments=str(tmp_path / "bad.exr"), repair=True)
    assert run_experiment(study, request, False, lambda *_: []) == 0
    assert f"map 'bad': {told}" in capsys.readouterr().err
    assert Run.load(folder).record["repairs"]["bad"].startswith(told)
    assert f"repaired in: bad ({told}" in write_report(study, Run.load(folder))[0].read_text()


def test_changed_source_is_measured_again(tmp_path):
    calls: list[list[str]] = []
    for source in ("samplers", "metrics.errors", "samplers"):
        run(study_of(calls, "a", source), tmp_path / "run", [])
    assert calls == [["a"], ["a"]]


def test_row_that_was_left_out_is_told_and_tried_again(tmp_path, capsys):
    calls: list[list[str]] = []
    seen: list[pd.DataFrame] = []
    for _ in range(2):
        assert run(study_of(calls, "a-"), tmp_path / "run", seen) == 0
    assert calls == [["a", "-"], ["-"]]
    assert list(seen[1]["note"].dropna()) == ["not here"]
    assert "1 left out" in capsys.readouterr().out


def test_failed_group_keeps_nothing_and_is_reported(tmp_path, capsys):
    assert run(study_of([], "a!"), tmp_path / "run", []) == 1
    assert "letters: ValueError: out of order" in capsys.readouterr().err
    with Store.reading(tmp_path / "run") as store:
        assert store.count(ROW) == 0


def test_dry_run_measures_and_writes_nothing_and_tells_what_is_left(tmp_path, capsys):
    calls: list[list[str]] = []
    folder = tmp_path / "run"
    assert run(study_of(calls), folder, [], True) == 0
    assert calls == [] and not folder.exists()
    assert "2 rows in 1 groups" in (text := capsys.readouterr().out) and "left:      2 rows" in text
    assert run(study_of([]), folder, []) == run(study_of([], "abc"), folder, [], True) == 0
    assert "left:      1 rows" in capsys.readouterr().out


def test_folder_can_be_shown(tmp_path, capsys):
    run(study_of([]), tmp_path / "run", [])
    (tmp_path / "run" / "study.md").write_text("# Letters\n")
    show(tmp_path / "run")
    text = capsys.readouterr().out
    assert "2 of 2 rows" in text and "# Letters" in text


@pytest.mark.parametrize("timed", [True, False])
def test_machine_counts_only_for_times(timed):
    study = study_of([])
    identity = replace(study, timed=timed).identity({"name": "a"}, {})
    assert bool(identity["machine"]) == timed


@pytest.mark.parametrize(
    ("name", "given", "ignored"),
    [
        ("light-generation-time", ["--executor", "processes"], "--executor"),
        ("light-generation-time", ["--workers", "2", "--cluster", "tcp://127.0.0.1:1"],
         "--workers, --cluster"),
        ("light-generation-time", ["--maps", "constant", "--budget", "4", "--scenes", "vase"],
         "--scenes"),
        ("kd-tree-throughput", ["--seeds", "2", "--strict", "--json"], "--json, --strict, --seeds"),
        ("discrepancy", ["--environments", "paper-named-12", "--maps", "constant", "--repair"],
         "--environments, --maps, --repair"),
        ("discrepancy", ["--samplers", "ours", "--budget", "4", "--reference-noise", "0.1"],
         "--samplers, --budget, --reference-noise"),
    ],
)  # fmt: skip
def test_options_without_effect_on_a_study_are_refused(name, given, ignored, envlight):
    status, _, told = envlight("run", name, *given, "--dry-run")
    assert status == 2
    assert f"experiment '{name}' has no use for {ignored} here; leave that out\n" in told


@pytest.mark.parametrize(
    ("name", "budgets", "sentence"),
    [
        ("area-lights", "4,8", "--budget 4, 8: one of lights=K here"),
        ("dynamic-sequence", "seconds=1", "--budget seconds=1: one of lights=K here"),
        ("dynamic-sequence", "time=mis:8", "--budget time=mis:8: one of lights=K here"),
    ],
)
def test_a_budget_of_another_kind_or_several_are_refused(name, budgets, sentence, envlight):
    status, _, told = envlight("run", name, "--budget", budgets, "--dry-run")
    assert status == 2
    assert f"{sentence}\n" in told
