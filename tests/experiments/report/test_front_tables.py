"""The answer in README.md is what the published rows give, line by line."""

import re
from pathlib import Path

from experiments.report.across_runs import openings
from experiments.report.parts import Table, Text
from experiments.report.write import as_text
from experiments.run.loaded_run import Run
from samplers import sampler_class

ROOT = Path(__file__).parents[3]
README = (ROOT / "README.md").read_text(encoding="utf-8")
OPENING = "convergence", "table1-as-published"


def test_the_answer_and_whether_the_paper_is_reproduced_stand_first_as_the_rows_have_them():
    found = openings([Run.load(ROOT / "results" / name) for name in OPENING])
    parts = [part for _, told in found for part in told]
    told = [" ".join(part.text.split()) for part in parts if isinstance(part, Text)]
    answer = next(part for part in parts if isinstance(part, Table))
    first_screen = "\n".join(README.splitlines()[:45])
    assert len(told) == 4 and as_text(answer).strip() in first_screen
    assert all(sentence in " ".join(first_screen.split()) for sentence in told)


def test_the_figures_of_the_answer_are_means_of_rows():
    """From the rows by themselves: each error is one of its sampler's, and is so many times one of
    median cut's."""
    rows = Run.load(ROOT / "results" / "convergence").rows
    maps = rows.groupby(["sampler", "budget", "environment"])[["flip", "rmse"]].mean()
    means = maps.groupby(["sampler", "budget"]).mean()
    labels = {sampler_class(name).label: name for name in means.index.unique("sampler")}
    _, _, below = README.partition("| time ")
    cells = re.findall(r"\| ([^|]+?) (\d\.\d{3})(?: \((\d\.\d\d)\))? +(?=\|)", below)
    assert cells and len(cells) % 4 == 0
    for k, (label, error, times) in enumerate(cells):
        metric = "rmse" if k % 4 >= 2 else "flip"
        first = next(name for text, name in labels.items() if label.startswith(text))
        own, base = (means[metric][name] for name in (first, "median-cut"))
        found = [one for one in own if f"{one:.3f}" == error]
        assert found, (label, error)
        assert not times or any(f"{one / other:.2f}" == times for one in found for other in base)


def test_readme_is_short():
    assert len(README.splitlines()) <= 130
