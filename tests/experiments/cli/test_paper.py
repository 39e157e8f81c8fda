"""What a paper takes from here: references, and a table that fits one column and compiles."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from experiments.cli.main import main
from experiments.cli.paper import in_words, paper_table
from experiments.report.tables import as_latex
from samplers import EnvlightError, sampler_class, sampler_names
from tests.experiments.report.ranking_rows import rows_of

ROOT = Path(__file__).parents[3]
PUBLISHED = ("table", str(ROOT / "results" / "table1-as-published"), "--samplers")
LONGEST = max(sampler_names(), key=lambda name: len(sampler_class(name).label))
ARTICLE = r"""\documentclass[twocolumn]{article}
\usepackage{array,booktabs}
\begin{document}
\input{table}
\end{document}
"""


def separated():
    """Twelve maps on which the first beats both others, by a factor that no map turns round."""
    k = np.arange(12)
    return rows_of({LONGEST: 0.1 + 0.01 * k, "mis": 0.2 + 0.01 * k, "ours": 0.3 + 0.01 * k},
                   scenes=("vase", "teapot"))  # fmt: skip


def printed(capsys, monkeypatch, *words: str) -> str:
    monkeypatch.setattr("sys.argv", ["envlight", *words])
    with pytest.raises(SystemExit) as end:
        main()
    assert not end.value.code
    return capsys.readouterr().out


def test_cite_prints_each_entry_once(capsys, monkeypatch):
    text = printed(capsys, monkeypatch, "cite", "ours*,ris*")
    keys = re.findall(r"^@\w+\{(\w+),$", text, re.MULTILINE)
    assert keys == ["wu2025", "talbot2005", "ciklabakkal2022"]
    assert "doi = {10.1111/cgf.15264}" in text


def test_the_list_of_methods_is_what_cite_prints():
    told = (ROOT / "samplers" / "README.md").read_text(encoding="utf-8")
    assert "\n".join(map(in_words, sampler_names())) in told, "envlight cite --words"


def test_nobody_is_bold_where_nobody_is_told_apart():
    """Two maps cannot tell anybody apart, and one sampler alone is better than nobody."""
    alone = paper_table(rows_of({"mis": [0.1, 0.2]}), ["flip"])
    assert alone.best == {} and alone.caption.endswith("by map.")
    made = paper_table(rows_of({"mis": [0.1, 0.2], "ours": [0.2, 0.3]}), ["flip", "flip_rank"])
    assert "textbf" not in as_latex(made)
    assert made.caption.endswith("No sampler is significantly different from the first.")


def test_who_is_over_the_budget_has_no_rank_and_the_caption_says_why():
    rows = separated().assign(budget="rays=2")
    assert "Without" not in paper_table(rows, ["flip", "flip_rank"]).caption
    rows.loc[rows["sampler"] == "ours", "rays_shadow"] *= 2
    caption = paper_table(rows, ["flip", "flip_rank"]).caption
    assert caption.endswith("Without a rank: more than 10 % over the budget.")


def test_a_column_that_is_not_there_is_told():
    with pytest.raises(EnvlightError, match="no column matches 'ssim'"):
        paper_table(separated(), ["ssim"])


def test_a_published_run_gives_a_table_of_the_chosen_at_the_budget_of_most_rows(
    capsys, monkeypatch
):
    text = printed(capsys, monkeypatch, *PUBLISHED, "ours,mis", "--columns", "rmse,render_ms")
    assert "Ours (Wu 2025) & " in text and "Median" not in text
    assert "at the rays of median-cut with 8 lights" in text


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="pdflatex is not installed")
@pytest.mark.parametrize("samplers", ["ours,variance-minimization", "*"])
def test_it_fits_one_column_of_an_article_and_compiles(tmp_path, capsys, monkeypatch, samplers):
    """With labels that stand in a line, and with parameters that need two."""
    text = printed(capsys, monkeypatch, *PUBLISHED, samplers)
    assert ("raggedright" in text) == (samplers == "*")
    (tmp_path / "table.tex").write_text(text, encoding="utf-8")
    (tmp_path / "main.tex").write_text(ARTICLE, encoding="utf-8")
    done = subprocess.run(
        ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "main.tex"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-2000:]
    assert "Overfull" not in done.stdout
