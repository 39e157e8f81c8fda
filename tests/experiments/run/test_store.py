"""The store keeps what is committed, belongs to one writer, and says plainly what is wrong."""

import os
import sqlite3
import subprocess
import sys
import time

import numpy as np
import pytest

from experiments.run.store import DATABASE, TABLES, Planned, Store, StoreError

IDENTITY, RESULT = {"sampler": "ours"}, {"rmse": 0.1, "psnr": float("inf"), "name": "Q²"}


def test_a_result_comes_back_as_it_went_in(tmp_path):
    with Store.writing(tmp_path / "deep" / "run") as store:
        store.put("image", "k", IDENTITY, RESULT)
        store.put("reference", "k", IDENTITY, {"noise_floor": 0.5})
    with Store.reading(tmp_path / "deep" / "run") as store:
        assert store.get("image", "k") == RESULT
        assert store.get("reference", "k") == {"noise_floor": 0.5}
        assert store.get("image", "other") is None
        assert store.results("image") == [("k", IDENTITY, RESULT)]


def test_a_result_is_never_overwritten(tmp_path):
    with Store.writing(tmp_path) as store:
        store.put("image", "k", IDENTITY, RESULT)
        with pytest.raises(sqlite3.IntegrityError):
            store.put("image", "k", IDENTITY, {"rmse": 0.2})
        assert store.get("image", "k") == RESULT


def test_what_belongs_together_is_committed_together(tmp_path):
    with Store.writing(tmp_path) as store:
        with pytest.raises(ZeroDivisionError), store.together():
            store.put("image", "k", IDENTITY, RESULT)
            raise ZeroDivisionError
        assert store.get("image", "k") is None
        with store.together():
            store.put("image", "k", IDENTITY, RESULT)
            store.put("score", "s", IDENTITY, {"flip": 0.3})
        whole = store.measured(Planned("k", "r", {"flip": "s"}))
        assert whole == {"key": "k", "reference": "r", **RESULT, "flip": 0.3}
        assert store.measured(Planned("k", "r", {"flip": "s", "other": "t"})) is None


def test_a_row_is_on_disk_when_put_returns(tmp_path):
    with Store.writing(tmp_path) as store:
        store.put("image", "k", IDENTITY, RESULT)
        with Store.reading(tmp_path) as reader:
            assert reader.get("image", "k") == RESULT


def test_a_second_writer_is_refused_and_a_later_one_is_not(tmp_path):
    with (
        Store.writing(tmp_path),
        pytest.raises(StoreError, match="another process is writing to it; wait"),
        Store.writing(tmp_path),
    ):
        pass
    with Store.writing(tmp_path) as store:
        assert store.results("image") == []


def test_the_newest_start_decides_the_plan(tmp_path):
    with Store.writing(tmp_path) as store:
        store.begin_session({"command": "first"}, list(map(Planned, "abc")))
        plan = [Planned("c", "r", {"rmse": "s"}), Planned("a")]
        store.begin_session({"command": "second"}, plan)
        assert store.plan() == plan
        assert [session["command"] for session in store.sessions()] == ["first", "second"]


def test_each_image_is_of_the_start_that_finished_it(tmp_path, monkeypatch):
    with Store.writing(tmp_path) as store:
        for place, key in enumerate("abc"):
            store.begin_session({"command": str(place)}, list(map(Planned, "abd")))
            store.put("image", key, {}, {})
        assert store.finished_in() == {"a": 0, "b": 1}
        monkeypatch.setattr(time, "time", lambda: 0.0)
        store.put("image", "d", {}, {})
        assert store.finished_in() == {"a": 0, "b": 1, "d": 0}


def test_left_over_files_of_a_killed_process_go_and_others_stay(tmp_path):
    gone = [tmp_path / ".measurements.123.csv", tmp_path / "images" / "s" / "m" / ".mis_1.5.77.exr"]
    kept = [tmp_path / ".gitignore", tmp_path / "notes" / ".x.1.exr", tmp_path / "images" / "a.exr"]
    for file in gone + kept:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    with Store.writing(tmp_path):
        assert not any(file.exists() for file in gone)
        assert all(file.exists() for file in kept)


def _filled(folder):
    """What a store of many rows holds."""
    with Store.writing(folder) as store:
        plan = [Planned(f"k{n:02}", "r", {"rmse": f"s{n:02}"}) for n in range(40)]
        store.begin_session({"command": "first"}, plan)
        store.put("reference", "r", IDENTITY, RESULT)
        for n, one in enumerate(plan):
            store.put("image", one.key, IDENTITY, {"count": n})
            store.put("score", one.scores["rmse"], IDENTITY, {"rmse": n / 7.0})
        store._connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        return _held(store)


def _held(store):
    rows = {(table, *row[:1]): row for table in TABLES for row in store.results(table)}
    plan = {("plan", one.key): one for one in store.plan()}
    whole = {("whole", one.key): store.measured(one) for one in store.plan()}
    return {**rows, **plan, **{key: row for key, row in whole.items() if row is not None}}


def test_of_a_damaged_database_nothing_else_comes_than_was_stored(tmp_path, capsys):
    before = _filled(tmp_path)
    file = tmp_path / DATABASE
    whole = file.read_bytes()
    rng = np.random.default_rng(5)
    told = 0
    for _ in range(120):
        damaged = bytearray(whole)
        for place in rng.integers(0, len(whole), 4):
            damaged[place] ^= int(rng.integers(1, 256))
        file.write_bytes(damaged)
        try:
            with Store.reading(tmp_path) as store:
                held = _held(store)
                starts = store.sessions()
        except StoreError:
            continue
        assert held.items() <= before.items()
        assert starts in ([], [{"command": "first"}])
        sentences = capsys.readouterr().err
        told += "damaged" in sentences
        assert (held == before and starts) or sentences
    assert told > 40


@pytest.mark.parametrize("column", ["key", "identity", "result", "finished", "digest"])
def test_a_damaged_row_is_missing_told_and_measured_again(tmp_path, capsys, column):
    with Store.writing(tmp_path) as store:
        store.put("image", "k", IDENTITY, RESULT)
        store.put("image", "l", IDENTITY, RESULT)
        value = 1.0 if column == "finished" else "k2"
        store._connection.execute(f"UPDATE image SET {column} = ? WHERE key = 'k'", (value,))
    with Store.writing(tmp_path) as store:
        assert store.get("image", "k") is None
        assert [key for key, _, _ in store.results("image")] == ["l"]
        assert capsys.readouterr().err.count("stored results are damaged") == 1
        store.put("image", "k", IDENTITY, {"rmse": 0.2})
        assert store.get("image", "k") == {"rmse": 0.2}


def test_results_of_another_version_are_refused(tmp_path):
    with Store.writing(tmp_path) as store:
        store._connection.execute("PRAGMA user_version = 0")
    for opened in (Store.reading, Store.writing):
        with pytest.raises(StoreError, match="another version"), opened(tmp_path):
            pass


@pytest.mark.parametrize("content", [b"", b"not a database, but long enough to have a header" * 9])
def test_a_damaged_database_is_named(tmp_path, content):
    (tmp_path / DATABASE).write_bytes(content)
    with pytest.raises(StoreError, match="results"), Store.reading(tmp_path) as store:
        store.results("image")


def test_a_cut_database_is_named(tmp_path):
    with Store.writing(tmp_path) as store:
        for key in range(40):
            store.put("image", str(key), IDENTITY, RESULT)
    whole = (tmp_path / DATABASE).read_bytes()
    (tmp_path / DATABASE).write_bytes(whole[: len(whole) // 2])
    with pytest.raises(StoreError, match="damaged"), Store.reading(tmp_path) as store:
        store.results("image")


def test_a_folder_without_results_is_named(tmp_path):
    with pytest.raises(StoreError, match="no results there"), Store.reading(tmp_path):
        pass


def test_a_file_in_place_of_the_folder_is_named(tmp_path):
    (tmp_path / "file").touch()
    for folder in (tmp_path / "file", tmp_path / "file" / "run"):
        with pytest.raises(StoreError, match="cannot be made"), Store.writing(folder):
            pass


@pytest.fixture
def read_only(tmp_path):
    """A run folder that cannot be written."""
    if not hasattr(os, "geteuid") or os.geteuid() == 0:
        pytest.skip("this user may write everywhere")
    with Store.writing(tmp_path) as store:
        store.put("image", "k", IDENTITY, RESULT)
    tmp_path.chmod(0o555)
    yield tmp_path
    tmp_path.chmod(0o755)


def test_a_read_only_folder_can_be_read_but_not_written(read_only):
    with Store.reading(read_only) as store:
        assert store.get("image", "k") == RESULT
    with pytest.raises(StoreError, match="cannot be"), Store.writing(read_only):
        pass


def test_another_process_is_refused_until_this_one_ends(tmp_path):
    code = (
        "import sys; from pathlib import Path; from experiments.run.store import Store\n"
        "with Store.writing(Path(sys.argv[1])): print('held', flush=True); input()"
    )
    holder = subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    assert holder.stdout is not None
    assert holder.stdout.readline() == "held\n"
    with pytest.raises(StoreError, match="another process"), Store.writing(tmp_path):
        pass
    with Store.reading(tmp_path) as store:
        assert store.results("image") == []
    holder.kill()
    holder.communicate()
    with Store.writing(tmp_path) as store:
        assert store.results("image") == []
