"""Timing: interleaved rounds, quartiles, and what is said about noise."""

import numpy as np
import pandas as pd
import pytest

from experiments.run.bench import (
    Timing,
    interleaved,
    load_sentence,
    noise_sentence,
    time_used_sentence,
)


class Clock:
    """A clock that only tasks move."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def test_rounds_visit_all_tasks_in_turn():
    calls: list[str] = []
    tasks = {name: lambda name=name: calls.append(name) for name in "abc"}
    timings = interleaved(tasks, rounds=3, warm_up=2)
    assert "".join(calls) == "abc" * 5
    assert all(timing.rounds == 3 for timing in timings.values())


def test_warm_up_does_not_count():
    clock = Clock()
    lengths = iter([100.0, 1.0, 2.0, 3.0, 4.0, 5.0])

    def task() -> None:
        clock.now += next(lengths)

    timing = interleaved({"task": task}, rounds=5, warm_up=1, clock=clock)["task"]
    assert timing == Timing(median=3.0, lower=2.0, upper=4.0, rounds=5)


def test_slow_task_leaves_out_rounds_but_never_its_first():
    clock = Clock()

    def wait(seconds: float) -> None:
        clock.now += seconds

    tasks = {"slow": lambda: wait(10.0), "medium": lambda: wait(2.0), "fast": lambda: wait(0.1)}
    timings = interleaved(tasks, rounds=6, warm_up=0, most_seconds=5.0, clock=clock)
    assert [timings[name].rounds for name in tasks] == [1, 3, 6]


def test_spread_is_relative_to_the_median():
    timing = Timing.of(list(np.linspace(1.0, 3.0, 9)))
    assert timing.spread == pytest.approx(0.5)  # quartiles 1.5 and 2.5 of the median 2
    assert timing.columns("ms")["ms_upper"] == pytest.approx(2.5)


def test_noise_is_said_in_a_sentence():
    quiet = pd.DataFrame({"spread": [0.01, 0.19], "load_average": [0.5, 1.5]})
    noisy = pd.DataFrame({"spread": [0.01, 0.21], "load_average": [0.5, 7.5]})
    assert "Times repeat" in noise_sentence(quiet) and "1.5" in noise_sentence(quiet)
    assert "noisy: in 1 of 2 rows" in noise_sentence(noisy) and "7.5" in noise_sentence(noisy)


def test_what_was_timed_once_is_not_called_quiet():
    rows = pd.DataFrame({"spread": [0.0, 0.3], "rounds": [1, 7], "load_average": [0.5, 1.5]})
    assert "in 1 of 1 rows" in noise_sentence(rows)
    assert "(1 more were timed once" in noise_sentence(rows.assign(spread=0.1))
    assert noise_sentence(rows[:1]).startswith("Times were taken once per row")


def test_the_time_used_is_said_as_a_share_of_the_budget():
    rows = pd.DataFrame({"budget": "seconds=2", "seconds_render": [1.81, 1.9, 2.0, 2.19, 4.0]})
    rows["count"] = 99
    sentence = time_used_sentence(rows)
    assert sentence.startswith("At seconds=2 images took 1.000 of the budget in the median")
    assert sentence.endswith("4 of 5 (80.0 %) lie within 10 % of it.")


def test_counts_too_coarse_for_a_budget_are_told_apart():
    rows = pd.DataFrame({"budget": "seconds=2", "seconds_render": [1.5, 2.1, 2.0, 2.4, 1.9]})
    rows["count"] = [3, 5, 80, 70, 0]  # steps of .25, .21, .0125, .017, and one that has no more
    assert time_used_sentence(rows).endswith(
        "3 of 5 (60.0 %) lie within 10 % of it. In 3 rows one light or sample takes more than 20 % "
        "of the budget, so that no number of them need come as near; of the 2 others 1 (50.0 %) do."
    )
    assert "In " not in time_used_sentence(rows.assign(count=1))


def test_a_busy_machine_is_said_not_to_rank():
    assert load_sentence([0.5, 4.9], 4).endswith("load average of at most 4.9 on 4 cores.")
    assert load_sentence([9.1, 0.5], 4).endswith(
        "(load average up to 9.1 on 4 cores): do not rank by them."
    )
    assert "does not tell" in load_sentence([float("nan")], 4)
