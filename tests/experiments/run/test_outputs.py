"""What a command reads or another program wrote stays as it is, whenever a command is stopped."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from experiments.run import outputs
from experiments.run.outputs import (
    EXR,
    PNG,
    check_apart,
    check_output,
    mark,
    marked,
    remove_listed,
    renewed_folder,
    same_file,
)
from samplers import EnvlightError
from tests.experiments.grid_rows import contents

HEAD = EXR.signs[0] + b"..."
OLD = {"page.html": b"old", "gone.html": b"old", "deep/page.html": b"old"}
NEW = {"page.html": b"new", "deep/other.html": b"new"}
FOREIGN = {"CNAME": b"mine", "deep/notes.md": b"mine"}


@pytest.fixture
def image(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "map.exr"
    path.write_bytes(HEAD)
    return path


@pytest.mark.parametrize(
    "name", ["map.exr", "./map.exr", "../{}/map.exr", "new/../map.exr", "soft.exr", "hard.exr"]
)
def test_a_file_that_is_read_is_refused_by_all_its_names(image, name):
    Path("soft.exr").symlink_to(image)
    Path("hard.exr").hardlink_to(image)
    path = Path(name.format(image.parent.name))
    for read in (image, "map.exr", "soft.exr"):
        with pytest.raises(EnvlightError, match=r"^--output .*: this command reads that file"):
            check_output(path, EXR, reads=["overcast-moor", read])


def test_a_file_system_that_ignores_case_is_asked(image, monkeypatch):
    """There `MAP.EXR` exists and is `map.exr`; where it is another file, it may be written."""
    check_output(Path("MAP.EXR"), EXR, reads=[image])
    own = {"samefile": Path.samefile, "exists": Path.exists}
    monkeypatch.setattr(Path, "exists", lambda path: own["exists"](Path(str(path).lower())))
    monkeypatch.setattr(
        Path, "samefile", lambda a, b: own["samefile"](Path(str(a).lower()), Path(str(b).lower()))
    )
    with pytest.raises(EnvlightError, match="reads that file"):
        check_output(Path("MAP.EXR"), EXR, reads=["map.exr"])


def test_two_files_that_are_not_there_may_be_one(image):
    assert same_file(Path("a/Lights.exr"), Path("./a/lights.EXR"))
    assert not same_file(Path("lights.exr"), Path("light.exr"))
    assert not same_file(image, Path("lights.exr"))


def test_only_a_file_of_the_same_kind_is_replaced(image, tmp_path):
    check_output(image, EXR)
    check_output(tmp_path / "new.exr", EXR)
    (tmp_path / "empty.exr").touch()
    check_output(tmp_path / "empty.exr", EXR)
    (tmp_path / "thesis.exr").write_text("ten years of work")
    for path, kind in ((tmp_path / "thesis.exr", EXR), (image, PNG), (Path(os.devnull), EXR)):
        with pytest.raises(EnvlightError, match=rf"{path}: the file there is not {kind.name}"):
            check_output(path, kind)


@pytest.mark.parametrize("place", ["/dev/stdout", "/dev/null.exr", "/proc/self/fd/1"])
def test_no_device_is_replaced_by_a_file(place):
    with pytest.raises(EnvlightError, match=r"among devices|the file there is not"):
        check_output(Path(place), EXR)


def test_a_folder_that_holds_what_is_read_is_refused(tmp_path):
    (tmp_path / "site" / "files" / "run").mkdir(parents=True)
    (tmp_path / "link").symlink_to(tmp_path / "site")
    for target in ("site", "link", "site/files/run"):
        with pytest.raises(EnvlightError, match="which this command reads, is there"):
            check_apart(tmp_path / target, [tmp_path / "site" / "files" / "run"])
    check_apart(tmp_path / "site" / "files" / "run" / "new", [tmp_path / "site" / "files" / "run"])


def written(folder: Path, files: dict[str, bytes]) -> Path:
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return folder


@pytest.fixture
def folder(tmp_path) -> Path:
    """An old folder with files of somebody else."""
    return written(tmp_path / "place" / "site", OLD | FOREIGN)


def renew(folder: Path) -> None:
    with renewed_folder(folder, OLD) as place:
        assert place.name == folder.name and not list(place.iterdir())
        written(place, NEW)


def test_a_folder_is_replaced_but_for_what_is_not_its_own(folder):
    renew(folder)
    assert contents(folder) == NEW | FOREIGN
    assert [path.name for path in folder.parent.iterdir()] == [folder.name]
    with renewed_folder(folder) as place:
        written(place, {"a": b"whole"})
    assert contents(folder) == {"a": b"whole"}


def test_a_new_folder_and_one_behind_a_link_come_into_being(tmp_path):
    renew(tmp_path / "a" / "b" / "site")
    assert contents(tmp_path / "a" / "b" / "site") == NEW
    (tmp_path / "link").symlink_to(tmp_path / "a" / "b" / "site")
    with renewed_folder(tmp_path / "link") as place:
        written(place, {"a": b"whole"})
    assert (tmp_path / "link").is_symlink() and contents(tmp_path / "link") == {"a": b"whole"}
    (tmp_path / "file").write_text("ten years of work")
    with pytest.raises(EnvlightError, match="it is a file"):
        renew(tmp_path / "file")


def test_what_fails_changes_nothing(folder):
    for error in (EnvlightError("no"), OSError(28, "No space left on device"), ZeroDivisionError()):
        expected = EnvlightError if isinstance(error, OSError) else type(error)
        with pytest.raises(expected), renewed_folder(folder, OLD) as place:
            written(place, NEW)
            raise error
        assert contents(folder.parent) == {f"site/{k}": v for k, v in (OLD | FOREIGN).items()}


MOMENTS = {
    "while it is written": (outputs, "_bring_others"),
    "before it is moved": (outputs, "_put"),
    "before the old one is removed": (outputs.shutil, "rmtree"),
}


def killed(folder: Path, place: object, name: str, after: int = 0) -> None:
    """Renew a folder in a process that is killed as it calls a function for the next time."""
    process = os.fork()
    if process == 0:
        calls, own = [0], getattr(place, name)

        def kill(*args, **kwargs):
            calls[0] += 1
            if calls[0] > after:
                os.kill(os.getpid(), signal.SIGKILL)
            return own(*args, **kwargs)

        setattr(place, name, kill)
        renew(folder)
        os._exit(0)
    assert os.waitpid(process, 0)[1] == signal.SIGKILL


@pytest.mark.skipif(not hasattr(os, "fork"), reason="it kills processes that it forks")
@pytest.mark.parametrize("moment", MOMENTS)
def test_a_kill_leaves_the_old_folder_or_the_new_one(folder, moment):
    killed(folder, *MOMENTS[moment])
    assert contents(folder) in (OLD | FOREIGN, NEW | FOREIGN)
    assert len(list(folder.parent.iterdir())) == 2  # and what was begun
    renew(folder)
    assert contents(folder.parent) == {f"site/{k}": v for k, v in (NEW | FOREIGN).items()}


@pytest.mark.skipif(not hasattr(os, "fork"), reason="it kills processes that it forks")
def test_what_was_moved_away_as_a_kill_came_is_brought_back(tmp_path):
    folder = written(tmp_path / "site", OLD | FOREIGN)
    killed(folder, Path, "rename", after=1)  # the old one is away, the new one not there yet
    assert not folder.exists()
    with pytest.raises(ZeroDivisionError), renewed_folder(folder, OLD):
        raise ZeroDivisionError
    assert contents(tmp_path) == {f"site/{k}": v for k, v in (OLD | FOREIGN).items()}


@pytest.mark.skipif(sys.platform != "linux", reason="it asks Linux")
def test_what_a_living_process_makes_is_left_alone(tmp_path):
    folder = written(tmp_path / "site", OLD)
    with subprocess.Popen(["sleep", "60"]) as other:
        beside = written(tmp_path / f".site.{other.pid}", NEW)
        renew(folder)
        assert contents(beside) == NEW
        other.kill()


def test_a_mark_lists_what_stands_in_a_folder(tmp_path):
    written(tmp_path, OLD)
    mark(tmp_path, "mark.txt", "Made here.")
    assert sorted(marked(tmp_path, "mark.txt") or []) == sorted([*OLD, "mark.txt"])
    (tmp_path / "mark.txt").write_text("Made here; it is replaced as a whole.\n")
    assert marked(tmp_path, "mark.txt") is None


def test_only_files_inside_a_folder_are_removed_by_a_list(tmp_path):
    written(tmp_path, {"out": b"mine", "folder/in": b"ours", "folder/deep/in": b"ours"})
    (tmp_path / "folder" / "link").symlink_to(tmp_path)
    names = ["in", "deep/in", "../out", str(tmp_path / "out"), "link/out", "deep", "", "nothing"]
    remove_listed(tmp_path / "folder", names)
    assert contents(tmp_path) == {"out": b"mine"}
