"""The table of published folders: complete, every command one that is known, titles shown."""

import shlex
from pathlib import Path

import pytest
import typer

from experiments.cli.main import app
from experiments.maps import places
from experiments.maps.patterns import split_list
from experiments.report.suite import SUITE, read_suite, title_of
from experiments.run.budget import Budget
from experiments.run.loaded_run import RECORD, Run, write_run
from experiments.run.registry import find_experiment
from experiments.run.sampler_spec import choose_samplers
from samplers import EnvlightError

RESULTS = Path(__file__).parents[3] / "results"
LISTED = read_suite(RESULTS)


def test_every_published_folder_is_listed():
    published = [file.parent.relative_to(RESULTS) for file in RESULTS.rglob(RECORD)]
    assert {one.as_posix() for one in published} <= {one.name for one in LISTED}
    places = [one.name for one in LISTED]  # a run is published before those inside its folder
    assert len({Path(one).name for one in places}) == len(places)  # as runs and pages are called
    assert all(places.index(one) < k for k, name in enumerate(places)
               for one in places if name.startswith(f"{one}/"))  # fmt: skip


@pytest.mark.parametrize("one", LISTED, ids=lambda one: one.name)
def test_commands_are_those_of_the_command_line(one):
    group = typer.main.get_command(app)
    for words in one.runs:
        context = group.commands["run"].make_context("run", list(words))
        own = getattr(find_experiment(context.params["experiment"]), "samplers", tuple)()
        for text in split_list(context.params["budget"] or ()):
            Budget.parse(text)
        choose_samplers(split_list(context.params["samplers"] or ()), own)
        if context.params["environments"] == "embedded":
            assert set(split_list(context.params["maps"] or ())) <= set(places.names())
    group.commands["publish"].make_context("publish", ["RUN", "FOLDER", *one.publish])
    assert set(one.needs) <= {"EVERY", "HOLDOUT"}


def suite_of(folder: Path, text: str) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / SUITE).write_text(text, encoding="utf-8")
    return folder


def test_lists_are_filled_in_and_folders_of_maps_are_asked_for(tmp_path):
    text = (
        '[lists]\nA = "x,{B}"\nB = "y"\n'
        '[one]\ntitle = "One"\nrun = "table1 --maps {A} --environments {EVERY}"\n[two]\nrun = "t"\n'
    )
    one, two = read_suite(suite_of(tmp_path, text))
    assert one.runs == (("table1", "--maps", "x,y", "--environments", "{EVERY}"),)
    assert one.needs == ("EVERY",) and not two.needs
    (given, _) = read_suite(tmp_path, {"EVERY": "my maps"})
    assert given.runs[0][-1] == "my maps" and not given.needs
    assert title_of(tmp_path / "one", "experiment") == "One"
    assert title_of(tmp_path / "two", "experiment") == "experiment"
    assert title_of(tmp_path / "other", "experiment") == "experiment"
    suite_of(tmp_path / "more", '["a/b"]\ntitle = "Inside"\nrun = "t"\n')
    assert title_of(tmp_path / "more" / "a" / "b", "experiment") == "Inside"


@pytest.mark.parametrize(
    "text",
    ["[one", "[one]\ntitle = 'no command'", "[one]\nrun='a'\nruns='b'", "[one]\nrun=3",
     "[one]\nrun=[3]", "[one]\nrun='\"'", "[one]\nrun='a'\npublish=3", "lists=3\n[one]\nrun='{A}'",
     "[one]\nrun='{A}'\n[lists]\nA='{B}'\nB='{A}'", "[one]\nrun='{A}'\n[lists]\nA=3"],
)  # fmt: skip
def test_a_table_that_is_wrong_is_told(tmp_path, text):
    with pytest.raises(EnvlightError, match=SUITE):
        read_suite(suite_of(tmp_path, text))


def test_what_is_missing_is_measured_and_published(tmp_path, maps_folder, envlight, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(RESULTS.parent))
    small = (
        f"table1 --environments {shlex.quote(str(maps_folder))} --maps constant "
        "--scenes three-boxes --samplers uniform,mis --budget lights=4 --no-images --seeds 1"
    )
    results, runs = tmp_path / "results", tmp_path / "runs"
    text = f'[good]\ntitle = "A small one"\nrun = "{small}"\n[bad]\nrun = "table1 --maps none"\n'
    suite_of(results, text + '[far]\nrun = "table1 --environments {FAR}"\n')
    status, out, err = envlight("published", results, "--runs", runs, "--dry-run")
    assert status == 1 and "good: A small one" in out and "left:      2 measurements" in out
    assert "--maps FAR=FOLDER" in err and "none" in err
    assert not runs.exists() and not (results / "good").exists()
    status, out, err = envlight("published", results, "--runs", runs, "--only", "good,bad")
    assert status == 1 and "bad is not published: status 2" in err
    assert (results / "good" / RECORD).is_file() and not (results / "bad").exists()
    page = (results / "README.md").read_text(encoding="utf-8")
    assert "**A small one** ([good](good/report.md)" in page
    again = ("published", results, "--runs", runs, "--only", "good", "--dry-run")
    status, out, _ = envlight(*again)
    assert status == 0 and "published whole" in out
    status, out, _ = envlight(*again, "--again")
    assert status == 0 and "left:      0 measurements" in out
    run = Run.load(results / "good")
    write_run(results / "good", run.rows, {**run.record, "planned": 3})
    assert not LISTED[0].is_whole(results) and "left:" in envlight(*again)[1]


def test_a_folder_without_a_table_is_told(tmp_path, envlight):
    status, _, err = envlight("published", tmp_path)
    assert status == 2 and err.startswith(f"envlight: {tmp_path}: no suite.toml is there")
