"""python -m tests.robustness kills|files|maps: campaigns that try to break the project.

The exit status is 1 where anything was found that must not be.
"""

import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import pandas as pd
import typer

from experiments.run.executors import KINDS
from tests.benchmarks.table import RESULTS, publish

app = typer.Typer(help=__doc__, add_completion=False, pretty_exceptions_enable=False)
Publish = Annotated[bool, typer.Option("--publish", help=f"Replace the table in {RESULTS}.")]
Seed = Annotated[int, typer.Option(min=0, help="Another seed, other accidents.")]


@app.command()
def kills(
    runs: Annotated[int, typer.Option(min=1, help="Runs to kill, by each executor.")] = 30,
    executor: Annotated[list[str] | None, typer.Option(help="One or more; all.")] = None,
    seed: Seed = 0,
    details: Annotated[Path | None, typer.Option(help="Write every kill and end here.")] = None,
    publish_it: Publish = False,
) -> None:
    """Kill runs at random moments, let them end, and compare with a run that nobody killed."""
    from tests.robustness.kills import End, Kill, harm, run_campaign

    executors = executor or list(KINDS)
    kept = os.dup(1)
    with Path(os.devnull).open("w", encoding="utf-8") as nowhere:
        os.dup2(nowhere.fileno(), 1)  # the runs print their tables
    struck: list[Kill] = []
    ends: list[End] = []

    def told(seen: Kill | End) -> None:
        if isinstance(seen, Kill):
            struck.append(seen)
            return
        ends.append(seen)
        _progress(len(ends), runs * len(executors), 10)

    with tempfile.TemporaryDirectory(prefix="envlight-kills-") as place:
        run_campaign(Path(place), executors, runs, seed, told)
    sys.stdout.flush()
    os.dup2(kept, 1)
    if details is not None:
        details.mkdir(parents=True, exist_ok=True)
        pd.DataFrame(struck).to_csv(details / "kills.csv", index=False)
        pd.DataFrame(ends).to_csv(details / "killed_runs.csv", index=False)
    found = harm(struck, ends)
    publish("killed-runs", found, RESULTS if publish_it else None)
    _end(int(found[executors].iloc[2:].to_numpy().sum()))


@app.command()
def files(
    count: Annotated[int, typer.Option(min=1, help="Files to damage.")] = 12000,
    seed: Seed = 0,
    publish_it: Publish = False,
    keep: Annotated[Path | None, typer.Option(help="Keep files that break a reader here.")] = None,
) -> None:
    """Read damaged maps, meshes and scenes."""
    from tests.robustness.damaged_files import run_campaign

    with tempfile.TemporaryDirectory(prefix="envlight-files-") as place:
        tally = run_campaign(keep or Path(place), count, seed, _counted(count))
    publish("damaged-files", tally.table(), RESULTS if publish_it else None)
    _end(tally.tell())


@app.command()
def maps(
    count: Annotated[int, typer.Option(min=1, help="Maps to draw.")] = 5500,
    seed: Seed = 0,
    publish_it: Publish = False,
) -> None:
    """Measure strange maps, prepare and render them by every sampler."""
    from tests.robustness.strange_maps import run_campaign

    tally = run_campaign(count, seed, _counted(count))
    publish("strange-maps", tally.table(), RESULTS if publish_it else None)
    _end(tally.tell())


def _counted(count: int) -> Callable[[int], None]:
    return lambda number: _progress(number + 1, count, 1000)


def _progress(done: int, total: int, every: int) -> None:
    if done % every == 0 or done == total:
        print(f"{done} of {total}", file=sys.stderr)


def _end(faults: int) -> None:
    print(f"{faults} faults")
    raise typer.Exit(1 if faults else 0)


if __name__ == "__main__":
    app(prog_name="python -m tests.robustness")
