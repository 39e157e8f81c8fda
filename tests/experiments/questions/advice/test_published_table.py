"""The packaged table is what the command makes of published rows, and is worth what is claimed."""

import json
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import pytest

from experiments.cli.advice import TABLE
from experiments.questions.advice.expected import SURE
from experiments.questions.advice.measured import load_measured, to_json
from experiments.questions.which_sampler import ALL_BUDGETS, gathered, regret_table
from experiments.run.loaded_run import Run
from renderer.image import write_exr
from samplers.conformance.stress_maps import stress_map

RESULTS = Path(__file__).parents[4] / "results"
PACKAGED = Path(str(files("experiments.questions.advice") / TABLE))
TOO_HEAVY = ("pandas", "sklearn", "matplotlib", "colour", "dask", "renderer.packet.embree")
MOST_REGRET = {
    ("RMSE", "all"): 1.125, ("RMSE", "fixed"): 1.247,
    ("FLIP", "all"): 1.014, ("FLIP", "fixed"): 1.066,
}  # fmt: skip
"""Those of a ridge regression on the features, their squares and products with the count."""


@pytest.fixture(scope="module")
def published():
    names = load_measured(PACKAGED).source["runs"]
    return gathered([Run.load(RESULTS / name) for name in names])


def test_the_packaged_table_is_made_from_published_rows(published):
    assert to_json(published) == PACKAGED.read_text(encoding="utf-8")


def test_on_maps_kept_aside_advice_errs_little_and_intervals_hold(published):
    rows = regret_table(published).rows
    whole = rows[rows["budget"] == ALL_BUDGETS].set_index(["metric", "league"])
    for place, most in MOST_REGRET.items():
        line = whole.loc[place]
        assert line["choice"] < most + 0.0005, place
        assert line["choice"] < line["always"] < line["random"]
        assert abs(line["inside"] - SURE) < 0.1


def test_every_budget_has_an_answer_and_nothing_heavy_is_loaded(tmp_path):
    """In a process of its own: what takes the second is what it imports."""
    write_exr(tmp_path / "sky.exr", stress_map("sun-and-sky").radiance)
    script = (
        "import sys\n"
        "from experiments.cli.main import main\n"
        f"sys.argv = ['envlight', 'advise', {str(tmp_path / 'sky.exr')!r}, '--json']\n"
        "try:\n    main()\n"
        "finally:\n    print('\\n' + ' '.join(sys.modules))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True,
        cwd=RESULTS.parent,
    )  # fmt: skip
    told, loaded = done.stdout.strip().rsplit("\n", 1)
    assert not set(TOO_HEAVY) & set(loaded.split())
    found = json.loads(told)
    assert [one["league"] for one in found["answers"]] == ["fixed", "distribution"]
    for one in found["answers"]:
        assert one["chosen"]["count"] == 16
        assert one["chosen"]["low"] < one["chosen"]["error"] < one["chosen"]["high"]
    assert {one["name"] for one in found["alike"]} <= set(load_measured(PACKAGED).maps)
