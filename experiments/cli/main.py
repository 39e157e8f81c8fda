"""The command line: `envlight`. Thin; heavy imports stand inside the commands."""

import errno
import io
import os
import signal
import socket
import sys
import threading
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer

from experiments.cli.advice import advice_table, advise
from experiments.cli.commands import Json, list_names, show
from experiments.cli.lights import lights, new_scene, scene
from experiments.cli.one_map import Repair, inspect, new_map, render
from experiments.cli.own_sampler import check, new
from experiments.cli.paper import cite, table
from experiments.cli.published import published
from experiments.progress import telling
from experiments.run import INTERRUPTED

app = typer.Typer(pretty_exceptions_enable=False)

Patterns = Annotated[
    list[str] | None, typer.Option(help="Names or shell patterns; commas or repeatable.")
]
Scenes = Annotated[
    list[str] | None, typer.Option(help="Names, patterns, or scene files; commas or repeatable.")
]
Samplers = Annotated[
    list[str] | None,
    typer.Option(help="Names, patterns, NAME\\[a=1], or FILE:CLASS; commas or repeatable."),
]
Environments = Annotated[
    str,
    typer.Option(help="embedded, poly-haven-32, paper-named-12, a folder of maps, or one file."),
]
Force = Annotated[
    bool, typer.Option("--force", help="Also replace rows there that are not in this, or others'.")
]


def _print_version(wanted: bool) -> None:
    """What --version does, before any command."""
    if wanted:
        from importlib import metadata

        print(f"envlight {metadata.version('envlight')}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", help="Print the version and exit.", callback=_print_version, is_eager=True
        ),
    ] = False,
) -> None:
    """Compare environment-map light samplers: measured, ranked, reproducible."""


app.command("list")(list_names)


@app.command()
def run(
    experiment: Annotated[str, typer.Argument(help="The experiment's name, e.g. table1.")],
    scale: Annotated[str, typer.Option(help="quick, medium, standard or paper.")] = "quick",
    environments: Environments = "embedded",
    maps: Patterns = None,
    scenes: Scenes = None,
    samplers: Samplers = None,
    budget: Annotated[
        list[str] | None, typer.Option(help="lights=K, rays=R, seconds=T, time=SAMPLER:K.")
    ] = None,
    output: Annotated[Path | None, typer.Option(help="The run's folder.")] = None,
    repair: Repair = False,
    images: Annotated[bool, typer.Option(help="Keep images and draw montages.")] = True,
    threads: Annotated[int, typer.Option(min=0, max=1024, help="Threads; 0 for all cores.")] = 0,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only say what would be done.")
    ] = False,
    as_json: Json = False,
    executor: Annotated[
        str, typer.Option(help="Who works on measurements: serial, processes or dask.")
    ] = "serial",
    workers: Annotated[
        int, typer.Option(min=0, max=1024, help="Measurements at once; 0 for as many as cores.")
    ] = 0,
    cluster: Annotated[
        str, typer.Option(help="A Dask scheduler: tcp://HOST:PORT, or its scheduler file.")
    ] = "",
    strict: Annotated[
        bool, typer.Option("--strict", help="Measure nothing where one of the maps is bad.")
    ] = False,
    reference_noise: Annotated[
        float, typer.Option(min=0.0, help="Noise of references, of the mean; 0: the scale's.")
    ] = 0.0,
    seeds: Annotated[
        int, typer.Option(min=0, max=1024, help="Of a stochastic sampler; 0: the experiment's.")
    ] = 0,
    timeout: Annotated[
        float, typer.Option(min=0.0, help="Seconds that a measurement may take; 0 for any.")
    ] = 0.0,
    store: Annotated[
        Path | None,
        typer.Option(help="The folder of all results; default: store/ beside the run's folder."),
    ] = None,
) -> None:
    """Run an experiment, or resume one; what is stored already is not measured again."""
    from experiments.cli.commands import run as command
    from experiments.maps.patterns import split_list
    from experiments.run.experiment import RunRequest

    request = RunRequest(
        experiment, scale, environments, maps or [], scenes or [], samplers or [],
        split_list(budget or []),
        output, repair, images, threads, as_json, executor, workers, cluster, strict,
        reference_noise, seeds, timeout, store,
    )  # fmt: skip
    raise typer.Exit(command(request, dry_run))


@app.command()
def fetch(
    names: Annotated[
        list[str],
        typer.Argument(help="poly-haven-32, paper-named-12, or ids of Poly Haven's maps."),
    ],
    resolution: Annotated[str, typer.Option(help="1k, 2k, 4k, 8k or 16k.")] = "1k",
    file_format: Annotated[str, typer.Option("--format", help="exr or hdr.")] = "exr",
    to: Annotated[
        Path | None, typer.Option(help="The folder; default ENVLIGHT_MAPS, or the user's own.")
    ] = None,
    api: Annotated[
        str | None, typer.Option(envvar="ENVLIGHT_POLY_HAVEN", help="Another server's address.")
    ] = None,
) -> None:
    """Download maps of Poly Haven (CC0), verified; resumes where it was stopped."""
    from experiments.maps.fetch import API, FetchRequest
    from experiments.maps.fetch import fetch as command

    command(FetchRequest(names, resolution, file_format, to, api or API))


app.command()(show)


@app.command()
def report(
    folder: Annotated[Path, typer.Argument(help="The folder of a run.")],
    maps: Annotated[
        list[Path] | None,
        typer.Option(help="A folder or file of its maps, which pages then show; repeatable."),
    ] = None,
    images: Annotated[bool, typer.Option(help="Pages that compare images.")] = True,
) -> None:
    """Write a run's tables, plots and pages into its folder report/."""
    with telling("pages"):
        from experiments.report.pages.write import write_report_pages

        page = write_report_pages(folder, images, maps or ())
    print(page)


@app.command()
def tabulate(
    folder: Annotated[Path, typer.Argument(help="A run's folder, or one made by publish.")],
) -> None:
    """Make the tables and plots of a run again from its rows, measurements.csv and run.json."""
    with telling(f"tabulating {folder}"):
        from experiments.report.publish import tabulate as command

        files = command(folder)
    print(*files, sep="\n")


@app.command()
def publish(
    run: Annotated[Path, typer.Argument(help="The folder of a run.")],
    target: Annotated[Path, typer.Argument(help="Where to, e.g. results/table1-lights.")],
    compare: Annotated[
        list[str] | None,
        typer.Option(help="Maps or cases, SCENE_MAP, whose images the site compares; repeatable."),
    ] = None,
    force: Force = False,
) -> None:
    """Copy a run's rows, record, tables and plots, without its images."""
    with telling(f"publishing {run}"):
        from experiments.report.publish import publish as command

        files = command(run, target, compare or (), force)
    print(*files, sep="\n")


@app.command()
def join(
    target: Annotated[Path, typer.Argument(help="A new folder, or that of an earlier join.")],
    parts: Annotated[list[Path], typer.Argument(help="Two or more folders, runs or published.")],
    force: Force = False,
    renew: Annotated[
        bool,
        typer.Option(
            "--renew", help="In the same cases, the last part with a sampler has its rows."
        ),
    ] = False,
) -> None:
    """Join parts of a grid that were measured apart, on several days or machines, to one run."""
    with telling(f"joining {target}"):
        from experiments.report.join import join as command

        files = command(parts, target, force, renew)
    print(*files, sep="\n")


@app.command("results-page")
def results_page(
    folder: Annotated[Path, typer.Argument(help="The folder of all published runs.")],
) -> None:
    """Write the page of all published runs, README.md, from their rows."""
    with telling(f"reading {folder}"):
        from experiments.report.publish import write_results_page

        page = write_results_page(folder)
    print(page)


@app.command()
def site(
    results: Annotated[Path, typer.Argument(help="The folder of all published runs.")],
    folder: Annotated[Path, typer.Argument(help="A new folder, or that of an earlier site.")],
    runs: Annotated[
        Path | None,
        typer.Option(help="A folder of runs; those whose images are kept get pages with them."),
    ] = None,
    maps: Annotated[
        list[Path] | None, typer.Option(help="A folder with the runs' map files; repeatable.")
    ] = None,
) -> None:
    """Write static pages of all published runs: ranking with filters, samplers, maps, downloads."""
    with telling("pages"):
        from experiments.report.pages.write import write_site

        page = write_site(results, folder, runs, maps or ())
    print(page)


@app.command()
def compare(
    run: Annotated[Path, typer.Argument(help="The folder of a run.")],
    other: Annotated[Path, typer.Argument(help="That of another, e.g. results/table1-quick.")],
    better: Annotated[
        bool, typer.Option("--better", help="Which samplers of the other are better, or faster?")
    ] = False,
) -> None:
    """Does a run agree with another or a published one? Status 1: no; 3: not all was compared."""
    with telling(f"comparing {run} and {other}"):
        from experiments.report.compare import compare_runs

        found, status = compare_runs(run, other, better)
    print(found)
    raise typer.Exit(status)


for command in (
    render, inspect, check, new, lights, scene, advise, published, new_map, new_scene, advice_table,
    cite, table,
):  # fmt: skip
    app.command(command.__name__.replace("_", "-"))(command)

EXAMPLES = {
    "list": "samplers",
    "run": "table1 --scenes vase --samplers ours,mis,median-cut",
    "fetch": "poly-haven-32 --resolution 1k",
    "show": "runs/table1-quick",
    "report": "runs/table1-quick",
    "tabulate": "results/table1-lights",
    "publish": "runs/table1-lights results/table1-lights",
    "join": "runs/whole runs/monday runs/tuesday",
    "results-page": "results",
    "site": "results site --runs runs",
    "compare": "runs/table1-quick results/table1-quick",
    "render": "sunset-mountains --scene vase --sampler 'ours[upsampling=2]'",
    "inspect": "my_map.exr --sampler median-cut --count 64",
    "check": "./my_sampler.py:MySampler",
    "new": "my_sampler",
    "lights": "my_map.exr --sampler lightgen --count 16 --output lights.glb",
    "scene": "vase for_blender --to blender",
    "advise": "my_map.exr --lights 16",
    "published": "--dry-run --only 'table1-*'",
    "new-map": "cube_cross.exr my_map.exr",
    "new-scene": "my_mesh.obj",
    "cite": "ours,ris",
    "table": "results/table1-lights --samplers ours,mis --columns flip,flip_rank",
    "advice-table": "results/which-sampler --output measured.json",
}
"""What stands under a command's help."""
for info in app.registered_commands:
    assert info.callback is not None
    name = info.name or info.callback.__name__
    info.epilog = f"Example: envlight {name} {EXAMPLES[name]}".replace("[", "\\[")


@contextmanager
def _interrupts_noted() -> Iterator[list[int]]:
    """Interrupts raise KeyboardInterrupt as ever, and stand in the list."""
    noted: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        noted.append(number)
        signal.default_int_handler(number, frame)

    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield noted
        return
    try:
        signal.signal(signal.SIGINT, note)
    except ValueError:  # only the main thread may, and only it is interrupted
        yield noted
        return
    try:
        yield noted
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


COMPLETING = "_ENVLIGHT_COMPLETE"
"""Set by a shell that asks how a line goes on; what answers ends the program."""
NO_ROOM = errno.ENOSPC, errno.EDQUOT, errno.EFBIG
GRACE_SECONDS = 10.0
"""So long after an interrupt the process ends, and at once after a second one."""


@contextmanager
def _ended_by_interrupts(noted: list[int]) -> Iterator[None]:
    """Have an interrupt end the process, whatever its threads are at.

    Machine code hears of no interrupt, and Python waits at its end for all threads: a thread of
    its own is told by the system, and goes on watching where an interrupt was noted.
    """
    here, there = socket.socketpair()
    there.setblocking(False)
    try:
        before = signal.set_wakeup_fd(there.fileno(), warn_on_full_buffer=False)
    except ValueError:  # only the main thread may, and only it is interrupted
        yield
        return
    threading.Thread(target=_end_after_interrupt, args=(here, there), daemon=True).start()
    try:
        yield
    finally:
        if not noted:
            try:
                signal.set_wakeup_fd(before)
            except (ValueError, OSError):  # what was told before is closed
                signal.set_wakeup_fd(-1)
            there.close()


def _end_after_interrupt(told: socket.socket, teller: socket.socket) -> None:
    """Wait for an interrupt, and end the process then. teller : kept open until then"""
    while (number := told.recv(1)) != bytes([signal.SIGINT]):
        if not number:  # nothing is watched any more
            return told.close()
    told.settimeout(GRACE_SECONDS)
    with suppress(TimeoutError):
        told.recv(1)
    print("envlight: interrupted; what did not end by itself is cut off", file=sys.stderr)
    sys.stdout.flush()
    os._exit(INTERRUPTED)


def main() -> None:
    """Entry point: bad input ends in one sentence and exit status 2, an interrupt in 130."""
    if isinstance(sys.stdout, io.TextIOWrapper):  # as stderr is: a terminal may have no "×"
        sys.stdout.reconfigure(errors="backslashreplace")
    plain = warnings.formatwarning
    warnings.formatwarning = lambda message, kind, *place: (
        f"envlight: {message}\n" if kind is UserWarning else plain(message, kind, *place)
    )
    try:
        with _interrupts_noted() as noted, _ended_by_interrupts(noted):
            status = app(sys.argv[1:] or ["--help"], prog_name="envlight", standalone_mode=False)
            if sys.stdout is not None:  # None where it was closed before the start
                sys.stdout.flush()
    except KeyboardInterrupt:  # before a command has begun
        status = INTERRUPTED
    except SystemExit as end:  # a command says its status by other means
        if isinstance(end.__context__, BrokenPipeError):  # who reads has enough
            _leave_output()
        elif end.code != INTERRUPTED and COMPLETING not in os.environ:
            print(
                f"envlight: something that was called ended the program, by sys.exit({end.code!r})",
                file=sys.stderr,
            )
            sys.exit(2)
        raise
    except BrokenPipeError:  # the same, told at the end
        _leave_output()
        status = 1
    except BaseException as error:
        sentence = _sentence(error)
        if noted:  # while a library loads, an interrupt comes out as an error of that library
            status = INTERRUPTED
        elif sentence is None:
            raise
        else:
            print(f"envlight: {sentence}", file=sys.stderr)
            if isinstance(error, OSError):
                _leave_output()
            status = 2
    if status == INTERRUPTED:
        print("envlight: interrupted", file=sys.stderr)
    if any(not (one.daemon or one is threading.main_thread()) for one in threading.enumerate()):
        at_end = threading.Event()
        threading.Thread(target=_cut_off, args=(at_end, status), daemon=True).start()
        threading._register_atexit(at_end.set)  # type: ignore[attr-defined]
    sys.exit(status)


def _cut_off(at_end: threading.Event, status: int | None) -> None:
    """End the process, though Python waits at its end for threads that a sampler has begun."""
    at_end.wait()
    time.sleep(GRACE_SECONDS)
    print("envlight: a thread goes on that a sampler began; it is cut off", file=sys.stderr)
    os._exit(status or 0)


def _leave_output() -> None:
    """Drop what could not be printed, which would fail once more at the end of the program."""
    with suppress(OSError, AttributeError):  # it is none of the system's
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _sentence(error: BaseException) -> str | None:
    """What to tell the user, None for what is a fault of the program."""
    from samplers.errors import EnvlightError, told
    from samplers.files.plug_in_files import line_of

    if isinstance(error, EnvlightError):
        return str(error)
    if not isinstance(error, Exception):
        where = line_of(error) or "something that was called"
        return f"{where} ended the program, by {type(error).__name__}"
    if isinstance(error, MemoryError):
        return f"the memory does not suffice ({error}); take a smaller map or image"
    if isinstance(error, OSError) and error.filename:
        return f"{error.filename}: {error.strerror}; check the path and its permissions"
    if isinstance(error, OSError) and error.errno in NO_ROOM:
        return f"what is written has no room ({error.strerror}); make room, or write elsewhere"
    if line := line_of(error):
        return f"{line}: {told(error)}; correct the line"
    if isinstance(error, RuntimeError) and "Symlink loop" in str(error):
        return f"{error}: links lead in a ring; give another path"
    if isinstance(error, OSError) or "shared object" in str(error):
        return f"the system refuses something ({error}); see to folders and the limit of memory"
    # The command line's own errors derive from a class that the library does not export.
    message = getattr(error, "format_message", None)
    command = getattr(getattr(error, "ctx", None), "command_path", "envlight")
    return f"{message().rstrip('.')}; see {command} --help" if message else None


if __name__ == "__main__":
    main()
