"""LaTeX of the summary: the printed numbers, the best in bold, and it compiles."""

import re

import numpy as np
import pandas as pd
import pytest

from experiments.report.parts import Table
from experiments.report.rankings import results
from experiments.report.sections.ranks import ranked_table
from experiments.report.summary import ALIKE
from experiments.report.tables import as_latex, latex_escaped, text_of
from experiments.report.write import write_tables
from tests.experiments.report.ranking_rows import rows_of


def found_rows():
    """Over 20 maps "best_1" and "even" share the ranks 1 and 2, "worst%" is always last of four."""
    k = np.arange(20)
    return rows_of(
        {
            "best_1": list(0.10 + 0.001 * k),
            "even": list(0.10 + 0.001 * k + np.where(k % 5 == 0, -0.01, 0.01)),
            "third": list(0.30 + 0.002 * k),
            "worst%": list(0.40 + 0.003 * k),
        }
    )


@pytest.fixture(scope="module")
def found():
    """The table of these rows."""
    (result,) = results(found_rows())
    return ranked_table(result)


def lines_of(text: str) -> dict[str, list[str]]:
    body = text.split(r"\midrule")[1].split(r"\bottomrule")[0]
    words = [line.removesuffix(r" \\").split(" & ") for line in body.strip().splitlines()]
    return {line[0]: line[1:] for line in words}


def test_it_prints_the_numbers_of_the_other_tables(found):
    lines = lines_of(as_latex(found))
    plain = text_of(found)
    assert len(lines) == len(plain) == 4
    for row in plain.itertuples(index=False):
        printed = lines[latex_escaped(row[0])]
        stripped = [re.sub(r"\\textbf\{(.*)\}", r"\1", word).strip() for word in printed]
        assert stripped == [latex_escaped(value) for value in row[1:]]


def test_the_first_and_who_ties_with_it_are_bold_and_these_are_marked(found):
    lines = lines_of(as_latex(found))
    assert lines[r"best\_1"][0].startswith(r"\textbf{0.1095}")
    bold = [name for name, words in lines.items() if words[1].startswith(r"\textbf")]
    # "even" is 0.01 worse on 16 of 20 maps and 0.01 better on 4: Wilcoxon's p is 0.0105 or so,
    # which six pairs make 0.06 at most and 0.01 at least.
    marked = [name for name, words in lines.items() if latex_escaped(ALIKE) in words]
    p = results(found_rows())[0].rankings[0].pairs.p_value[0, 1]
    assert marked == (["even"] if p > 0.05 else []) and bold == [r"best\_1", *marked]


def test_equal_values_are_bold_together_and_nobody_where_the_test_separates_nobody():
    same = list(0.1 + 0.01 * np.arange(12))
    (result,) = results(rows_of({"a": same, "b": same, "c": [1.0] * 12}))
    text = as_latex(ranked_table(result))
    bold = {name for name, words in lines_of(text).items() if words[0].startswith(r"\textbf")}
    assert bold == {"a", "b"}
    # Two maps cannot tell three samplers apart: p is at least 3 pairs × 2 / 2^2.
    (few,) = results(rows_of({"a": [0.1, 0.2], "b": [0.1, 0.2], "c": [1.0, 1.0]}))
    assert "textbf" not in as_latex(ranked_table(few))


def test_a_heading_may_have_brackets_and_braces():
    """As that of ratios to a sampler with parameters has."""
    table = Table("t", pd.DataFrame({"a": ["x"], "b": [1]}), {"a": "s", "b": "d"},
                  {"a": "who", "b": "× mis[numbers={0}]"})  # fmt: skip
    assert r"who & $\times$ mis{[}numbers=\{0\}{]} \\" in as_latex(table)


def test_special_characters_are_escaped():
    assert latex_escaped(r"a_b%&#$ {x}\~^") == (
        r"a\_b\%\&\#\$ \{x\}\textbackslash{}\textasciitilde{}\textasciicircum{}"
    )


def test_what_a_report_leaves_out_is_no_latex(tmp_path):
    """Of a stem whose tables are all left out there is CSV alone; of others, all rows are in it."""
    rows = pd.DataFrame({"k": [1]})
    tables = [
        Table("some", rows, {"k": "d"}),
        Table("some", rows, {"k": "d"}, caption="Left out.", shown=False),
        Table("none", rows, {"k": "d"}, shown=False),
    ]
    written = {path.name for path in write_tables(tables, tmp_path)}
    assert written == {"some.csv", "some.tex", "none.csv"} == {f.name for f in tmp_path.iterdir()}
    assert "Left out." not in (tmp_path / "some.tex").read_text(encoding="utf-8")
    assert len(pd.read_csv(tmp_path / "some.csv")) == 2
