"""Where lights lie: numbers on maps whose lights are known, and a picture per map from the rows."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from experiments.run.request import RunRequest
from experiments.wu2025 import light_distribution as experiment
from experiments.wu2025.light_statistics import light_statistics
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


def request_of(folder: Path) -> RunRequest:
    return RunRequest(
        "light-distribution", "quick", "embedded", ["constant", "gothic-church"], [],
        ["ours", "mis", "median-cut"], [], folder, False, True, 0,
    )  # fmt: skip


def test_reports_are_the_same_bytes_from_stored_rows(tmp_path, capsys):
    assert experiment.run(request_of(tmp_path), False) == 0
    written = [*tmp_path.glob("*.csv"), *tmp_path.glob("maps/*.jpg")]
    first = {file: file.read_bytes() for file in written}
    assert {file.name for file in first} == {
        "measurements.csv", "light-distribution.csv", "constant_lights=16.jpg",
        "gothic-church_lights=16.jpg",
    }  # fmt: skip
    assert experiment.run(request_of(tmp_path), False) == 0
    assert "0 rows measured, 6 were stored" in capsys.readouterr().out
    assert {file: file.read_bytes() for file in first} == first


def test_env_directs_lie_on_the_emissive_region(tmp_path):
    assert experiment.run(request_of(tmp_path), False) == 0
    rows = pd.read_csv(tmp_path / "light-distribution.csv").set_index(["environment", "sampler"])
    church = rows.loc["gothic-church"]
    assert church.loc["ours", "lights"] == 16
    assert church.loc["ours", "direct"] + church.loc["ours", "indirect"] == 16
    # The church's emissive windows are compact, so that a centroid lies on them.
    assert 16 * church.loc["ours", "lights_on_emissive"] >= church.loc["ours", "direct"] > 0
