"""A column of the summary is said once: what it names is printed everywhere."""

import pandas as pd

from experiments.report import summary as described
from experiments.report.rankings import results
from experiments.report.sections.ranks import ranked_table
from experiments.report.summary import COSTS, Column, summary
from experiments.report.tables import as_latex, as_markdown, print_summary
from experiments.report.write import write_tables
from tests.experiments.report.ranking_rows import rows_of

OWN = Column(
    "cast", "rays cast", ".0f", "cast", of=lambda rows: 1e3 * rows["rays_shadow"], better="less"
)


def test_another_column_is_one_entry(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(described, "COSTS", (*COSTS, OWN))
    rows = rows_of({"a": [0.1, 0.2], "b": [0.3, 0.4]})
    rows["rays_shadow"] = [4, 8, 20, 30]
    (result,) = results(rows)
    table = ranked_table(result)
    write_tables([table], tmp_path)
    written = pd.read_csv(tmp_path / "summary.csv").set_index("sampler")["cast"]
    assert written.to_dict() == {"a": 6000.0, "b": 25000.0}
    print_summary(summary(rows), "t")
    on_terminal = capsys.readouterr().out
    for text in (as_markdown(table), as_latex(table)):
        assert "rays cast" in text and "6000" in text and " 25000 " in text
    assert " cast" in on_terminal and " 25000" in on_terminal
