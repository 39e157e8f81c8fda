"""CITATION.cff has the keys of its format, the version of the project and the four papers."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

from experiments.report.pages.citation import read_citation
from samplers import EnvlightError

ROOT = Path(__file__).parents[4]
FILE = ROOT / "CITATION.cff"


@pytest.fixture(scope="module")
def citation() -> dict:
    return yaml.safe_load(FILE.read_text(encoding="utf-8"))


def test_the_keys_that_the_format_asks_for_are_there(citation):
    assert {"cff-version", "message", "title", "authors", "type", "version"} <= set(citation)
    assert citation["cff-version"] == "1.2.0" and citation["type"] == "software"
    for one in (citation, *citation["references"]):
        assert one["title"] and one["authors"]
        for author in one["authors"]:
            assert set(author) in ({"name"}, {"given-names", "family-names"})
    for one in citation["references"]:
        assert one["type"] in ("article", "conference-paper", "report")
        assert isinstance(one["year"], int)
        assert re.fullmatch(r"10\.\d{4,9}/\S+", one.get("doi", "10.1000/none"))


def test_the_version_is_the_projects_and_the_changelogs(citation):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert citation["version"] == project["version"]
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.findall(r"^## (\S+)", changes, re.MULTILINE)[0] == project["version"]


def test_the_four_papers_are_references(citation):
    first = [one["authors"][0]["family-names"] for one in citation["references"]]
    assert first == ["Wu", "Ergun", "Arbree", "Wan"]


def test_sources_in_words_and_as_bibtex():
    project, wu, *_ = read_citation(FILE)
    assert project.words.startswith("The envlight authors: envlight")
    assert project.bibtex.startswith("@software{envlight")
    assert "Yu-Ting Wu: Efficient environment map rendering" in wu.words
    assert "  journal = {Computer Graphics Forum}," in wu.bibtex
    assert wu.bibtex.startswith("@article{wu2025,") and wu.bibtex.endswith("}")


def test_another_file_is_refused_by_a_sentence(tmp_path):
    for text in ("- a\n- b\n", "title: x\n", "a: [", ""):
        (tmp_path / "CITATION.cff").write_text(text)
        with pytest.raises(EnvlightError, match="not in the Citation File Format"):
            read_citation(tmp_path / "CITATION.cff")
