"""A run that is killed at any moment goes on as if nothing had happened."""

import json
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from experiments.measure import MACHINE_COLUMNS

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="it forks processes")
SCRIPT = Path(__file__).with_name("killed_runs.py")
CELLS = 5 * 2 * (1 + 3 + 1)
"""Maps × budgets × (median-cut, three seeds of mis, uniform)."""


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("killed")


@pytest.fixture(scope="module")
def starts(maps_folder, place):
    """Signal, exit status, finished cells, whether older rows stayed, and stderr of each start."""
    command = [sys.executable, str(SCRIPT), str(maps_folder), str(place)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def test_kills_hit_the_run_while_it_measures(starts):
    assert any(0 < finished < CELLS for _, _, finished, _, _ in starts)


def test_no_finished_cell_is_lost_or_computed_twice(starts):
    assert all(kept for _, _, _, kept, _ in starts)
    finished = [count for _, _, count, _, _ in starts]
    assert finished == sorted(finished)
    assert finished[-1] == CELLS


def test_an_interrupt_ends_with_a_sentence_and_status_130(starts):
    interrupted = [(status, text) for signal, status, _, _, text in starts if signal == "SIGINT"]
    # One that comes after the last cell and the report finds nothing to interrupt.
    assert any(status == 130 for status, _ in interrupted)
    for status, text in interrupted:
        assert status in (0, 130)
        assert (len(text.splitlines()), text.startswith("envlight: interrupted")) == (
            (1, True) if status else (0, False)
        )


def untimed(path: Path) -> str:
    table = pd.read_csv(path, dtype=str)
    return table.drop(columns=[name for name in MACHINE_COLUMNS if name in table]).to_csv()


@pytest.mark.parametrize("table", ["cells.csv", "summary.csv"])
def test_tables_equal_those_of_an_undisturbed_run(starts, place, table):
    assert untimed(place / "killed" / table) == untimed(place / "whole" / table)


def test_files_equal_those_of_an_undisturbed_run(starts, place):
    def files(folder: Path) -> dict[str, bytes]:
        found = (file for file in folder.rglob("*") if file.suffix in (".exr", ".png"))
        return {str(file.relative_to(folder)): file.read_bytes() for file in found}

    killed, whole = files(place / "killed"), files(place / "whole")
    assert len(whole) == 5 + 5 * 2 * 3 + 5 * 2  # references, images of seed 0, montages
    assert killed == whole


def test_nothing_half_written_stays(starts, place):
    names = {file.name for file in (place / "killed").iterdir()}
    assert names == {
        "cells.csv", "summary.csv", "report.md", "results.sqlite", "writer.lock",
        "images", "montages", "references",
    }  # fmt: skip
    assert not list((place / "killed").rglob(".*"))
