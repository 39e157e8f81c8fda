"""python -m tests.robustness kills|files|maps: campaigns that try to break the project.

The exit status is 1 where anything was found that must not be.
"""

import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(help=__doc__, add_completion=False, pretty_exceptions_enable=False)
Output = Annotated[Path, typer.Option(help="Folder of the figures.")]
Seed = Annotated[int, typer.Option(min=0, help="Another seed, other accidents.")]
RESULTS = Path("results/robustness")


@app.command()
def kills(
    runs: Annotated[int, typer.Option(min=1, help="Runs to kill.")] = 100,
    seed: Seed = 0,
    output: Output = RESULTS,
) -> None:
    """Kill runs at random moments, let them end, and compare with a run that nobody killed."""
    from tests.robustness.kills import End, Kill, run_campaign
    from tests.robustness.publish import publish_kills

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
        _progress(len(ends), runs, 10)

    with tempfile.TemporaryDirectory(prefix="envlight-kills-") as place:
        run_campaign(Path(place) / "campaign", runs, seed, told)
    sys.stdout.flush()
    os.dup2(kept, 1)
    _end(*publish_kills(output, struck, ends, seed))


@app.command()
def files(
    count: Annotated[int, typer.Option(min=1, help="Files to damage.")] = 12000,
    seed: Seed = 0,
    output: Output = RESULTS,
    keep: Annotated[Path | None, typer.Option(help="Keep files that break a reader here.")] = None,
) -> None:
    """Read damaged maps, meshes and scenes."""
    from tests.robustness.damaged_files import run_campaign
    from tests.robustness.publish import publish_tally

    with tempfile.TemporaryDirectory(prefix="envlight-files-") as place:
        tally = run_campaign(keep or Path(place), count, seed, _counted(count))
    about = (
        f"{count} damaged files (seed {seed}), made of small whole ones of every compression and "
        "layout, one to six damages each: flipped bits, other bytes, extreme numbers, pieces cut "
        "out, doubled or put in. `fine` were read, `refused` by one sentence."
    )
    _end(*publish_tally(output, "files", "Damaged files", about, tally))


@app.command()
def maps(
    count: Annotated[int, typer.Option(min=1, help="Maps to draw.")] = 5500,
    seed: Seed = 0,
    output: Output = RESULTS,
) -> None:
    """Measure strange maps, prepare and render them by every sampler."""
    from tests.robustness.publish import publish_tally
    from tests.robustness.strange_maps import run_campaign

    tally = run_campaign(count, seed, _counted(count))
    about = (
        f"{count} generated maps (seed {seed}): patterns over up to twelve decades at levels from "
        "10⁻³⁰ to 10³⁰, holes, spikes on the seam and at the poles, single channels, 1 to 24 rows; "
        "samplers take turns at budgets of 1 to 256 lights, and each image is rendered."
    )
    _end(*publish_tally(output, "maps", "Strange maps", about, tally))


def _counted(count: int) -> Callable[[int], None]:
    return lambda number: _progress(number + 1, count, 1000)


def _progress(done: int, total: int, every: int) -> None:
    if done % every == 0 or done == total:
        print(f"{done} of {total}", file=sys.stderr)


def _end(report: Path, faults: int) -> None:
    print(f"{faults} faults; {report}")
    raise typer.Exit(1 if faults else 0)


if __name__ == "__main__":
    app(prog_name="python -m tests.robustness")
