"""Table 1 as published: ratios, intervals and words are those of the rows."""

import pandas as pd
import pytest

from experiments.report.parts import Items, Table, Text
from experiments.run.budget import Budget
from experiments.run.experiment import RunRequest
from experiments.run.loaded_run import Run
from experiments.run.registry import find_experiment
from experiments.wu2025 import table1_as_published as table
from experiments.wu2025.published import TABLE1

MAPS = tuple(f"map-{k}" for k in range(6))


def rows_of(factor=lambda name, metric: 1.0) -> pd.DataFrame:
    """The paper's own errors on maps of different brightness; each variant errs twice as much."""
    entries = [(name, one, 1.0) for name, one in table.AS_PUBLISHED.items()]
    entries += [(name, one, 2.0) for name, ones in table.VARIANTS.items() for one in ones]
    entries += [(table.MEASURE, table.Entry(*table.ROUNDED), 1.0)]
    entries += [(name, table.Entry(name, table.TIME), 1.0) for name in TABLE1.values]
    return pd.DataFrame(
        {
            "scene": scene, "environment": name, "sampler": one.label, "budget": one.budget,
            "seconds_render": 1.0, "allowed": 1.0,
            **{
                metric: (k + 1) * times * factor(method, metric) * TABLE1.values[method][metric][0]
                for metric in table.METRICS
            },
        }
        for k, name in enumerate(MAPS)
        for scene in ("vase", "teapot")
        for method, one, times in entries
    )  # fmt: skip


def run_of(folder, **kwargs) -> Run:
    record = {"experiment": table.NAME, "scale": {"width": 640, "height": 480}}
    return Run(folder, rows_of(**kwargs), record)


def test_the_papers_own_errors_are_told_to_be_the_papers(tmp_path):
    run = run_of(tmp_path)
    assert table.agreements(run) == {"rmse": pytest.approx(1.0), "flip": pytest.approx(1.0)}
    first, second, third = table.findings(run)
    assert "Ours (Wu 2025) has 0.50 times the RMSE and 0.48 times the FLIP of Median cut (" in first
    assert all("Ours (Wu 2025) is first of 7 by both" in told for told in (first, second))
    assert second.startswith("Yes. Under its conditions")
    assert "2 scenes, 640×480): Ours (Wu 2025) has 0.50 [0.50, 0.50] times the RMSE" in second
    assert "Of 12 ratios to median cut, 12 have the paper's" in second and "1.00 by FLIP" in second
    assert third.startswith("In the time of median cut with 8 lights") and "0.48 [" in third
    (variants,) = (part.rows for part in table.differences(run) if isinstance(part, Table))
    tmms = variants[variants["method"] == "tmms"]
    assert list(tmms["run"]) == ["as published", table.VARIANTS["tmms"][0].words]
    assert list(tmms["rmse"]) == pytest.approx([tmms["rmse_paper"].iloc[0] * k for k in (1, 2)])


def test_what_differs_is_told_with_both_figures(tmp_path):
    run = run_of(tmp_path, factor=lambda name, metric: 3.0 if name == "mis" else 1.0)
    assert "Of 12 ratios to median cut, 10 have" in table.findings(run)[1]
    assert table.findings(run)[1].startswith("In part. ")
    worse = run_of(tmp_path, factor=lambda name, metric: 3.0 if name == "ours" else 1.0)
    assert table.findings(worse)[1].startswith("No. ")


def test_steps_have_a_smaller_run_beside_and_all_parts_are_made(tmp_path):
    run = run_of(tmp_path)
    parts = [part for section in find_experiment(table.NAME).sections for part in section(run)]
    stems = {part.stem for part in parts if isinstance(part, Table)}
    assert stems == {"as_published", "variants", "steps", "by_scene"}
    assert sum(isinstance(part, Items) for part in parts) == 1
    steps = next(part for part in parts if isinstance(part, Table) and part.stem == "steps")
    assert list(steps.rows.columns[2:]) == [
        "paper", "as published, 640×480", "default readings", "equal time"
    ]  # fmt: skip
    # What no row tells is absent, and not a failure.
    few = Run(tmp_path, run.rows[run.rows["sampler"] == table.MEASURE], run.record)
    assert "not all 7 methods on any map; give --samplers '*'." in table.findings(few)[0]
    texts = [part.text for part in table.opening(run) if isinstance(part, Text)]
    assert texts == list(table.findings(run))


def test_its_measurements_are_at_the_rays_of_median_cut_and_what_is_beside(tmp_path):
    request = RunRequest(table.NAME, maps=["constant"], scenes=["three-boxes"], output=tmp_path)
    found = find_experiment(table.NAME).grid(request).measurements()
    pairs = {(one.sampler.label, str(one.budget)) for one in found}
    assert len(pairs) == len(found)
    entries = [*table.AS_PUBLISHED.values()]
    entries += [one for ones in table.VARIANTS.values() for one in ones]
    defaults = {one.label for one in entries} | set(TABLE1.values)
    assert {label for label, budget in pairs if budget == table.TIME} == set(TABLE1.values)
    assert table.ROUNDED in pairs and ("ours-no-upsampling", table.SHARED) in pairs
    assert {label for label, _ in pairs} <= defaults | {table.ROUNDED[0]}
    assert Budget.parse(table.SHARED).at == Budget.parse(table.RAYS)
