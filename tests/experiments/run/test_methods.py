"""The digest of the methods: of all that measures, and of nothing else."""

import shutil

import pytest

import metrics
import renderer
import samplers
from experiments.run import identity


@pytest.fixture
def copies(tmp_path, monkeypatch):
    """The three packages in another place, whose files may be changed."""
    for package in (samplers, renderer, metrics):
        name = package.__name__
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(package.__path__[0], tmp_path / name, ignore=ignored)
    monkeypatch.setattr(identity, "_package_folder", tmp_path.joinpath)
    return tmp_path


def test_a_copy_has_the_same_digest(copies, monkeypatch):
    moved = identity.methods_digest()
    monkeypatch.undo()
    assert moved == identity.methods_digest()


@pytest.mark.parametrize(
    ("file", "counts"),
    [
        ("samplers/median_cut.py", True),
        ("renderer/reference.py", True),
        ("metrics/errors.py", True),
        ("samplers/README.md", False),
        ("samplers/conformance/suite.py", False),
        ("renderer/__pycache__/more.py", False),
    ],
)
def test_what_measures_counts(copies, file, counts):
    before = identity.methods_digest()
    (copies / file).parent.mkdir(exist_ok=True)
    with (copies / file).open("a", encoding="utf-8") as opened:
        opened.write("\nanother = True\n")
    identity._source.cache_clear()
    assert (identity.methods_digest() != before) == counts
