"""python -m tests.benchmarks NAME: what the program's makers ask of its speed and its results.

Each command measures and prints a table; `--publish` puts it into results/performance.
"""

from pathlib import Path
from typing import Annotated

import typer

from samplers import EnvlightError
from tests.benchmarks import measured_again as again
from tests.benchmarks import paper_budget as budget
from tests.benchmarks import reference_time as reference
from tests.benchmarks import renderer_throughput as throughput
from tests.benchmarks.table import RESULTS, publish, write_page
from tests.experiments.export import threejs

app = typer.Typer(help=__doc__, add_completion=False, pretty_exceptions_enable=False)
Publish = Annotated[bool, typer.Option("--publish", help=f"Replace the table in {RESULTS}.")]
Maps = Annotated[str, typer.Option(help="Maps: embedded, poly-haven-32, or a folder.")]


def _place(wanted: bool) -> Path | None:
    return RESULTS if wanted else None


@app.command()
def renderer_throughput(
    scene: Annotated[str, typer.Option(help="A built-in scene.")] = "glossy",
    publish_it: Publish = False,
) -> None:
    """Rays per second of the renderer, beside Embree alone and beside Mitsuba 3."""
    rows = throughput.rates(scene)
    publish("renderer-throughput", rows, _place(publish_it))
    print(throughput.told(rows))


@app.command()
def reference_time(
    environments: Maps = "poly-haven-32",
    maps: Annotated[str, typer.Option(help="Patterns of maps, with commas between.")] = "",
    publish_it: Publish = False,
) -> None:
    """Seconds until references reach their noise target, by scene."""
    rows = reference.times(environments, list(filter(None, maps.split(","))))
    publish("reference-time", reference.by_scene(rows), _place(publish_it))


@app.command()
def paper_budget(publish_it: Publish = False) -> None:
    """Whether every sampler can keep the paper's 4 s at 1600×1200, and its peak memory."""
    publish("paper-budget", budget.shares(), _place(publish_it))


@app.command()
def threejs_frames(publish_it: Publish = False) -> None:
    """Milliseconds a frame of three.js with shadow maps, in Chromium, by number of lights."""
    publish("threejs-frames", threejs.frames((4, 16, 64)), _place(publish_it))


@app.command()
def measured_again(
    count: Annotated[int, typer.Argument(min=1, help="How many measurements.")] = 60,
    seed: Annotated[int, typer.Option(min=0, help="Another seed draws others.")] = 0,
    environments: Maps = "embedded",
    widest: Annotated[int, typer.Option(min=0, help="Most pixels in a row; 0 for any.")] = 0,
    results: Annotated[Path, typer.Option(help="Published folders.")] = Path("results"),
    runs: Annotated[Path, typer.Option(help="Take references from runs in here.")] = Path("runs"),
    publish_it: Publish = False,
) -> None:
    """Draw published measurements at random, make them again, and say how many agree.

    The exit status is 1 where one differs."""
    rows = again.drawn(results, environments, count, seed, widest)
    found = again.made_again(rows, environments, runs)
    publish("measured-again", again.by_kind(found), _place(publish_it))
    raise typer.Exit(int((found["kind"] == again.DIFFERS).any()))


@app.command()
def page() -> None:
    """Write the page of results/performance anew from its tables."""
    print(write_page(RESULTS))


if __name__ == "__main__":
    try:
        app(prog_name="python -m tests.benchmarks")
    except EnvlightError as error:
        raise SystemExit(f"benchmarks: {error}") from None
