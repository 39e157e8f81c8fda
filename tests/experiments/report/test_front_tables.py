"""The tables in README.md are those that the published rows give, line by line."""

import re
from pathlib import Path

import pytest

from experiments.report.rankings import results_of
from experiments.report.sentences import doubt, remarks, verdict
from experiments.report.summary import summary
from experiments.report.tables import print_summary
from experiments.run.loaded_run import Run

ROOT = Path(__file__).parents[3]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = {
    "table1-quick": "table1 · lights=16",
    "table1-paper-size": "table1 · seconds=0.9",
    "table1-paper-size-4s": "table1 · seconds=4",
}
"""The heading above a run's table, by the run's folder in results/."""


def lines_of(text: str, heading: str) -> list[list[str]]:
    """The words of the lines of the table below a heading, up to the first that is empty."""
    _, found, below = text.partition(heading)
    assert found, f"no table '{heading}'"
    body = re.split(r"\n\s*\n", below)[0]
    return [line.split() for line in body.splitlines() if re.search(r"\d", line)]


@pytest.mark.parametrize("run", BLOCKS)
def test_a_table_has_the_lines_of_the_published_rows(run, capsys):
    loaded = Run.load(ROOT / "results" / run)
    print_summary(summary(loaded.rows), loaded.record["experiment"])
    printed = lines_of(capsys.readouterr().out, BLOCKS[run])
    shown = lines_of(README, BLOCKS[run])
    assert len(shown) > 2 and all(line in printed for line in shown)


@pytest.mark.parametrize(
    ("run", "sentences"),
    [
        ("table1-paper-size", lambda ranking: [verdict(ranking), doubt(ranking)]),
        ("table1-paper-size-scenes", lambda ranking: [verdict(ranking)]),
        ("table1-paper-size-4s", remarks),
        ("table1-paper-size-scenes-4s", lambda ranking: [verdict(ranking)]),
    ],
)
def test_sentences_are_those_of_the_published_rows(run, sentences):
    (found,) = results_of(Run.load(ROOT / "results" / run))
    told = [sentence for ranking in found.rankings for sentence in sentences(ranking)]
    assert len([sentence for sentence in told if sentence]) >= 2
    assert all(sentence in " ".join(README.split()) for sentence in told)
