"""The store keeps what is committed, belongs to one writer, and says plainly what is wrong."""

import os
import sqlite3
import subprocess
import sys

import pytest

from experiments.run.store import DATABASE, Planned, Store, StoreError

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


def test_each_image_is_of_the_start_that_finished_it(tmp_path):
    with Store.writing(tmp_path) as store:
        for place, key in enumerate("abc"):
            store.begin_session({"command": str(place)}, list(map(Planned, "abd")))
            store.put("image", key, {}, {})
        assert store.finished_in() == {"a": 0, "b": 1}
        store._connection.execute("UPDATE image SET finished = 0.0")
        assert store.finished_in() == {"a": 0, "b": 0}


def test_left_over_files_of_a_killed_process_go_and_others_stay(tmp_path):
    gone = [tmp_path / ".measurements.123.csv", tmp_path / "images" / "s" / "m" / ".mis_1.5.77.exr"]
    kept = [tmp_path / ".gitignore", tmp_path / "notes" / ".x.1.exr", tmp_path / "images" / "a.exr"]
    for file in gone + kept:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    with Store.writing(tmp_path):
        assert not any(file.exists() for file in gone)
        assert all(file.exists() for file in kept)


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
