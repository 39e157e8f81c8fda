"""What is said of a sampler that cannot go down to its budget."""

import pandas as pd

from experiments.report.sections.ranks import exceeded


def rows(*seconds, budget=1.0):
    return pd.DataFrame(
        {
            "sampler": "a", "budget": f"seconds={budget:g}", "count": 4,
            "seconds_render": seconds, "over_budget": [took > budget for took in seconds],
        }
    )  # fmt: skip


def test_the_shortest_and_the_longest_are_told():
    (line,) = exceeded(rows(0.9, 1.5, 1.7, 1.6))
    assert "number of lights, 4, " in line and "on 3 of 4 measurements: 1.5 to 1.7 s." in line


def test_one_that_took_longer_is_told_once():
    (line,) = exceeded(rows(0.9, 1.5))
    assert line.endswith("on 1 of 2 measurements: 1.5 s.")


def test_nothing_is_said_where_all_keep_the_budget():
    assert exceeded(rows(0.9, 0.8)) == []
