"""Tables of renderers: whatever is registered is compared, and costs are those of the arrays."""

import numpy as np
import pandas as pd
import pytest

from experiments.questions import renderers
from experiments.report.write import write_report
from samplers import EnvironmentMap, EnvlightError, LightDistribution, make_sampler, sampler_names
from samplers.grids.tabulated import TabulatedDistribution
from tests.experiments.grid_rows import grid_run
from tests.experiments.stored import run_into

MAPS = tuple(f"map-{k}" for k in range(8))
LABELS = ("mis", "cycles", "cycles[compensation=True]")


def errors(scene: str, environment: str, sampler: str, lights: int) -> tuple[float, float]:
    level = {"mis": 1.0, "cycles": 1.5, "cycles[compensation=True]": 0.75}[sampler] / lights
    return level, level


def test_every_registered_table_runs_with_compensation_and_without():
    found = renderers.table_samplers()
    names = [spec.name for spec in found]
    assert names[0] == "mis" and {"mis-compensated", *renderers.RENDERERS} & set(
        sampler_names()
    ) <= set(names)
    for name in set(names) & set(renderers.RENDERERS):
        switched = {spec.sampler.compensation for spec in found if spec.name == name}
        assert switched == {True, False}
    environment = EnvironmentMap(np.ones((8, 16, 3), np.float32))
    for spec in found:
        lighting = spec.sampler.prepare(environment, 4, np.random.default_rng(0))
        assert isinstance(lighting, LightDistribution)


def test_report_tells_ratios_to_the_exact_table_and_what_compensation_does(tmp_path):
    run = grid_run(tmp_path, ("vase",), MAPS, LABELS, errors, (8, 32))
    write_report(renderers.renderers(), run)
    table = pd.read_csv(tmp_path / "beside_exact.csv").set_index(["metric", "budget", "sampler"])
    assert table.loc[("rmse", "lights=8", "cycles"), "times"] == pytest.approx(1.5)
    assert table.loc[("flip", "lights=32", LABELS[2]), "times"] == pytest.approx(0.75)
    switched = pd.read_csv(tmp_path / "compensation.csv").set_index("metric")
    assert switched.loc["RMSE", ["sampler", "ratio", "wins"]].tolist() == [
        LABELS[2], "0.500 [0.500, 0.500]", "8 of 8",
    ]  # fmt: skip


def test_bytes_are_those_of_all_arrays_once():
    environment = EnvironmentMap(np.ones((8, 16, 3), np.float32))
    lighting = make_sampler("mis").prepare(environment, 4, np.random.default_rng(0))
    assert isinstance(lighting, TabulatedDistribution)
    arrays = [value for value in vars(lighting).values() if isinstance(value, np.ndarray)]
    assert renderers.held_bytes(lighting) == sum(array.nbytes for array in arrays) > 0
    assert renderers.held_bytes(np.zeros(3)) == 24


def test_study_measures_each_table_on_each_map(tmp_path, monkeypatch, capsys):
    for table in (renderers.HEIGHTS, renderers.SAMPLES):
        monkeypatch.setitem(table, "quick", 32)
    run_into(
        tmp_path,
        renderers.renderer_tables(),
        maps=["constant", "noon-desert"],
        samplers=["mis", "kd-tree"],
    )
    rows = pd.read_csv(tmp_path / "renderer_tables.csv")
    assert len(rows) == 4 and (rows[["build_ms", "mib", "million_samples"]] > 0.0).all().all()
    assert (rows.loc[rows["sampler"] == "mis", "speed"] == 1.0).all()


def test_lights_are_no_table():
    environment = EnvironmentMap(np.ones((8, 16, 3), np.float32))
    (spec,) = renderers.choose_samplers(["median-cut"])
    with pytest.raises(EnvlightError, match="median-cut gives lights, not a distribution"):
        renderers.build(spec, environment)
