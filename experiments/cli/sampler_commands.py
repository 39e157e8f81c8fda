"""Commands about samplers of the user's own: check one, begin one, take its lights elsewhere."""

from pathlib import Path
from typing import Annotated

import typer

Sampler = Annotated[
    str, typer.Argument(help="A sampler's name or FILE:CLASS; parameters in brackets: ours[a=1].")
]


def check(
    sampler: Sampler,
    allow: Annotated[
        list[str] | None, typer.Option(help="A check that may fail; commas or repeatable.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was found as JSON.")] = False,
) -> None:
    """Run the conformance suite on a sampler; says what is wrong and where to look."""
    from experiments.cli.check_sampler import check as command

    raise typer.Exit(command(sampler, allow or [], as_json))


def new(
    name: Annotated[str, typer.Argument(help="Lower case with underscores, e.g. my_sampler.")],
    folder: Annotated[Path, typer.Option(help="Where the file goes.")] = Path(),
) -> None:
    """Begin a sampler: writes NAME.py, a small one that works, to be changed."""
    from experiments.cli.new_sampler import new_sampler as command

    command(name, folder)


def lights(
    environment: Annotated[str, typer.Argument(help="An embedded map's name, or a file.")],
    sampler: Annotated[str, typer.Option(help="Name or FILE:CLASS.")] = "median-cut",
    count: Annotated[int, typer.Option(min=1, max=1 << 20, help="Number of lights.")] = 16,
    parameters: Annotated[
        list[str] | None,
        typer.Option("--set", help="A sampler's parameter, as name=value; repeatable."),
    ] = None,
    file_format: Annotated[
        str, typer.Option("--format", help="json, csv, usd or blender; else by the suffix.")
    ] = "",
    seed: Annotated[int, typer.Option(min=0, help="Seed of everything random.")] = 0,
    repair: Annotated[
        bool, typer.Option("--repair", help="Clamp NaN, infinity and negatives.")
    ] = False,
    output: Annotated[Path | None, typer.Option(help="The file; else the terminal.")] = None,
) -> None:
    """Write a sampler's lights for other programs: JSON, CSV, USD, or a Blender script."""
    from experiments.cli.lights import LightsRequest, write_lights

    write_lights(
        LightsRequest(
            environment, sampler, count, parameters or [], file_format, seed, repair, output
        )
    )


def add_to(app: typer.Typer) -> None:
    """Make the commands known to the command line."""
    for command in (check, new, lights):
        app.command()(command)
