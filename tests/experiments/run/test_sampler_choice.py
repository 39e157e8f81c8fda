"""Samplers from the command line: lists, patterns, parameters, files."""

import linecache
import os
import pickle
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

from experiments.maps.patterns import split_list
from experiments.run import identity
from experiments.run.budget import Budget
from experiments.run.identity import source_digest
from experiments.run.measurement import Measurement
from experiments.run.sampler_spec import SamplerSpec, choose_samplers, parse_parameters
from experiments.run.store import Store
from samplers import EnvlightError, make_sampler, sampler_names
from tests.experiments.stored import run_measurements

FILE = '''"""A sampler of one light."""
from dataclasses import dataclass
from samplers import DirectionalLights, LightSampler
import helper_of_mine


@dataclass(frozen=True)
class OneLight(LightSampler):
    """One light overhead."""

    extent: float = 0.0

    def _prepare(self, environment, count, rng):
        return DirectionalLights([helper_of_mine.UP], [environment.total_flux], [self.extent])
'''


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "helper_of_mine.py").write_text("UP = [0.0, 1.0, 0.0]\n")
    path = tmp_path / "mine.py"
    path.write_text(FILE)
    return path


@pytest.fixture(autouse=True)
def own_folder(monkeypatch):
    """Folders of loaded files leave the search path with the test, and so do their modules."""
    monkeypatch.setattr(sys, "path", [*sys.path])
    identity._module.cache_clear()
    yield
    for name in ("helper_of_mine", "reader_of_mine"):
        sys.modules.pop(name, None)


@pytest.mark.parametrize(
    ("texts", "chosen"),
    [
        (["ours,mis", "uniform"], ["ours", "mis", "uniform"]),
        (["me*", "median-cut", "mis"], ["median-cut", "mis"]),
        (["[ku][dn]*"], ["kd-tree", "uniform"]),
        (["ours[upsampling=2]"], ["ours[upsampling=2]"]),
        (["ours[upsampling=4]", "ours"], ["ours"]),  # a default is not another sampler
        ([], sampler_names()),
    ],
)
def test_lists_patterns_and_parameters_choose_each_sampler_once(texts, chosen):
    assert [spec.label for spec in choose_samplers(texts)] == chosen


def test_commas_in_brackets_belong_to_the_parameters():
    assert split_list(["a[x=1,y=2],b", "c, d"]) == ["a[x=1,y=2]", "b", "c", "d"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("curs", "no sampler matches 'curs'; did you mean ours"),
        ("ours[upsample=2]", "no parameter 'upsample'; it has"),
        ("ours[upsampling=3]", "upsampling"),
        ("ours[upsampling=2,upsampling=4]", "it is given twice"),
        ("o*[upsampling=2]", r"no sampler is called 'o\*'"),
    ],
)
def test_what_is_wrong_is_named(text, said):
    with pytest.raises(EnvlightError, match=said):
        choose_samplers([text])


def test_values_are_literals_or_text():
    texts = ["a=1", "b=-2.5", "c=rounds", "d=True", "e=false", "f=None", "g=solid angle", "h=x=y"]
    assert dict(parse_parameters(texts)) == {
        "a": 1, "b": -2.5, "c": "rounds", "d": True, "e": False, "f": None, "g": "solid angle",
        "h": "x=y",
    }  # fmt: skip


@pytest.mark.parametrize("text", ["", "order", "=3", "2x=3", "a b=3", "a-b=1"])
def test_what_is_no_parameter_is_named(text):
    with pytest.raises(EnvlightError, match="write it as name=value"):
        parse_parameters([text])


@pytest.mark.parametrize("value", ["1e999999", "9" * 5000, "(" * 3000, "[" * 300 + "]" * 300])
def test_monstrous_values_end_in_a_sentence(value):
    with pytest.raises(EnvlightError, match="aspect"):
        make_sampler("median-cut", **dict(parse_parameters([f"aspect={value}"])))


def test_a_file_stands_beside_names(file):
    specs = choose_samplers([f"{file}:OneLight,{file}:OneLight[extent=0.1],mis"])
    assert [s.label for s in specs] == ["one-light", "one-light[extent=0.1]", "mis"]


def test_two_files_with_one_name_are_refused(file, tmp_path):
    (tmp_path / "other.py").write_text(FILE)
    with pytest.raises(EnvlightError, match=r"two samplers are called 'one-light': .*mine.py"):
        choose_samplers([f"{file}:OneLight", f"{tmp_path}/other.py:OneLight"])


def key_in_a_new_process(file: Path) -> str:
    code = (
        "import sys; from experiments.run.measurement import SamplerSpec; "
        "from experiments.run.identity import digest; "
        "print(digest(SamplerSpec(sys.argv[1]).identity))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, f"{file}:OneLight"], capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


@pytest.mark.parametrize(
    ("place", "imported"),
    [
        ("parts/deep/part.py", "from parts.deep import part"),  # no __init__.py is there
        ("../apart/part.py", "import sys; sys.path.append(FOLDER); import part"),
    ],
)
def test_what_is_not_installed_counts_wherever_it_lies(file, place, imported):
    part = file.parent / place
    part.parent.mkdir(parents=True)
    words = f"{imported} as helper_of_mine".replace("FOLDER", repr(str(part.parent)))
    file.write_text(FILE.replace("import helper_of_mine", words))
    keys = []
    for up in ("[0.0, 1.0, 0.0]", "[0.0, 0.0, 1.0]"):
        part.write_text(f"UP = {up}\n")
        keys.append(key_in_a_new_process(file))
    assert keys[0] != keys[1]


def test_the_source_counts_with_what_it_imports_beside_it_and_the_place_does_not(file, tmp_path):
    first = key_in_a_new_process(file)
    moved = tmp_path / "elsewhere"
    moved.mkdir()
    for name in ("mine.py", "helper_of_mine.py"):
        (moved / name).write_text((tmp_path / name).read_text())
    (tmp_path / "not_imported.py").write_text("x = 1\n")
    file.write_text(FILE + "# edited\n")
    edited = key_in_a_new_process(file)
    file.write_text(FILE)
    again = key_in_a_new_process(file)
    (tmp_path / "helper_of_mine.py").write_text("UP = [0.0, 0.0, 1.0]\n")
    helped = key_in_a_new_process(file)
    assert first == again
    assert len({first, edited, helped}) == 3
    libraries = SamplerSpec(f"{file}:OneLight").identity["libraries"]
    assert "helper_of_mine" not in libraries


def test_a_spec_is_small_and_reloads_in_another_process(file, grid, tmp_path):
    spec = SamplerSpec(f"{file}:OneLight")
    assert spec.sampler.name == "one-light"  # what is loaded here does not travel
    assert b"envlight_file_" not in pickle.dumps(spec)
    measurements = [
        Measurement(replace(measurement.case), spec, Budget(4), 0)
        for measurement in grid.measurements()
        if measurement.sampler.name == "uniform"
    ][:2]
    with (
        Store.writing(tmp_path / "run") as store,
        ProcessPoolExecutor(1, get_context("spawn")) as pool,
    ):
        outcome = run_measurements(store, measurements, executor=pool)
        assert (outcome.measured, outcome.failures) == (2, [])
        here = run_measurements(store, measurements)
        assert here.stored == 2


def test_a_file_edited_after_the_start_is_told(file):
    packed = pickle.dumps(SamplerSpec(f"{file}:OneLight"))
    file.write_text(FILE + "# edited\n")
    with pytest.raises(EnvlightError, match="the file has changed since the start; start again"):
        _ = pickle.loads(packed).sampler


READING = '''"""A sampler that reads a file."""
from dataclasses import dataclass
from pathlib import Path
import numpy as np
from samplers import DirectionalLights, LightSampler
{top}

@dataclass(frozen=True)
class OneLight(LightSampler):
    """One light."""

    def _prepare(self, environment, count, rng):
        up = {inside}
        return DirectionalLights([up], [environment.total_flux], [0.0])
'''
OPENED = {
    "at the top": ('UP = np.load(Path(__file__).with_suffix(".npy"))', "UP"),
    "by a file beside it": ("import reader_of_mine", "reader_of_mine.UP"),
    "later, by its name": ("", 'np.load(Path(__file__).parent / "mine.npy")'),
}
HELPER = """
import numpy as np
from pathlib import Path
UP = np.load(Path(__file__).parent / ("mine" + ".npy"))
"""


@pytest.fixture
def reading(tmp_path):
    """Writes a sampler that reads a file."""
    for name in ("mine", "other"):
        np.save(tmp_path / f"{name}.npy", [0.0, 1.0, 0.0])
    (tmp_path / "reader_of_mine.py").write_text(HELPER)

    def write(top, inside):
        (tmp_path / "mine.py").write_text(READING.format(top=top, inside=inside))
        return SamplerSpec(f"{tmp_path / 'mine.py'}:OneLight")

    return write


@pytest.mark.parametrize("how", OPENED)
def test_what_a_file_reads_counts_and_no_other_file_beside_it(tmp_path, reading, how):
    def source():
        identity._module.cache_clear()
        source_digest.cache_clear()
        return reading(*OPENED[how]).identity["programs"]

    first = source()
    np.save(tmp_path / "other.npy", [0.0, 0.0, 1.0])
    assert source() == first
    np.save(tmp_path / "mine.npy", [0.0, 0.0, 1.0])
    assert source() != first


@pytest.mark.parametrize("how", OPENED)
def test_what_counts_may_be_read(tmp_path, reading, grid, how):
    with Store.writing(tmp_path / "run") as store:
        assert run_measurements(store, with_sampler(reading(*OPENED[how]), grid)).failures == []


def test_a_measurement_reads_nothing_that_does_not_count(tmp_path, reading, grid):
    spec = reading("", 'np.load(Path(__file__).with_suffix(".npy"))')
    with Store.writing(tmp_path / "run") as store:
        (failure,) = run_measurements(store, with_sampler(spec, grid)).failures
    assert f"it opens {tmp_path / 'mine.npy'}, which is not among" in failure


def test_a_warning_may_show_its_line(tmp_path, reading, grid):
    linecache.clearcache()
    spec = reading(
        "import linecache", "[0.0, 1.0, float(bool(linecache.getline(__file__, 1))) - 1]"
    )
    with Store.writing(tmp_path / "run") as store:
        assert run_measurements(store, with_sampler(spec, grid)).failures == []


def test_kernels_of_its_own_are_kept(tmp_path, reading, grid):
    kernel = "import numba\n@numba.njit(cache=True)\ndef height():\n    return 1.0"
    spec = reading(kernel, "[0.0, height(), 0.0]")
    os.utime(tmp_path / "mine.py", (0, 0))  # nothing is kept of a file written after the start
    with Store.writing(tmp_path / "run") as store:
        assert run_measurements(store, with_sampler(spec, grid)).failures == []


def with_sampler(spec, grid):
    return [Measurement(grid.measurements()[0].case, spec, Budget(4), 0)]


def test_a_program_beside_a_sampler_reads_what_it_likes(tmp_path, reading):
    reading("", "[0.0, 1.0, 0.0]")
    (tmp_path / "program.py").write_text(
        "import numpy as np\n"
        "from samplers import EnvironmentMap, make_sampler\n"
        f"sampler = make_sampler('{tmp_path / 'mine.py'}:OneLight')\n"
        f"print(np.load('{tmp_path}/' + 'other' + '.npy')[1])\n"
        "world = EnvironmentMap.from_array(np.ones((2, 4, 3)))\n"
        "print(len(sampler.prepare(world, 4, np.random.default_rng(0))))\n"
    )
    done = subprocess.run(
        [sys.executable, tmp_path / "program.py"], capture_output=True, text=True, check=True,
        env={**os.environ, "PYTHONPATH": str(Path.cwd())},
    )  # fmt: skip
    assert done.stdout.split() == ["1.0", "1"]


def test_a_file_that_is_used_and_edited_after_the_start_is_told(tmp_path, reading):
    spec = reading(*OPENED["at the top"])
    (tmp_path / "spec").write_bytes(pickle.dumps(spec))
    np.save(tmp_path / "mine.npy", [0.0, 0.0, 1.0])
    code = "import pickle, sys; pickle.load(open(sys.argv[1], 'rb')).sampler"
    done = subprocess.run(
        [sys.executable, "-c", code, tmp_path / "spec"], capture_output=True, text=True
    )
    assert "a file that it uses has changed since the start; start again" in done.stderr
