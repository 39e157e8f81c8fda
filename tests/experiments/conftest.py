"""Tiny experiments: five maps of 32×16 texels, images of 24×18 pixels."""

import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from experiments import progress
from experiments.cli import main as cli
from experiments.cli.commands import finish
from experiments.maps.sources import EnvironmentSource, find_environments
from experiments.report import figures
from experiments.report.pages import write
from experiments.run.budget import Budget
from experiments.run.measurement import Grid, Measurement
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.store import Store
from experiments.wu2025.table1 import table1
from renderer.image import write_exr
from samplers import DirectionalLights, LightSampler, register
from samplers.base import REGISTERED
from tests.experiments.stored import run_plan
from tests.experiments.tiny import TINY


@pytest.fixture(scope="session", autouse=True)
def suffixes_of_plots() -> Iterator[tuple[str, ...]]:
    """What plots are written as, of which reports show the first; tests are content with it."""
    every = figures.SUFFIXES
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures, "SUFFIXES", every[:1])
        patch.setattr(write, "WORKERS", 1)  # others take seconds to start
        yield every


@pytest.fixture(autouse=True)
def nothing_is_said_of_what_takes_long(monkeypatch: pytest.MonkeyPatch) -> None:
    """How long a test takes, and so what is said of it meanwhile, depends on the machine."""
    monkeypatch.setattr(progress, "SOON_SECONDS", 1e6)


@pytest.fixture(scope="session")
def exit_status() -> Callable[..., int]:
    """Run a command; returns its exit status."""

    def run(*words: object) -> int:
        with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as end:
            patch.setattr(sys, "argv", ["envlight", *map(str, words)])
            cli.main()
        return end.value.code or 0

    return run


@pytest.fixture
def envlight(
    exit_status: Callable[..., int], capfd: pytest.CaptureFixture[str]
) -> Callable[..., tuple[int, str, str]]:
    """Run a command; returns exit status, standard output and standard error, C libraries' too."""

    def run(*words: object) -> tuple[int, str, str]:
        capfd.readouterr()
        return (exit_status(*words), *capfd.readouterr())

    return run


@pytest.fixture(scope="session")
def maps_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two noisy maps, one with a sun, a black and a constant one."""
    folder = tmp_path_factory.mktemp("maps")
    rng = np.random.default_rng(1)
    maps = {
        "black": np.zeros((16, 32, 3)),
        "constant": np.full((16, 32, 3), 0.7),
        "noise": rng.random((16, 32, 3)),
        "other": rng.random((16, 32, 3)) ** 4.0,
        "sun": 0.1 * rng.random((16, 32, 3)),
    }
    maps["sun"][4, 9] = 1e4
    for name, radiance in maps.items():
        write_exr(folder / f"{name}.exr", radiance.astype(np.float32))
    return folder


@pytest.fixture(scope="session")
def environments(maps_folder: Path) -> tuple[EnvironmentSource, ...]:
    return tuple(find_environments(str(maps_folder), [], 16))


@pytest.fixture(scope="session")
def grid(environments: tuple[EnvironmentSource, ...]) -> Grid:
    """Two deterministic samplers and one with three seeds: 25 measurements."""
    samplers = tuple(SamplerSpec(name) for name in ("median-cut", "mis", "uniform"))
    return Grid(("three-boxes",), environments, samplers, (Budget(4),), TINY)


@pytest.fixture
def measurements_of(grid: Grid) -> Callable[..., list[Measurement]]:
    """The measurements of the grid on the named maps, of the named samplers."""

    def choose(maps: tuple[str, ...], samplers: tuple[str, ...] = ()) -> list[Measurement]:
        return [
            measurement
            for measurement in grid.measurements()
            if measurement.case.environment.name in maps
            and (not samplers or measurement.sampler.name in samplers)
        ]

    return choose


@pytest.fixture(scope="session")
def finished(grid: Grid, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a complete run of the grid. Read it only."""
    folder = tmp_path_factory.mktemp("finished") / "run"
    with Store.writing(folder) as store:
        assert run_plan(table1(), store, grid.measurements(), finish) == 0
    return folder


@pytest.fixture
def copied(finished: Path, tmp_path: Path) -> Path:
    """A copy of the complete run, to be damaged."""
    return shutil.copytree(finished.parent, tmp_path / "copied") / "run"


@pytest.fixture
def broken_sampler() -> Iterator[SamplerSpec]:
    """Fails on one of the maps."""

    @register("broken")
    @dataclass(frozen=True)
    class Broken(LightSampler):
        """Raises on maps with a sun, else gives no light."""

        def _prepare(self, environment, count, rng):
            if environment.radiance.max() > 100.0:
                raise ZeroDivisionError("no\n  such luck")
            return DirectionalLights.none()

    yield SamplerSpec("broken")
    del REGISTERED["broken"]
