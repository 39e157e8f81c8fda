"""The commands `envlight advise` and `envlight advice-table`.

Heavy imports stand inside, so that `--help` answers at once, and advice comes within a second.
"""

import json
import math
import shlex
from collections.abc import Iterator
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from experiments.cli.one_map import Environment, Repair, load_map
from experiments.progress import telling

if TYPE_CHECKING:
    from experiments.questions.advice.expected import Advice, Answer, Kind, Wish, Worth
    from experiments.questions.advice.measured import Measured

LIGHTS = 16
"""The budget where none is given."""
TABLE = "measured.json"
USES = {
    "fixed": ("for an engine, lights to export", "lights"),
    "distribution": ("for a path tracer, directions drawn at each point", "samples"),
}
"""By league, what its samplers are for, and what is counted."""


def advise(
    environment: Environment,
    lights: Annotated[
        int, typer.Option(min=0, max=1 << 20, help="For so many lights; 16 by default.")
    ] = 0,
    rays: Annotated[float, typer.Option(min=0.0, help="For so many rays per sub-pixel.")] = 0.0,
    seconds: Annotated[
        float, typer.Option(min=0.0, help="For so many seconds on this machine, lights included.")
    ] = 0.0,
    error: Annotated[
        float, typer.Option(min=0.0, help="For the least count that reaches this error.")
    ] = 0.0,
    metric: Annotated[
        str, typer.Option(help="By which error; else the one that tables are sorted by.")
    ] = "",
    width: Annotated[int, typer.Option(min=1, max=16384, help="Of the image, for times.")] = 640,
    height: Annotated[int, typer.Option(min=1, max=16384)] = 480,
    subpixels: Annotated[int, typer.Option(min=1, max=64)] = 4,
    table: Annotated[
        Path | None, typer.Option(help="One that advice-table made; else the published one.")
    ] = None,
    repair: Repair = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the advice as JSON.")] = False,
) -> None:
    """Which sampler for this map, for an engine and for a path tracer, and what error to expect."""
    with telling(f"looking at {environment}"):
        from experiments.maps.features import map_features
        from experiments.questions.advice.expected import Wish
        from experiments.questions.advice.expected import advise as advice_for
        from experiments.questions.advice.measured import load_measured

        kind, amount = _asked(lights, rays, seconds, error)
        known = load_measured(table or Path(str(files("experiments.questions.advice") / TABLE)))
        speed = 1.0
        if kind == "seconds":
            from experiments.questions.which_sampler import speed_here

            speed = speed_here(known)
        source = load_map(environment, repair)
        features = map_features(source)
    wish = Wish(kind, amount, metric or list(known.labels)[-1], width * height * subpixels, speed)
    found = advice_for(known, features, wish)
    commands = {one.league: command_for(environment, one) for one in found.answers}
    if as_json:
        print(json.dumps(_plain({**asdict(found), "commands": commands}), ensure_ascii=False))
    else:
        image = f"{width}×{height} pixels with {subpixels} sub-pixels"
        print("\n".join(in_words(known, found, source.name, commands, image)))


def _asked(lights: int, rays: float, seconds: float, error: float) -> "tuple[Kind, float]":
    """The one budget that was given; EnvlightError for two."""
    from samplers import EnvlightError

    given: dict[Kind, float] = {
        "lights": float(lights),
        "rays": rays,
        "seconds": seconds,
        "error": error,
    }
    asked = [(kind, amount) for kind, amount in given.items() if amount > 0.0]
    if len(asked) > 1:
        names = " and ".join(f"--{kind}" for kind, _ in asked)
        raise EnvlightError(f"{names}: give one of them")
    return asked[0] if asked else ("lights", float(LIGHTS))


def command_for(environment: str, answer: "Answer") -> str:
    """The command that makes those lights, or renders by that distribution."""
    what = "lights" if answer.league == "fixed" else "render"
    words = ["envlight", what, environment, "--sampler", answer.chosen.sampler]
    return shlex.join([*words, "--count", str(answer.chosen.count)])


def in_words(
    table: "Measured", advice: "Advice", name: str, commands: dict[str, str], image: str
) -> "Iterator[str]":
    """The advice as a person reads it, line by line."""
    from experiments.questions.advice.expected import judged_wish, worth

    source, label = table.source, advice.label
    known = f"{len(table.maps)} maps were measured"
    if advice.measured_as:
        yield f"{name}: measured, as {advice.measured_as}; {known}"
    else:
        yield f"{name}: not measured; expected from the maps like it; {known}"
    for answer in advice.answers:
        one, (use, unit) = answer.chosen, USES[answer.league]
        yield f"\n{use}: {one.sampler}, {one.count} {unit}"
        between = f", between {one.low:.4f} and {one.high:.4f} on four of five maps like it"
        yield f"  {label} {one.error:.4f}{'' if advice.measured_as else between}"
        yield (
            f"  {one.rays:.3g} rays per sub-pixel, {1e3 * one.seconds_lights:.3g} ms to prepare, "
            f"{one.seconds_image:.3g} s to render for {image}"
        )
        if answer.runner_up is not None:
            yield f"  {_runner_up(advice, answer)}"
        if not advice.measured_as:
            judged = judged_wish(table, advice.wish, one)
            yield from (
                _worth(x, judged) for x in worth(table, judged) if x.league == answer.league
            )
        yield f"  {commands[answer.league]}"
    chosen = " and ".join(one.chosen.sampler for one in advice.answers)
    yield f"\nmost like it, by share of what is expected, and {label} of {chosen} there:"
    for alike in advice.alike:
        errors = " and ".join(f"{error:.4f}" for error in alike.errors)
        yield f"  {alike.name} ({100.0 * alike.share:.0f} %): {errors}"
    if advice.beyond:
        yield (
            f"beyond all measured maps by {', '.join(advice.beyond)}: less is sure than the "
            "intervals say"
        )
    low, high = source["one_scene"][advice.wish.metric]
    here = advice.wish.kind == "seconds"
    whose = "this machine" if here else f"the machine that measured ({source['machine']})"
    yield (
        f"errors are means over the scenes {', '.join(source['scenes'])} in images of "
        f"{', '.join(source['images'])} pixels, mostly {low:.2f} to {high:.2f} times that on one "
        f"of them; times are those of {whose}"
    )


def _runner_up(advice: "Advice", answer: "Answer") -> str:
    one, other = answer.chosen, answer.runner_up
    assert other is not None
    then = f"then {other.sampler} with {other.count}: {advice.label} {other.error:.4f}"
    if advice.measured_as or math.isnan(answer.better):
        return then
    share = 100.0 * answer.better
    return f"{then}; {one.sampler} is better on {share:.0f} % of the maps like it"


def _worth(found: "Worth", judged: "Wish") -> str:
    return (
        f"  at {judged.kind}={judged.amount:.3g} on {found.maps} maps kept aside, advice errs "
        f"{found.choice:.2f} times as much as the best one there, always {found.average} "
        f"{found.always:.2f}, any {found.random:.2f}"
    )


def _plain(value: Any) -> Any:
    """The same with None for what JSON has no number for."""
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def advice_table(
    runs: Annotated[
        list[Path], typer.Argument(help="Folders of runs, or published ones, with map features.")
    ],
    output: Annotated[Path, typer.Option(help="The table, a JSON file.")],
) -> None:
    """Gather the table that advise reads from runs such as which-sampler; tell what it is worth."""
    from experiments.questions.advice.measured import to_json
    from experiments.questions.which_sampler import gathered, regret_table
    from experiments.report.tables import print_tables
    from experiments.run.loaded_run import Run, write_text
    from experiments.run.outputs import Kind, check_output

    check_output(output, Kind("a table of measured errors", (b'"machine_seconds":',)))
    found = gathered([Run.load(folder) for folder in runs])
    write_text(output, to_json(found))
    print_tables([regret_table(found)])
    print(output)
