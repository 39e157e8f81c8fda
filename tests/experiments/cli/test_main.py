"""The command line: light to start, one sentence for what is wrong, right exit statuses."""

import json
import os
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import typer
from PIL import Image

from experiments.cli import main as cli
from experiments.run.scale import SCALES
from renderer.image import write_exr
from samplers.files.image_file import read_radiance
from samplers.threads import set_thread_count, thread_count
from tests.experiments.grid_rows import contents
from tests.experiments.tiny import TINY


@pytest.fixture(autouse=True)
def place(monkeypatch, tmp_path):
    """An empty current folder, and a scale for tests."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(SCALES, "tiny", TINY)
    threads = thread_count()
    yield tmp_path
    set_thread_count(threads)


def test_help_loads_neither_numpy_nor_numba():
    code = (
        "import sys; from experiments.cli import main as cli; sys.argv = ['envlight', '--help']\n"
        "try: cli.main()\n"
        "finally: print('loaded', sorted({'numpy', 'numba', 'pandas', 'PIL'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0
    assert "Compare environment-map light samplers" in done.stdout
    assert done.stdout.splitlines()[-1] == "loaded []"
    assert done.stderr == ""


def test_a_shell_is_told_how_a_line_goes_on_and_nothing_else(envlight, monkeypatch):
    for name, value in {cli.COMPLETING: "complete_bash", "COMP_WORDS": "envlight ta"}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("COMP_CWORD", "1")
    assert envlight() == (0, "tabulate\ntable\n", "")


def test_help_shows_how_parameters_are_given(envlight):
    for command, shown in (("run", "NAME[a=1]"), ("check", "ours[a=1]"), ("render", "ours[upsa")):
        assert shown in envlight(command, "--help")[1]


@pytest.mark.parametrize("command", cli.EXAMPLES)
def test_every_command_shows_an_example_that_it_understands(envlight, command):
    """The words of the example are read; the command itself is not called."""
    _, out, _ = envlight(command, "--help")
    example = cli.EXAMPLES[command]
    assert f"envlight {command} {example}".rstrip()[:60] in " ".join(out.split())
    known = typer.main.get_command(cli.app).commands
    assert set(cli.EXAMPLES) == set(known)
    known[command].make_context(command, shlex.split(example))


def test_list_prints_every_kind(envlight):
    status, out, _ = envlight("list")
    assert status == 0
    for name in ("median-cut", "rubiks-cube", "overcast-moor", "quick", "table1"):
        assert name in out
    status, out, _ = envlight("list", "scales")
    assert (status, "median-cut" in out) == (0, False)


RUN = ("run", "table1", "--scale", "tiny", "--scenes", "three-boxes", "--samplers", "uniform")


def test_a_dry_run_writes_nothing(envlight, place, maps_folder):
    status, out, err = envlight(*RUN, "--environments", maps_folder, "--dry-run")
    assert (status, err) == (0, "")
    assert "5 measurements: 1 scenes × 5 maps × 1 samplers × 1 budgets" in out
    assert "left:      5 measurements, 5 references" in out
    assert "estimate:  about " in out and "minutes on this machine" in out
    assert list(place.iterdir()) == []


def test_run_and_show(envlight, place, maps_folder):
    words = (
        *RUN, "--environments", maps_folder, "--maps", "s*", "--budget", "4", "--budget",
        "lights=4",
    )  # fmt: skip
    status, out, err = envlight(*words, "--output", "new/run", "--no-images", "--threads", "1")
    assert (status, err) == (0, "")
    assert "1 measurements made, 0 were stored already" in out
    assert len(pd.read_csv(place / "new" / "run" / "measurements.csv")) == 1
    assert not (place / "new" / "run" / "images").exists()
    status, out, _ = envlight("show", "new/run")
    assert status == 0
    assert "1 of 1 measurements of its plan are finished" in out


@pytest.mark.parametrize("output", ["new/a_1.5", "new/a_1.5.exr", "new/a_1.5.png"])
def test_render_writes_both_files(envlight, place, maps_folder, output):
    status, out, err = envlight(
        "render", maps_folder / "noise.exr", "--scene", "three-boxes", "--width", 16,
        "--height", 12,
        "--sampler", "median-cut[order=rounds]", "--count", 4, "--output", output,
    )  # fmt: skip
    assert (status, err) == (0, "")
    assert "three-boxes · noise · median-cut" in out
    assert read_radiance(place / "new" / "a_1.5.exr").shape == (12, 16, 3)
    with Image.open(place / "new" / "a_1.5.png") as image:
        assert image.size == (16, 12)


@pytest.mark.parametrize("name", ["noise", "black", "constant"])
def test_inspect_prints_and_draws(envlight, place, maps_folder, name):
    status, out, err = envlight("inspect", maps_folder / f"{name}.exr", "--count", 4)
    assert (status, err) == (0, "")
    assert "32×16" in out
    assert " nan" not in out
    with Image.open(place / "inspect.png") as image:
        assert image.size == (1024, 512)


@pytest.mark.parametrize("command", ["inspect", "render", "run", "scene"])
def test_repairs_are_counted(envlight, place, command):
    radiance = np.ones((4, 8, 3), np.float32)
    radiance[1, 2] = np.nan, -1.0, np.inf
    write_exr(place / "bad.exr", radiance)
    words = {
        "inspect": ("inspect", "bad.exr"),
        "render": ("render", "bad.exr", "--width", 4, "--height", 3, "--scene", "three-boxes"),
        "run": (*RUN, "--environments", "bad.exr", "--dry-run"),
        "scene": ("scene", "three-boxes", "out", "--to", "mitsuba", "--environment", "bad.exr"),
    }[command]
    status, out, err = envlight(*words)
    assert (status, out) == (2, "")
    assert err == (
        "envlight: map 'bad': radiance has 1 NaN (first in row 1, column 2, channel R) and 1 "
        "infinite (first in row 1, column 2, channel B) and 1 negative (first in row 1, column 2, "
        "channel G); mend the file or let --repair clamp it\n"
    )
    status, out, err = envlight(*words, "--repair")
    assert status == 0
    told = "map 'bad': 3 values changed: 1 infinite became 3.40282e+38, 1 NaN became 0, 1 negative"
    assert err.startswith(told) and err.count("\n") == 1


WRONG = {
    "command": (("frob",), "No such command"),
    "option": (("run", "table1", "--nope"), "--nope"),
    "missing argument": (("render",), "Missing argument 'environment'; see envlight render --help"),
    "number": (("run", "table1", "--threads", "x"), "--threads"),
    "range": (("render", "constant", "--count", "0"), "--count"),
    "kind": (("list", "foo"), "list samplers, scenes"),
    "experiment": (("run", "tabel1"), "table1"),
    "scale": (("run", "table1", "--scale", "big"), "quick, medium, standard, paper"),
    "map": (("run", "table1", "--maps", "overcast-moon"), "did you mean overcast-moor"),
    "scene": (("run", "table1", "--scenes", "vas"), "did you mean vase"),
    "sampler": (("run", "table1", "--samplers", "median"), "did you mean median-cut"),
    "budget": (("run", "table1", "--budget", "joules=3"), "write lights=K, rays=R"),
    "suite": (("run", "table1", "--environments", "nowhere"), "no such folder or file"),
    "run folder": (("show", "nowhere"), "no results there"),
    "one map": (("render", "overcast-moon"), "did you mean overcast-moor"),
    "map file": (("inspect", "nowhere.exr"), "no such file"),
    "one scene": (("render", "constant", "--scene", "vas"), "did you mean vase"),
    "one sampler": (("render", "constant", "--sampler", "our"), "did you mean ours"),
    "parameter": (
        ("inspect", "constant", "--sampler", "median-cut[ordre=heap]"),
        "has no parameter 'ordre'",
    ),
    "value": (("inspect", "constant", "--sampler", "median-cut[order=foo]"), "use heap, rounds"),
    "no value": (("inspect", "constant", "--sampler", "median-cut[order]"), "no sampler"),
    "sub-pixels": (
        ("render", "constant", "--width", "16384", "--height", "16384", "--subpixels", "9"),
        "at most",
    ),
    "output folder": (("render", "constant", "--output", "."), "names a folder"),
    "output below a file": (("inspect", "constant", "--output", "file/a.png"), "cannot be written"),
    "picture of another kind": (("inspect", "constant", "--output", "x.jpg"), "name it FILE.png"),
    "run below a file": (
        ("run", "table1", "--maps", "constant", "--output", "file/run"),
        "cannot be made",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_bad_input_is_one_sentence_and_status_2(envlight, place, what):
    words, sentence = WRONG[what]
    (place / "file").touch()
    status, out, err = envlight(*words)
    assert (status, out) == (2, "")
    assert err.startswith("envlight: ")
    assert err.count("\n") == 1
    assert sentence in err
    assert {path.name for path in place.iterdir()} == {"file"}


def test_no_command_writes_over_a_file_that_it_reads(envlight, place, maps_folder):
    """By any of its names, and where a suffix is added."""
    shutil.copy(maps_folder / "noise.exr", "map.exr")
    for name in ("map.png", "table.png"):
        Path(name).write_bytes(b"\x89PNG\r\n\x1a\n")
    Path("own.py").write_text(
        "import samplers\n"
        "open(__file__[:-6] + 'table.png').close()\n\n"
        "class Own(samplers.LightSampler):\n"
        "    def _prepare(self, environment, count, rng):\n        raise ValueError\n"
    )
    shutil.copy("map.exr", "l.json.ambient.exr")
    Path("soft.exr").symlink_to("map.exr")
    Path("deep").mkdir()
    before = contents(place)
    tiny = ("--width", 8, "--height", 6, "--scene", "three-boxes")
    for words, file in (
        (("render", "map.exr", *tiny, "--output", "map"), "map.exr"),
        (("render", "soft.exr", *tiny, "--output", "deep/../map"), "map.exr"),
        (("render", "map.png", *tiny, "--output", place / "map"), "map.png"),
        (("inspect", "map.png", "--output", "./map.png"), "map.png"),
        (("inspect", "map.exr", "--sampler", "own.py:Own", "--output", "table.png"), "table.png"),
        (("lights", "map.exr", "--output", "a.json", "--residual", "soft.exr"), "soft.exr"),
        (("lights", "l.json.ambient.exr", "--output", "l.json"), "l.json.ambient.exr"),
    ):
        status, out, err = envlight(*words)
        assert (status, out) == (2, ""), words
        assert file in err and ("reads that file" in err or "is not" in err), (words, err)
        assert contents(place) == before, words


OTHER_KIND = {
    "render": ("render", "constant", "--width", "8", "--height", "6", "--output", "thesis"),
    "inspect": ("inspect", "constant", "--output", "thesis.png"),
    "lights": ("lights", "constant", "--output", "thesis.json"),
    "csv": ("lights", "constant", "--output", "thesis.csv"),
    "script": ("lights", "constant", "--output", "thesis.py"),
    "stage": ("lights", "constant", "--output", "thesis.usda"),
    "format": ("lights", "constant", "--format", "json", "--output", "thesis.md"),
    "residual": ("lights", "constant", "--residual", "thesis.exr"),
    "ambient": ("lights", "constant", "--output", "thesis"),
    "advice-table": ("advice-table", "run", "--output", "thesis.json"),
}


@pytest.mark.parametrize("what", OTHER_KIND)
def test_no_command_writes_over_a_file_of_another_kind(envlight, place, what):
    text = 'ten years of work, import bpy, {"seed": 1}\n'
    for suffix in ("png", "exr", "json", "csv", "py", "usda", "md", "svg", "json.ambient.exr"):
        Path(f"thesis.{suffix}").write_text(text)
    words = OTHER_KIND[what]
    if what == "ambient":
        words = ("lights", "constant", "--output", "thesis.json")
        Path("thesis.json").unlink()
    status, out, err = envlight(*words)
    assert (status, out) == (2, ""), err
    assert "thesis" in err and err.count("\n") == 1
    assert {file.read_text() for file in place.iterdir()} == {text}


@pytest.mark.parametrize("kind", ["json", "csv", "py"])
def test_what_a_command_wrote_it_writes_again(envlight, kind):
    for _ in range(2):
        assert envlight("lights", "constant", "--count", 2, "--output", f"a.{kind}")[0] == 0


def test_a_folder_in_use_is_refused(envlight, place, maps_folder):
    from experiments.run.store import Store

    with Store.writing(place / "run"):
        words = (*RUN, "--environments", maps_folder, "--output", "run")
        status, out, err = envlight(*words)
    assert (status, out) == (2, "")
    assert err == (
        "envlight: run: another process is writing to it; wait for it to end, or give another "
        "folder by --output\n"
    )


def test_warnings_are_sentences_where_they_are_the_programs_own(monkeypatch):
    monkeypatch.setattr(warnings, "formatwarning", warnings.formatwarning)
    monkeypatch.setattr(cli, "app", lambda *args, **kwargs: 0)
    with pytest.raises(SystemExit):
        cli.main()
    assert warnings.formatwarning("it is left aside", UserWarning, "f.py", 3) == (
        "envlight: it is left aside\n"
    )
    assert "f.py:3" in warnings.formatwarning("overflow", RuntimeWarning, "f.py", 3)


def test_faults_of_the_program_are_not_hidden(monkeypatch):
    def fault(*args, **kwargs):
        raise ValueError("a bug")

    monkeypatch.setattr(cli, "app", fault)
    with pytest.raises(ValueError, match="a bug"):
        cli.main()


def test_json_is_for_machines(envlight, maps_folder):
    words = (*RUN, "--environments", maps_folder, "--maps", "s*", "--output", "run", "--no-images")
    status, out, err = envlight(*words, "--json")
    assert (status, err) == (0, "")
    first = json.loads(out)
    assert first["measured"] == len(first["summary"]) == 1
    assert first["stored"] == 0 and first["failed"] == []
    status, out, _ = envlight("show", "run", "--json")
    shown = json.loads(out)
    assert shown["finished"] == shown["planned"] == 1
    assert shown["summary"] == first["summary"]


HELD = """
import signal, threading, time
from experiments.cli import main as cli
signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job ignores it
cli.GRACE_SECONDS = {grace}
def spin():
    while True:
        time.sleep(0.01)
def app(*words, **options):
    threading.Thread(target=spin).start()
    print("at work", flush=True)
    spin()
cli.app = app
cli.main()
"""


@pytest.mark.skipif(os.name == "nt", reason="it sends an interrupt to one process")
@pytest.mark.parametrize(("grace", "interrupts"), [(0.1, 1), (600.0, 2)])
def test_an_interrupted_process_ends_though_a_thread_does_not(grace, interrupts):
    process = subprocess.Popen(
        [sys.executable, "-c", HELD.format(grace=grace)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None and process.stderr is not None
    assert process.stdout.readline() == "at work\n"
    process.send_signal(signal.SIGINT)
    if interrupts == 2:
        assert process.stderr.readline() == "envlight: interrupted\n"
        process.send_signal(signal.SIGINT)
    assert process.wait() == 130
    if interrupts == 1:  # else Python may stop waiting by itself
        assert "cut off" in process.stderr.read()


def test_a_process_ends_though_a_thread_goes_on():
    body = HELD.format(grace=0.1).replace("True)\n    spin()", "True)")
    done = subprocess.run([sys.executable, "-c", body], capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stdout) == (0, "at work\n")
    assert done.stderr == "envlight: a thread goes on that a sampler began; it is cut off\n"


@pytest.mark.parametrize(
    ("fault", "status", "told"),
    [
        (SystemExit(0), 2, "something that was called ended the program, by sys.exit(0)"),
        (GeneratorExit(), 2, "something that was called ended the program, by GeneratorExit"),
        (MemoryError("for 8 PiB"), 2, "the memory does not suffice (for 8 PiB)"),
        (RuntimeError("Symlink loop from 'a'"), 2, "links lead in a ring; give another path"),
        (ImportError("a.so: failed to map segment from shared object"), 2, "limit of memory"),
        (OSError("libllvmlite.so"), 2, "the system refuses something (libllvmlite.so)"),
    ],
)
def test_what_would_end_the_program_is_told(monkeypatch, capfd, fault, status, told):
    def app(*words, **options):
        raise fault

    monkeypatch.setattr(cli, "app", app)
    with pytest.raises(SystemExit) as end:
        cli.main()
    assert end.value.code == status
    assert told in capfd.readouterr().err


@pytest.mark.parametrize("word", ["--version", "--help", "list"])
def test_output_that_goes_nowhere_is_one_sentence_or_none(word):
    words = [sys.executable, "-m", "experiments.cli.main", word]
    left = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert left.stdout is not None and left.stderr is not None
    left.stdout.close()
    assert (left.stderr.read(), left.wait()) == ("", 1)
    if Path("/dev/full").exists():
        with Path("/dev/full").open("w") as full:
            done = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, text=True)
        assert done.returncode == 2
        assert done.stderr.startswith("envlight: what is written has no room (No space left")
        assert done.stderr.count("\n") == 1


def test_output_in_ascii_is_escaped():
    words = [sys.executable, "-m", "experiments.cli.main", "list", "experiments"]
    ascii_only = {**os.environ, "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
    done = subprocess.run(words, capture_output=True, env=ascii_only)
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"\\u" in done.stdout or b"\\x" in done.stdout


@pytest.mark.parametrize("fault", [KeyboardInterrupt, ImportError])
def test_an_interrupt_before_a_command_or_inside_a_library_is_told_as_one(
    monkeypatch, capfd, fault
):
    """While a library of machine code loads, an interrupt comes out as that library's error."""

    def interrupted(*words, **options):
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise fault("initialization failed") from None

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        monkeypatch.setattr(cli, "app", interrupted)
        monkeypatch.setattr(
            cli, "_end_after_interrupt", lambda *sockets: None
        )  # it would end pytest
        with pytest.raises(SystemExit) as end:
            cli.main()
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert end.value.code == 130
    assert capfd.readouterr() == ("", "envlight: interrupted\n")


def test_what_heard_of_signals_before_may_be_gone(envlight):
    """A library's loop that has ended leaves a number that no longer takes what is told."""
    here, there = socket.socketpair()
    there.setblocking(False)
    signal.set_wakeup_fd(there.fileno())
    there.setblocking(True)
    try:
        assert envlight("list")[0] == 0
        assert signal.set_wakeup_fd(-1) == -1
    finally:
        signal.set_wakeup_fd(-1)
        here.close()
        there.close()
