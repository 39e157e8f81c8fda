"""The examples run as they stand: a script, and a package that is built and installed."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from samplers.files.image_file import read_radiance

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"


def run(*words: object, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *map(str, words)],
        capture_output=True,
        text=True,
        env={**os.environ, **environment},
    )


def test_the_tour_runs_and_writes_its_image(tmp_path):
    done = run(EXAMPLES / "library_tour.py", tmp_path)
    assert done.returncode == 0, done.stderr
    assert "median-cut   RMSE" in done.stdout
    image = read_radiance(tmp_path / "three-boxes.exr")
    assert image.shape == (72, 96, 3) and np.isfinite(image).all()


def test_the_tour_reads_a_published_folder():
    done = run(EXAMPLES / "library_tour.py", ROOT / "results" / "table2")
    assert done.returncode == 0, done.stderr
    assert "ours" in done.stdout.rsplit("Run(", 1)[1]
    assert not list((ROOT / "results" / "table2").glob("*.exr"))


def test_a_file_that_hides_a_package_is_named(tmp_path):
    (tmp_path / "metrics.py").write_text("mine = 1\n", encoding="utf-8")
    (tmp_path / "use.py").write_text("import samplers\n", encoding="utf-8")
    done = run(tmp_path / "use.py", PYTHONPATH=str(ROOT))
    assert done.returncode == 0
    assert f"{tmp_path / 'metrics.py'} hides envlight's package 'metrics'" in done.stderr
    command = run("-P", "-m", "experiments.cli.main", "list", PYTHONPATH=str(ROOT))
    assert command.returncode == 0 and not command.stderr


@pytest.fixture(scope="module")
def installed(tmp_path_factory) -> str:
    """The external package, built from a copy and installed into a folder, without a network."""
    source = tmp_path_factory.mktemp("source")
    for file in (EXAMPLES / "external_sampler").iterdir():
        if file.is_file():
            (source / file.name).write_bytes(file.read_bytes())
    target = tmp_path_factory.mktemp("target")
    options = ("--quiet", "--no-index", "--no-deps", "--no-build-isolation")
    done = run("-m", "pip", "install", *options, "--target", target, source)
    if "Cannot import 'setuptools" in done.stderr:
        pytest.skip("setuptools is not installed, which builds the example")
    assert done.returncode == 0, done.stderr
    return str(target)


def test_an_installed_package_adds_its_sampler(installed):
    code = (
        "from samplers import make_sampler, sampler_names\n"
        "assert 'brightest-texels' in sampler_names()\n"
        "print(type(make_sampler('brightest-texels')).__module__)"
    )
    done = run("-c", code, PYTHONPATH=installed)
    assert (done.returncode, done.stdout.strip()) == (0, "brightest_texels"), done.stderr


def test_its_sampler_passes_the_checks_but_the_one_its_readme_allows(installed):
    words = ("-m", "experiments.cli.main", "check", "brightest-texels", "--allow", "irradiance")
    done = run(*words, PYTHONPATH=installed)
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_package_that_cannot_be_loaded_is_named(installed, tmp_path):
    (tmp_path / "brightest_texels.py").write_text("import no_such_module\n")
    path = os.pathsep.join([str(tmp_path), installed])
    done = run("-m", "experiments.cli.main", "list", "samplers", PYTHONPATH=path)
    assert done.returncode == 2
    assert "envlight: sampler 'brightest-texels': brightest_texels:BrightestTexels" in done.stderr
    assert "mend or uninstall the package" in done.stderr
