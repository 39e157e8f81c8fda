"""A digest of source follows everything that the source uses, and nothing else."""

import importlib.metadata
import os
import subprocess
import sys

import pytest

from experiments.run import identity
from experiments.run.identity import dependencies, digest, library_versions, source_digest

FILES = {
    "plug/__init__.py": "",
    "plug/sampler.py": "from .helper import help_out\nfrom plug import late_user\n",
    "plug/helper.py": "def help_out(): ...\n",
    "plug/late_user.py": "def later():\n    from plug.inner import deep\n    return 'table.npy'\n",
    "plug/inner/__init__.py": "import plug.inner.shared\n",
    "plug/inner/deep.py": "import numpy\nimport no_such_module\n",
    "plug/inner/shared.py": "",
    "plug/unrelated.py": "import plug.sampler\n",
    "plug/data/table.npy": "numbers",
    "plug/data/other.npy": "numbers",
}
USED = {name for name in FILES if "unrelated" not in name and "other" not in name}


def forget():
    identity._module.cache_clear()
    identity._source.cache_clear()
    source_digest.cache_clear()
    library_versions.cache_clear()


@pytest.fixture
def package(tmp_path, monkeypatch):
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    forget()
    yield tmp_path
    forget()
    for name in [name for name in sys.modules if name.split(".")[0] == "plug"]:
        del sys.modules[name]


def test_dependencies_are_followed_through_functions_packages_and_data(package):
    found = {str(path.relative_to(package)) for path in dependencies("plug.sampler").values()}
    assert found == USED


@pytest.mark.parametrize("name", sorted(FILES))
def test_an_edit_counts_exactly_where_the_file_is_used(package, name):
    before = source_digest("plug.sampler")
    with (package / name).open("a", encoding="utf-8") as file:
        file.write("\nedited = True\n")
    forget()
    assert (source_digest("plug.sampler") != before) == (name in USED)


def test_no_report_counts_with_what_maps_and_scores_depend_on():
    modules = ("experiments.maps.places", "experiments.maps.features", "metrics.flip")
    others = [name for name in dependencies(*modules) if name.startswith("experiments.")]
    assert all(name.startswith("experiments.maps") for name in others)


WORDED = '"""Of {words}."""\n\ndef half(x):  # {words}\n    """{words}"""\n    return {value}\n'


@pytest.mark.parametrize(
    ("words", "value", "counts"),
    [
        ("one", "0.5 * x", False),
        ("two", "0.5 * x", False),
        ("one", "(0.5\n        * x)", False),
        ("one", "x * 0.5", True),
        ("one", "0.25 * x", True),
        ("one", "None", True),
        ("one", "'0.5 * x'", True),
    ],
)
def test_of_source_the_program_counts_alone(package, words, value, counts):
    file = package / "plug" / "helper.py"
    file.write_text(WORDED.format(words="one", value="0.5 * x"), encoding="utf-8")
    forget()
    before = source_digest("plug.sampler")
    file.write_text(WORDED.format(words=words, value=value), encoding="utf-8")
    forget()
    assert (source_digest("plug.sampler") != before) == counts


def test_source_may_be_written_in_any_encoding_that_it_names(package):
    file = package / "plug" / "helper.py"
    file.write_bytes("# -*- coding: latin-1 -*-\nNAME = 'ü'\n".encode("latin-1"))
    forget()
    assert source_digest("plug.sampler")


def test_samplers_do_not_depend_on_each_other():
    found = dependencies("samplers.median_cut")
    assert "samplers.grids.regions" in found
    assert not {"samplers.inversion", "samplers.kd_tree", "samplers.uniform"} & set(found)


def test_data_counts_for_the_samplers_that_use_it_alone():
    def data(module):
        return {path.name for path in dependencies(module).values() if path.suffix != ".py"}

    assert "penrose_corrections.npy" in data("samplers.fhis")
    assert data("samplers.median_cut") == set()


def test_digests_are_the_same_in_another_process():
    code = (
        "from experiments.run.identity import digest, source_digest; "
        "print(source_digest('samplers.median_cut'), digest({'b': [1, 'ü'], 'a': None}))"
    )
    environment = {**os.environ, "PYTHONHASHSEED": "17"}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment
    )
    here = [source_digest("samplers.median_cut"), digest({"a": None, "b": [1, "ü"]})]
    assert done.stdout.split() == here


def test_libraries_are_those_that_the_source_imports(package):
    assert library_versions("plug.sampler") == {
        "no_such_module": "none",
        "numpy": importlib.metadata.version("numpy"),
    }


@pytest.mark.parametrize(
    ("module", "needed"),
    [
        ("renderer.render", {"numpy", "numba", "llvmlite", "embreex"}),
        ("renderer.reference", {"numpy", "numba", "embreex", "OpenEXR", "OpenImageIO"}),
        ("samplers.fhis", {"numpy", "numba", "scipy"}),
        ("experiments.maps.places", {"numpy", "colour"}),
    ],
)
def test_libraries_are_known_by_version(module, needed):
    versions = library_versions(module)
    assert needed <= set(versions)
    missing = {name for name, version in versions.items() if version == "none"}
    assert missing <= {"pyoidn"}  # which an extra brings
