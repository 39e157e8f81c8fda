"""LaTeX of the summary: the printed numbers, the best in bold, ties marked, and it compiles."""

import re
import shutil
import subprocess

import numpy as np
import pandas as pd
import pytest

from experiments.report.full_table import full_table
from experiments.report.latex import escaped, latex
from experiments.report.rankings import results


def rows_of(errors: dict[str, list[float]]) -> pd.DataFrame:
    """One scene, one map per error; FLIP is half of RMSE."""
    return pd.DataFrame(
        [
            {
                "scene": "vase", "environment": f"map_{k:02d}", "sampler": sampler,
                "budget": "lights=4", "seed": 0, "rmse": error, "flip": 0.5 * error, "lights": 4,
                "rays_shadow": 10, "rays_brdf": 0, "rays_primary": 5, "seconds_lights": 0.001,
                "seconds_render": 0.1 * len(sampler), "near_noise_floor": False,
                "noise_floor": 0.01, "over_budget": False,
            }
            for sampler, values in errors.items()
            for k, error in enumerate(values)
        ]
    )  # fmt: skip


@pytest.fixture(scope="module")
def found():
    """Over 20 maps "best_1" and "even" share the ranks 1 and 2, "worst%" is always last of four."""
    k = np.arange(20)
    return results(
        rows_of(
            {
                "best_1": list(0.10 + 0.001 * k),
                "even": list(0.10 + 0.001 * k + np.where(k % 5 == 0, -0.01, 0.01)),
                "third": list(0.30 + 0.002 * k),
                "worst%": list(0.40 + 0.003 * k),
            }
        )
    )


def lines_of(text: str) -> dict[str, list[str]]:
    body = text.split(r"\midrule")[1].split(r"\bottomrule")[0]
    measurements = [line.removesuffix(r" \\").split(" & ") for line in body.strip().splitlines()]
    return {line[0]: line[1:] for line in measurements}


def test_it_prints_the_numbers_of_the_other_tables(found):
    lines = lines_of(latex(found))
    plain = full_table(found[0].table)
    assert len(lines) == len(plain) == 4
    for row in plain.itertuples(index=False):
        printed = lines[escaped(row[0])]
        stripped = [re.sub(r"\\textbf\{(.*)\}", r"\1", measurement) for measurement in printed]
        stripped = [measurement.replace(r"$^\dagger$", "") for measurement in stripped]
        assert stripped == [escaped(value) for value in row[1:]]


def test_the_best_is_bold_and_its_ties_are_marked(found):
    lines = lines_of(latex(found))
    assert lines[r"best\_1"][0].startswith(r"\textbf{0.1095}")
    bold = [name for name, measurements in lines.items() if measurements[1].startswith(r"\textbf")]
    assert bold == [r"best\_1"]
    # Mean ranks 1.2 and 1.8 lie 0.6 apart, 3 lies 1.8 from 1.2; the critical difference for four
    # samplers on 20 maps is 2.569 √(4 · 5 / 120) = 1.05.
    assert found[0].rmse.difference == pytest.approx(1.049, abs=1e-3)
    marked = [name for name, measurements in lines.items() if "dagger" in measurements[1]]
    assert marked == ["even"]


def test_equal_values_are_bold_together():
    same = [0.1, 0.2, 0.3]
    text = latex(results(rows_of({"a": same, "b": same, "c": [1.0, 1.0, 1.0]})))
    bold = {
        name
        for name, measurements in lines_of(text).items()
        if measurements[0].startswith(r"\textbf")
    }
    assert bold == {"a", "b"}


def test_special_characters_are_escaped():
    assert escaped(r"a_b%&#$ {x}\~^") == (
        r"a\_b\%\&\#\$ \{x\}\textbackslash{}\textasciitilde{}\textasciicircum{}"
    )


def test_it_is_the_same_each_time(found):
    rows = rows_of({"a": [0.1, 0.3], "b": [0.2, 0.1], "c": [0.4, 0.4]})
    assert latex(results(rows)) == latex(results(rows))


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="pdflatex is not installed")
def test_it_compiles(found, tmp_path):
    (tmp_path / "summary.tex").write_text(latex(found), encoding="utf-8")
    (tmp_path / "main.tex").write_text(
        "\\documentclass{article}\n\\usepackage[landscape]{geometry}\n\\usepackage{booktabs}\n"
        "\\begin{document}\n\\input{summary}\n\\end{document}\n",
        encoding="utf-8",
    )
    done = subprocess.run(
        ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "main.tex"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-2000:]
    assert (tmp_path / "main.pdf").stat().st_size > 1000
