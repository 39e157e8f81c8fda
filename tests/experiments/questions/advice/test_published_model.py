"""The packaged model is what the command makes of the published rows, and answers in a second."""

import json
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from experiments.cli.advice import MODEL
from experiments.maps.features import FEATURES, PREFIX
from experiments.questions.advice.choice import Wish, advise
from experiments.questions.advice.model_file import load_model
from experiments.questions.advice.train import trained_on
from experiments.run.loaded_run import Run
from renderer.image import write_exr
from samplers.conformance.stress_maps import stress_map

RESULTS = Path(__file__).parents[4] / "results"
PACKAGED = Path(str(files("experiments.questions.advice") / MODEL))
TOO_HEAVY = ("pandas", "sklearn", "matplotlib", "colour", "dask", "renderer.packet.embree")


def test_the_packaged_model_is_made_from_published_rows():
    packaged = load_model(PACKAGED)
    trained = trained_on([Run.load(RESULTS / name) for name in packaged.source["runs"]]).model
    assert trained.samplers == packaged.samplers and trained.maps == packaged.maps
    assert json.loads(json.dumps(trained.source)) == packaged.source
    for metric, regression in packaged.errors.items():
        again = trained.errors[metric]
        # Seven digits are kept; solvers of other machines differ in the last few of sixteen.
        for name in ("mean", "coefficient"):
            kept, made = getattr(regression, name), getattr(again, name)
            assert made == pytest.approx(kept, rel=1e-5, abs=1e-6, nan_ok=True)
        # Five and four digits, of a few tenths.
        assert trained.measured[metric] == pytest.approx(
            packaged.measured[metric], rel=1e-4, nan_ok=True
        )
        assert trained.residuals[metric] == pytest.approx(
            packaged.residuals[metric], rel=1e-3, abs=1e-4, nan_ok=True
        )
    assert [(one.average, one.better) for one in trained.verdicts] == [
        (one.average, one.better) for one in packaged.verdicts
    ]


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
    assert found["chosen"]["count"] == 16
    assert found["chosen"]["low"] < found["chosen"]["error"] < found["chosen"]["high"]
    assert {one["name"] for one in found["alike"]} <= set(load_model(PACKAGED).maps)


def test_a_measured_map_is_most_alike_to_itself():
    model = load_model(PACKAGED)
    for k in (0, len(model.maps) // 2):
        columns = {PREFIX + name: value for name, value in zip(
            FEATURES, model.features[k].tolist(), strict=True)}  # fmt: skip
        found = advise(model, columns, Wish("lights", 16, "rmse"))
        assert found.alike[0].name == model.maps[k]


def test_predictions_fall_with_the_count():
    """On every measured map, by every method whose mean error falls to a half or less."""
    model = load_model(PACKAGED)
    counts = np.array(model.counts, np.float64)[[0, -1]]
    for metric, regression in model.errors.items():
        falls = regression.mean[:, -1] < regression.mean[:, 0] - np.log(2.0)
        assert falls.sum() > 5
        for features in model.features:
            few, many = model.log_errors(metric, features, counts)[falls].T
            assert (many < few).all()
