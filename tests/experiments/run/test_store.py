"""The store keeps what is committed, is one for all runs beside it, and says what is wrong."""

import os
import subprocess
import sys

import numpy as np
import pytest

from experiments.run.identity import Shared
from experiments.run.store import (
    DATABASE,
    IMAGE,
    PLAN,
    REFERENCE,
    Planned,
    Store,
    StoreError,
    store_of,
)

CASE = Shared({"scene": "vase"})
IDENTITY, RESULT = {"case": CASE}, {"count": 3, "psnr": float("inf"), "name": "Q²"}
SCORES = {"s": {"flip": 0.3}}


@pytest.fixture
def run(tmp_path):
    return tmp_path / "deep" / "run"


def begun(store, plan=()):
    store.begin({"command": "first"}, ["table1", "tiny"], list(plan))


def test_a_result_comes_back_as_it_went_in(run):
    with Store.writing(run) as store:
        begun(store)
        store.put(IMAGE, "k", IDENTITY, RESULT, SCORES)
        store.put(REFERENCE, "r", IDENTITY, {"noise_floor": 0.5})
    with Store.reading(run) as store:
        found = store.get("k")
        assert (found.result, found.scores, found.start) == (RESULT, SCORES, 1)
        assert store.shared(found.identity["case"]) == CASE.value
        assert store.get("r").result == {"noise_floor": 0.5}
        assert store.get("other") is None
        assert (store.count(IMAGE), store.count(IMAGE, REFERENCE)) == (1, 2)


def test_a_result_is_never_overwritten_and_scores_are_added(run):
    with Store.writing(run) as store:
        store.put(IMAGE, "k", IDENTITY, RESULT, SCORES)
        store.put(IMAGE, "k", {"seed": 1}, {"count": 4}, {"t": {"rmse": 0.1}})
        found = store.get("k")
        assert (found.result, found.scores) == (RESULT, SCORES | {"t": {"rmse": 0.1}})
        assert store.shared(found.identity["case"]) == CASE.value


def test_a_row_is_put_together_of_whole_parts_alone(run):
    with Store.writing(run) as store:
        store.put(IMAGE, "k", IDENTITY, {**RESULT, "pixels": "p"}, SCORES)
        store.put(REFERENCE, "f", IDENTITY, {"map_entropy": 0.5})
        one = Planned("k", "r", ("s",), ("f",))
        plan = [one, Planned("l"), Planned("k"), Planned("k", "r", ("t",)),
                Planned("k", "r", ("s",), ("g",))]  # fmt: skip
        assert [store.finished([part]) for part in plan] == [[True], [False], [True], [False],
                                                             [False]]  # fmt: skip
        assert list(store.rows([one])) == [
            {"key": "k", "reference": "r", **RESULT, "flip": 0.3, "map_entropy": 0.5}
        ]
        assert [list(store.rows([part])) for part in plan[1:]] == [[], [RESULT], [], []]


def test_a_row_is_there_for_others_when_put_returns(run):
    with Store.writing(run) as store, Store.writing(run.parent / "other") as other:
        store.put(IMAGE, "k", IDENTITY, RESULT)
        assert other.get("k").result == RESULT
        other.put(IMAGE, "l", IDENTITY, RESULT)
        assert store.get("l").result == RESULT
        assert store.folder == other.folder == run.parent / "store"


def test_the_newest_start_decides_the_plan(run):
    plan = [Planned("c", "r", ("s",), ("f",)), Planned("d", "r", ("s",), ("f",)), Planned("a")]
    with Store.writing(run) as store:
        begun(store, map(Planned, "abc"))
        store.begin({"command": "second"}, ["table1", "tiny"], plan)
    with Store.reading(run) as store:
        assert store.plan == plan and store.selection.about == ["table1", "tiny"]
        assert [one["command"] for one in store.starts().values()] == ["first", "second"]


def test_the_results_may_be_elsewhere_and_their_place_is_remembered(run, tmp_path):
    with Store.writing(run, tmp_path / "all") as store:
        begun(store)
        store.put(IMAGE, "k", IDENTITY, RESULT)
    assert not (run.parent / "store").exists()
    assert store_of(run).samefile(tmp_path / "all")
    with Store.reading(run) as store:
        assert store.get("k").result == RESULT


def test_left_over_files_of_a_killed_process_go_and_others_stay(run):
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    store = run.parent / "store"
    gone = [run / f".measurements.{dead.pid}.csv", store / "images" / f".mis_1.5.{dead.pid}.exr"]
    kept = [run / ".gitignore", run / "notes" / f".x.{dead.pid}.exr", store / "images" / "a.exr",
            store / "images" / f".beside.{os.getppid()}.exr"]  # fmt: skip
    for file in gone + kept:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    with Store.writing(run):
        assert not any(file.exists() for file in gone)
        assert all(file.exists() for file in kept)


def _filled(run):
    """What a store of many rows holds."""
    with Store.writing(run) as store:
        begun(store, [Planned(f"k{n:02}", "r", ("s",)) for n in range(40)])
        store.put(REFERENCE, "r", IDENTITY, RESULT)
        for n in range(40):
            store.put(IMAGE, f"k{n:02}", IDENTITY, {"count": n}, {"s": {"rmse": n / 7.0}})
        store._all("PRAGMA wal_checkpoint(TRUNCATE)")
        return _held(store)


def _held(store):
    rows = {row["key"]: row for row in store.rows(store.plan)}
    reference = store.get("r")
    return rows | (
        {"r": (reference.result, store.shared(reference.identity["case"]))} if reference else {}
    )


def test_of_a_damaged_database_nothing_else_comes_than_was_stored(run, capsys):
    before = _filled(run)
    file = run.parent / "store" / DATABASE
    whole = file.read_bytes()
    rng = np.random.default_rng(5)
    told = 0
    for k in range(160):
        damaged = bytearray(whole)
        for place in rng.integers(0, len(whole), 4):
            damaged[place] ^= int(rng.integers(1, 256)) if k < 120 else 0
        if k >= 120:  # a page of nothing
            damaged[4096 * (k % 40) : 4096 * (k % 40 + 1)] = bytes(4096)
        file.write_bytes(damaged)
        try:
            with Store.reading(run) as store:
                held = _held(store)
                starts = list(store.starts().values())
        except StoreError:
            continue
        said = "damaged" in capsys.readouterr().err
        assert said or held.keys() == before.keys()
        identity = held.pop("r", None)
        assert held.items() <= before.items()
        assert identity in (None, before["r"], (RESULT, CASE.key))
        assert starts in ([], [{"command": "first"}])
        told += said
    assert told > 20


@pytest.mark.parametrize("column", ["key", "kind", "identity", "result", "scores", "start"])
def test_a_damaged_row_is_missing_told_and_measured_again(run, capsys, column):
    with Store.writing(run) as store:
        begun(store)
        store.put(IMAGE, "k", IDENTITY, RESULT)
        store.put(IMAGE, "l", IDENTITY, RESULT)
        store._all(
            f"UPDATE result SET {column} = ? WHERE key = 'k'", 9 if column == "start" else "x"
        )
    with Store.writing(run) as store:
        assert store.get("k") is None and store.get("x") is None
        assert [one.key for one in store.results(IMAGE)] == ["l"]
        assert "stored results are damaged" in capsys.readouterr().err or column == "key"
        store.put(IMAGE, "k", IDENTITY, {"rmse": 0.2})
        assert store.get("k").result == {"rmse": 0.2}


def test_a_damaged_plan_is_told(run, capsys):
    with Store.writing(run) as store:
        begun(store, [Planned("k")])
    text = (run / PLAN).read_text()
    for other in (text.replace('"k"', '"l"'), text[:-9], "", "[]"):
        (run / PLAN).write_text(other)
        with Store.reading(run) as store:
            assert store.plan == []
        assert "the list of measurements is damaged; give the command" in capsys.readouterr().err


def test_results_of_another_version_are_refused(run):
    with Store.writing(run) as store:
        begun(store)
        store._all("PRAGMA user_version = 0")
    for opened in (Store.reading, Store.writing):
        with pytest.raises(StoreError, match="another version"), opened(run):
            pass


@pytest.mark.parametrize("damage", ["empty", "of another kind", "cut"])
def test_a_damaged_database_is_named(run, damage):
    _filled(run)
    file = run.parent / "store" / DATABASE
    half = file.read_bytes()[: file.stat().st_size // 2]
    other = b"not a database, but long enough to have a header" * 9
    file.write_bytes({"empty": b"", "of another kind": other, "cut": half}[damage])
    with pytest.raises(StoreError, match="its results are damaged"), Store.reading(run) as store:
        store.results(IMAGE)


def test_a_folder_without_results_is_named(run, tmp_path):
    with pytest.raises(StoreError, match="no results there"), Store.reading(tmp_path):
        pass
    with Store.writing(run) as store:
        begun(store)
    run.rename(tmp_path / "moved")
    with Store.reading(tmp_path / "moved"):
        pass
    (tmp_path / "moved").rename(run)
    (run.parent / "store").rename(tmp_path / "gone")
    with pytest.raises(StoreError, match="its results are not in"), Store.reading(run):
        pass


def test_a_file_in_place_of_the_folder_is_named(tmp_path):
    (tmp_path / "file").touch()
    for folder in (tmp_path / "file", tmp_path / "file" / "run"):
        with pytest.raises(StoreError, match="cannot be made"), Store.writing(folder):
            pass


@pytest.fixture
def read_only(run):
    """A run folder that cannot be written."""
    if not hasattr(os, "geteuid") or os.geteuid() == 0:
        pytest.skip("this user may write everywhere")
    with Store.writing(run) as store:
        begun(store)
        store.put(IMAGE, "k", IDENTITY, RESULT)
    places = (run, run.parent / "store")
    for place in places:
        place.chmod(0o555)
    yield run
    for place in places:
        place.chmod(0o755)


def test_a_read_only_folder_can_be_read_but_not_written(read_only):
    with Store.reading(read_only) as store:
        assert store.get("k").result == RESULT
    with pytest.raises(StoreError, match="cannot be"), Store.writing(read_only):
        pass


def test_another_process_is_refused_until_this_one_ends(run):
    code = (
        "import sys; from pathlib import Path; from experiments.run.store import Store\n"
        "with Store.writing(Path(sys.argv[1])): print('held', flush=True); input()"
    )
    holder = subprocess.Popen(
        [sys.executable, "-c", code, str(run)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    assert holder.stdout is not None
    assert holder.stdout.readline() == "held\n"
    with (
        pytest.raises(StoreError, match="another process is writing to it; wait"),
        Store.writing(run),
    ):
        pass
    holder.kill()
    holder.communicate()
    with Store.writing(run) as store:
        assert store.results(IMAGE) == []
