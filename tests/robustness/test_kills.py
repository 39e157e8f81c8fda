"""A run that is killed at any moment goes on as if nothing had happened."""

import subprocess
import sys

import pandas as pd
import pytest

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="it forks processes")
RUNS = 4


@pytest.fixture(scope="module")
def figures(tmp_path_factory):
    """Kills and ends of a short campaign, which is a process of its own since it has no threads."""
    folder = tmp_path_factory.mktemp("figures")
    command = [sys.executable, "-m", "tests.robustness", "kills", "--runs", str(RUNS)]
    command += ["--executor", "serial"]
    subprocess.run([*command, "--seed", "3", "--details", str(folder)], capture_output=True)
    return pd.read_csv(folder / "kills.csv"), pd.read_csv(folder / "killed_runs.csv")


def test_kills_hit_the_run_while_it_measures(figures):
    kills, ends = figures
    assert len(ends) == RUNS
    assert (ends["kills"] > 0).all()
    assert kills["phase"].isin(["reference", "measurement"]).any()
    assert set(kills["signal"]) == {"SIGKILL", "SIGINT"}


def test_no_finished_measurement_is_lost_or_measured_twice(figures):
    for table in figures:
        assert not table[["lost", "again"]].to_numpy().any()
    assert not figures[0]["twice"].any()
    assert figures[1]["finished"].nunique() == 1
    assert (figures[1]["status"] == 0).all()


def test_stores_and_images_are_whole_after_each_kill(figures):
    assert not figures[0]["corrupt"].any()


def test_an_interrupt_ends_with_a_sentence_and_status_130(figures):
    kills, _ = figures
    assert kills["told"].all()
    assert set(kills.loc[kills["signal"] == "SIGINT", "status"]) <= {130, -2}
    assert (kills["status"] == 130).any()


def test_tables_and_images_equal_those_of_an_undisturbed_run(figures):
    _, ends = figures
    assert ends["table"].all()
    assert ends["files"].all()


def test_nothing_half_written_stays(figures):
    assert not figures[1]["leftovers"].any()
