"""The tables in README.md are those that the published rows give, line by line."""

import re
from pathlib import Path

import pytest

from experiments.report.rankings import results_of
from experiments.report.sentences import remarks
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


def test_what_is_near_the_noise_is_that_of_the_published_rows():
    (found,) = results_of(Run.load(ROOT / "results" / "table1-paper-size-4s"))
    told = [sentence for ranking in found.rankings for sentence in remarks(ranking)]
    assert len(told) == 2 and all(sentence in " ".join(README.split()) for sentence in told)
