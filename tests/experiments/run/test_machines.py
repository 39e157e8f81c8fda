"""Times are compared within one kind of machine, and errors over all."""

from dataclasses import replace

import pandas as pd

from experiments.report.parts import Text
from experiments.report.summary import machine_sentence, summary, timed_alike
from experiments.report.write import closing
from experiments.run.machine import machine_kind, record
from samplers.threads import set_thread_count, thread_count
from tests.experiments.grid_rows import grid_run

SECONDS = {"fast": 1.0, "slow": 10.0}


def rows(machines):
    """Two samplers on one map each for every (machine of the first, machine of the second)."""
    return pd.DataFrame(
        {
            "scene": "vase", "environment": f"map{k}", "sampler": sampler, "budget": "lights=4",
            "seed": 0, "rmse": 1.0, "flip": 1.0, "lights": 4, "rays": 1.0, "rays_primary": 1,
            "rays_shadow": 1, "rays_brdf": 0, "rays_skipped": 0, "noise_floor": 0.0,
            "near_noise_floor": False, "over_budget": False, "repaired": 0,
            "seconds_lights": SECONDS[machine], "seconds_render": SECONDS[machine],
            "machine": machine,
        }
        for k, pair in enumerate(machines)
        for sampler, machine in zip(("a", "b"), pair, strict=True)
    )  # fmt: skip


def test_times_of_different_machines_are_never_averaged():
    table = summary(rows([("fast", "fast"), ("fast", "slow"), ("slow", "slow"), ("fast", "fast")]))
    assert list(table["seconds_render"]) == [1.0, 1.0]
    assert list(table["cases"]) == [4, 4]


def test_cases_that_two_machines_shared_have_no_times():
    table = summary(rows([("fast", "slow"), ("slow", "fast")]))
    assert table["seconds_lights"].isna().all()
    assert table["rmse"].notna().all()


def test_the_report_says_so():
    mixed = rows([("fast", "fast"), ("fast", "fast"), ("slow", "fast"), ("slow", "slow")])
    assert len(timed_alike(mixed)) == 4
    sentence = machine_sentence(mixed)
    assert "2 kinds of machine or share of one (fast; slow)" in sentence
    assert "over 4 of 8 measurements" in sentence
    assert machine_sentence(rows([("fast", "fast")])) == ""


def test_every_processor_that_measured_is_named_most_rows_first(tmp_path):
    run = grid_run(tmp_path, ("vase",), ("a", "b", "c"), ("mis",), lambda *_: (1.0, 1.0), (4,))
    kinds = {"a": "slow, 1 of 2 threads", "b": "fast, 2 of 2 threads", "c": "fast, 1 of 2 threads"}
    run = replace(run, rows=run.rows.assign(machine=run.rows["environment"].map(kinds)))
    assert run.processors == ["fast", "slow"]
    texts = [part.text for part in closing(run) if isinstance(part, Text)]
    assert any(text.startswith("fast and slow, ") for text in texts)
    alone = replace(run, rows=run.rows.drop(columns="machine"))
    assert alone.processors == [run.record["machine"]["processor"]]


def test_a_share_of_a_machine_is_a_kind_of_its_own():
    before = thread_count()
    kinds = set()
    try:
        for threads in (1, 2):
            set_thread_count(threads)
            kinds.add(machine_kind())
    finally:
        set_thread_count(before)
    assert len(kinds) == 2


def test_a_command_is_recorded_without_the_folders_of_its_machine(monkeypatch):
    monkeypatch.setattr(
        "sys.argv", ["x", "run", "table1", "--environments", "/a/b/maps", "--output", "runs/c"]
    )
    assert record()["command"] == "envlight run table1 --environments maps --output runs/c"
