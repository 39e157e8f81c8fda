"""Where lights lie: numbers on maps whose lights are known, and a picture per map from the rows."""

import math
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from experiments.cli.commands import finish
from experiments.report.write import write_report
from experiments.run.experiment import RunRequest
from experiments.run.loaded_run import Run
from experiments.run.start import run_experiment
from experiments.wu2025.light_distribution import (
    carried,
    claim_sentence,
    light_distribution,
    light_statistics,
    means,
)
from samplers import DirectionalLights, EnvironmentMap, make_sampler
from samplers.sphere import pixel_direction

HEIGHT = 32


@pytest.fixture(scope="module")
def two_lamps() -> EnvironmentMap:
    """Two bright texels of equal energy on the equator, 90° apart, over a faint map."""
    radiance = np.full((HEIGHT, 2 * HEIGHT, 3), 1e-4)
    radiance[16, 10] = radiance[16, 26] = 100.0
    return EnvironmentMap.from_array(radiance, "two-lamps")


def lights_at(*pixels: tuple[int, int]) -> DirectionalLights:
    direction = np.array([pixel_direction(row, column, HEIGHT) for row, column in pixels])
    return DirectionalLights(direction, np.ones((len(pixels), 3)), np.zeros(len(pixels)))


def test_lights_on_the_lamps_are_found_there(two_lamps):
    found = light_statistics(two_lamps, lights_at((16, 10), (16, 26)))
    assert (found["lights"], found["energy_on_emissive"], found["lights_on_emissive"]) == (2, 1, 1)
    assert found["emissive_degrees"] == pytest.approx(0.0, abs=1e-6)
    # The row's centre lies half a texel below the equator: its circle is a little smaller.
    assert found["least_degrees"] == pytest.approx(90.0, abs=0.5)


def test_distances_are_weighted_by_energy(two_lamps):
    # A light on one lamp, none on the other: half of the energy is 90° away.
    found = light_statistics(two_lamps, lights_at((16, 10)))
    assert found["emissive_degrees"] == pytest.approx(45.0, abs=0.5)
    assert found["emissive_degrees_far"] == pytest.approx(90.0, abs=0.5)
    assert math.isnan(found["least_degrees"])
    # Mean angle between a fixed and any direction is 90°.
    assert found["sphere_degrees"] == pytest.approx(90.0, abs=0.5)


def test_draws_of_a_distribution_share_the_emissive_energy(two_lamps):
    lighting = make_sampler("mis").prepare(two_lamps, 16, np.random.default_rng(0))
    found = light_statistics(two_lamps, lighting)
    # 4096 draws by energy: within 4 standard deviations of a binomial share.
    share = found["emissive_energy"]
    spread = 4.0 * math.sqrt(max(share * (1.0 - share), 1e-9) / 4096)
    assert found["energy_on_emissive"] == pytest.approx(share, abs=spread + 1e-3)
    assert found["direct"] is None


def test_a_map_without_emissive_texels_has_no_distance_to_them():
    flat = EnvironmentMap.from_array(np.ones((HEIGHT, 2 * HEIGHT, 3)), "flat")
    found = light_statistics(flat, lights_at((3, 3)))
    assert found["emissive_energy"] == 0.0 and math.isnan(found["emissive_degrees"])


def shares(by_sampler: dict[str, tuple[float, ...]]) -> pd.DataFrame:
    """Rows of maps with half of their energy in the emissive region, the last with none."""
    rows = [
        {"environment": f"map{k}", "sampler": name, "count": 16, "energy_on_emissive": share,
         "emissive_energy": 0.5, "lights_on_emissive": 0.5, "emissive_degrees": 1.0,
         "direct_on_emissive": 0.9 if name == "ours" else None}
        for name, values in by_sampler.items()
        for k, share in enumerate(values)
    ]  # fmt: skip
    rows += [{**rows[0], "environment": "dark", "sampler": name, "emissive_energy": 0.0,
              "energy_on_emissive": 0.0} for name in by_sampler]  # fmt: skip
    return carried(pd.DataFrame(rows))


def test_shares_of_the_emissive_energy_are_told_from_the_rows():
    rows = shares({"median-cut": (0.1, 0.3), "ours": (0.4, 0.5), "tmms": (0.5, 0.3)})
    table = means(rows).set_index("sampler")
    assert list(table.index) == ["ours", "tmms", "median-cut"] and set(table["maps"]) == {2}
    # (0.8 + 1.0) / 2, (1.0 + 0.6) / 2, (0.2 + 0.6) / 2
    assert list(table["carried"]) == pytest.approx([0.9, 0.8, 0.4])
    claim = claim_sentence(rows)
    assert "90 % of the EnvDirects' energy lies on emissive texels" in claim
    assert "2005) on 2, than TMMS (Feng 2016) on 1 of 2 maps" in claim
    assert not claim_sentence(rows[rows["sampler"] != "ours"])


def test_pictures_stay_where_their_map_is_gone(tmp_path, maps_folder, capsys):
    maps = shutil.copytree(maps_folder, tmp_path / "maps")
    folder = tmp_path / "run"
    request = replace(request_of(folder), environments=str(maps), maps=["sun"], samplers=["mis"])
    assert run_experiment(light_distribution(), request, False, finish) == 0
    picture = folder / "maps" / "sun_lights=16.webp"
    before = picture.read_bytes()
    shutil.rmtree(maps)
    write_report(light_distribution(), Run.load(folder))
    assert picture.read_bytes() == before
    assert "](maps/sun_lights=16.webp)" in (folder / "report.md").read_text(encoding="utf-8")


def request_of(folder: Path) -> RunRequest:
    return RunRequest(
        "light-distribution",
        maps=["constant", "gothic-church"],
        samplers=["ours", "mis", "median-cut"],
        output=folder,
    )


def run_in(folder: Path) -> int:
    return run_experiment(light_distribution(), request_of(folder), False, finish)


@pytest.fixture(scope="module")
def measured(tmp_path_factory) -> Path:
    """The folder of a run on two maps."""
    folder = tmp_path_factory.mktemp("light-distribution")
    assert run_in(folder) == 0
    return folder


def test_reports_are_the_same_bytes_from_stored_rows(measured, capsys):
    written = [*measured.glob("*.csv"), *measured.glob("maps/*.webp")]
    first = {file: file.read_bytes() for file in written}
    assert {file.name for file in first} == {
        "measurements.csv", "light_distribution.csv", "light_distribution_means.csv",
        "constant_lights=16.webp", "gothic-church_lights=16.webp",
    }  # fmt: skip
    assert run_in(measured) == 0
    assert "0 rows made, 6 were stored already" in capsys.readouterr().out
    assert {file: file.read_bytes() for file in first} == first


def test_env_directs_lie_on_the_emissive_region(measured):
    rows = pd.read_csv(measured / "light_distribution.csv").set_index(["environment", "sampler"])
    church = rows.loc["gothic-church"]
    assert church.loc["ours", "lights"] == 16
    assert church.loc["ours", "direct"] + church.loc["ours", "indirect"] == 16
    # The church's emissive windows are compact, so that a centroid lies on them.
    assert church.loc["ours", "direct_on_emissive"] == pytest.approx(1.0)
    assert 16 * church.loc["ours", "lights_on_emissive"] >= church.loc["ours", "direct"] > 0
