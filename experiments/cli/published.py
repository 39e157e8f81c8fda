"""`envlight published`: measure what is missing of all published folders, and publish them."""

import subprocess
import sys
from collections.abc import Sequence
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.run import INTERRUPTED

if TYPE_CHECKING:
    from experiments.report.suite import PublishedFolder

TOLD = ("left:", "estimate:")
"""What a dry run tells of a grid; of others its first line."""


def published(
    context: typer.Context,
    results: Annotated[
        Path, typer.Argument(help="The published folders, with suite.toml beside them.")
    ] = Path("results"),
    only: Annotated[
        list[str] | None, typer.Option(help="Names or patterns of folders; commas or repeatable.")
    ] = None,
    runs: Annotated[Path, typer.Option(help="Where runs are measured, and resumed.")] = Path(
        "runs"
    ),
    maps: Annotated[
        list[str] | None, typer.Option(help="NAME=FOLDER of maps that commands name; repeatable.")
    ] = None,
    again: Annotated[
        bool, typer.Option("--again", help="Also measure anew what is published whole.")
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only say what is left, and how long it takes.")
    ] = False,
) -> None:
    """Measure what is missing of all published folders, and publish each that is whole."""
    from experiments.maps.patterns import select
    from experiments.report.suite import read_suite
    from experiments.run.registry import find_experiment
    from samplers import EnvlightError

    suite = read_suite(results, _named(maps or []))
    if not suite:
        raise EnvlightError(f"{results}: no suite.toml is there; give the folder of published runs")
    chosen = select(suite, only or [], "folder", lambda one: Path(one.name).name)
    whole = made = 0
    for one in chosen:
        title = one.title or find_experiment(one.runs[0][0]).title
        print(f"{one.name}: {title}", flush=True)
        if not again and one.is_whole(results):
            print("  published whole")
            whole += 1
        elif one.needs:
            given = " ".join(f"--maps {name}=FOLDER" for name in one.needs)
            print(f"envlight: {one.name} is left out without {given}", file=sys.stderr)
        elif dry_run:
            whole += all(_told(context, words) for words in _measuring(one, runs))
        else:
            made += _made(one, results, runs)
    whole += made
    if made:
        _envlight(["results-page", str(results)])
    raise typer.Exit(int(whole < len(chosen)))


def _named(maps: Sequence[str]) -> dict[str, str]:
    """Folders by their names; EnvlightError for anything that is no NAME=FOLDER."""
    from samplers import EnvlightError

    pairs = [text.partition("=") for text in maps]
    for name, _, folder in pairs:
        if not name or not folder:
            raise EnvlightError(f"--maps {name}: write NAME=FOLDER, e.g. EVERY=my_maps")
    return {name: folder for name, _, folder in pairs}


def _measuring(one: "PublishedFolder", runs: Path) -> list[list[str]]:
    """The commands that measure a folder."""
    return [["run", *words, "--output", str(runs / Path(one.name).name)] for words in one.runs]


def _told(context: typer.Context, words: list[str]) -> bool:
    """Tell what a command has left to do; whether it can be run at all."""
    from samplers import EnvlightError

    assert context.parent is not None
    heard = StringIO()
    try:
        with redirect_stdout(heard):
            context.parent.command.main([*words, "--dry-run"], standalone_mode=False)
    except EnvlightError as error:
        print(f"envlight: {error}", file=sys.stderr)
        return False
    lines = heard.getvalue().splitlines()
    for line in [line for line in lines if line.startswith(TOLD)] or lines[:1]:
        print(f"  {line}", flush=True)
    return True


def _made(one: "PublishedFolder", results: Path, runs: Path) -> bool:
    """Measure and publish a folder; whether it is whole."""
    for words in _measuring(one, runs):
        status = _envlight(words)
        if status and not (status == 1 and one.some_fail):
            print(f"envlight: {one.name} is not published: status {status}", file=sys.stderr)
            return False
    run = runs / Path(one.name).name
    return not _envlight(["publish", str(run), str(results / one.name), *one.publish])


def _envlight(words: list[str]) -> int:
    """Run a command in a process of its own; its status. An interrupt ends this one, too."""
    status = subprocess.run([sys.executable, "-m", "experiments.cli.main", *words]).returncode
    if status == INTERRUPTED:
        raise typer.Exit(INTERRUPTED)
    return status
