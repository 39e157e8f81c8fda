"""Labels and references: every sampler says by whom it is, and BibTeX can read it."""

import re
from dataclasses import dataclass

import pytest

from samplers import LightSampler, register, sampler_class, sampler_names
from samplers.base import REGISTERED
from samplers.decomposition import Decomposition
from samplers.reference import VENUE_FIELD, Reference

WIDEST = 32
"""Letters of a label: the terminal's tables have 100 columns, of which 68 are figures."""


@pytest.mark.parametrize("name", sampler_names())
def test_a_label_names_the_first_author_and_the_year_of_the_reference(name):
    found = sampler_class(name)
    assert 0 < len(found.label) <= WIDEST
    if found.references and "envlight" not in found.label:
        assert found.label.endswith(f" ({found.references[0].short})")


def test_labels_tell_all_samplers_apart():
    labels = [sampler_class(name).label for name in sampler_names()]
    assert len(set(labels)) == len(labels)


def test_one_key_stands_for_one_entry():
    entries = {one for name in sampler_names() for one in sampler_class(name).references}
    assert len({one.key for one in entries}) == len(entries)
    for one in entries:
        assert one.kind in VENUE_FIELD and re.fullmatch(r"[a-z0-9]+\d{4}", one.key)
        assert not one.doi or re.fullmatch(r"10\.\d{4,}/\S+", one.doi)


def test_an_entry_has_what_is_known_and_no_more():
    journal = Reference("Ann Ó Brien, Bob Two", "A Title", "Some Journal", 2001, "article", "3(4)")
    assert journal.key == "brien2001" and journal.short == "Brien 2001"
    assert journal.bibtex == (
        "@article{brien2001,\n  author = {Ann Ó Brien and Bob Two},\n  title = {{A Title}},\n"
        "  journal = {Some Journal},\n  volume = {3},\n  number = {4},\n  year = {2001},\n}"
    )
    report = Reference("A B", "T", "U", 1999, "techreport", "TR1", url="https://e.org")
    assert "number = {TR1}" in report.bibtex and "volume" not in report.bibtex
    assert report.words == "A B: T. U TR1, 1999. https://e.org"


def test_a_sampler_without_a_label_goes_by_its_name_and_not_by_its_parents():
    @dataclass(frozen=True)
    class Mine(Decomposition):
        pass

    try:
        assert register("mine-of-a-test")(Mine).label == "mine-of-a-test"
    finally:
        del REGISTERED["mine-of-a-test"]
    assert LightSampler.label == ""
