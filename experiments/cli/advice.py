"""The commands `envlight advise` and `envlight train-advice`.

Heavy imports stand inside, so that `--help` answers at once, and advice comes within a second.
"""

import json
import math
import shlex
import sys
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from experiments.cli.one_map import Environment, Repair, load_map

if TYPE_CHECKING:
    from experiments.questions.advice.choice import Advice, Expected, Kind
    from experiments.questions.advice.reasons import Reason

LIGHTS = 16
"""The budget where none is given."""
MODEL = "model.json"


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
    league: Annotated[
        str, typer.Option(help="all, fixed (sets of lights), or distribution.")
    ] = "all",
    width: Annotated[int, typer.Option(min=1, max=16384, help="Of the image, for seconds.")] = 640,
    height: Annotated[int, typer.Option(min=1, max=16384)] = 480,
    subpixels: Annotated[int, typer.Option(min=1, max=64)] = 4,
    model: Annotated[
        Path | None, typer.Option(help="A model that train-advice made; else the published one.")
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(help="Draw error against count among all maps, as .svg or .png.")
    ] = None,
    repair: Repair = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the advice as JSON.")] = False,
) -> None:
    """Which sampler for this map, how many lights, and what error to expect."""
    from experiments.maps.features import map_features
    from experiments.questions.advice.choice import Wish
    from experiments.questions.advice.choice import advise as advice_for
    from experiments.questions.advice.model_file import load_model

    if picture is not None:
        _check_picture(picture, [environment, *([model] if model else [])])
    kind, amount = _asked(lights, rays, seconds, error)
    known = load_model(model or Path(str(files("experiments.questions.advice") / MODEL)))
    speed = 1.0
    if kind == "seconds":
        from experiments.questions.advice.speed import speed_here

        speed = speed_here(known)[0]
    source = load_map(environment, repair, sys.stderr)
    columns = map_features(source)
    wish = Wish(
        kind, amount, metric or list(known.labels)[-1], league, width * height * subpixels, speed
    )
    found = advice_for(known, columns, wish)
    command = command_for(environment, found.chosen, known.leagues[
        known.samplers.index(found.chosen.sampler)])  # fmt: skip
    if as_json:
        print(json.dumps(_plain({**asdict(found), "command": command}), ensure_ascii=False))
    else:
        print(in_words(found, source.name, command, known.source))
    if picture is not None:
        import matplotlib as mpl

        from experiments.questions.advice.plots import among_maps
        from experiments.report.figures import write_figure
        from experiments.report.style import STYLE

        with mpl.rc_context(STYLE):
            write_figure(among_maps(known, found, source.name), picture, dpi=110)
        print(picture, file=sys.stderr)


def _check_picture(picture: Path, reads: list[Path | str]) -> None:
    from experiments.run.outputs import PICTURES, check_output
    from samplers import EnvlightError

    kind = PICTURES.get(picture.suffix.lower())
    if kind is None:
        raise EnvlightError(f"--picture {picture}: name a file {', '.join(PICTURES)}")
    check_output(picture, kind, "--picture", reads)


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


def command_for(environment: str, chosen: "Expected", league: str) -> str:
    """The command that makes those lights; a distribution has none, it renders."""
    what = "render" if league.startswith("distribution") else "lights"
    words = ["envlight", what, environment, "--sampler", chosen.sampler]
    words += ["--count", str(chosen.count)]
    return shlex.join(words)


def in_words(advice: "Advice", name: str, command: str, source: Any) -> str:
    """The advice as a person reads it."""
    wish, chosen, label = advice.wish, advice.chosen, advice.label
    lines = [
        f"{name}: {chosen.sampler} with {chosen.count} lights or samples per shading point",
        f"  expected {label} {chosen.error:.4f}, between {chosen.low:.4f} and {chosen.high:.4f} on "
        f"four of five maps; {chosen.rays:.1f} rays per sub-pixel",
    ]
    if wish.kind == "seconds":
        lines.append(f"  {chosen.seconds:.3g} s on this machine, for lights and image")
    if advice.runner_up is not None:
        other = advice.runner_up
        lines.append(
            f"  then {other.sampler} with {other.count}: {label} {other.error:.4f}; on "
            f"{100.0 * advice.sureness:.0f} % of the measured maps the order would stay"
        )
    lines += _on_choosing(advice)
    lines += _why("why an error of this size:", advice.level)
    if advice.runner_up is not None:
        lines += _why(f"why {chosen.sampler} against {advice.runner_up.sampler}:", advice.order)
    if advice.beyond:
        lines.append(
            f"  beyond all measured maps by {', '.join(advice.beyond)}: it is taken to be as the "
            "nearest of them, and less is sure than the interval says"
        )
    lines.append(f"  most alike of the measured maps, and {chosen.sampler}'s {label} there:")
    for one in advice.alike:
        lines.append(f"    {one.name}: {one.error:.4f} with {one.count}")
    low, high = source["single_scene"][wish.metric]
    lines.append(
        f"  known from {source['maps']} maps in images of {', '.join(source['images'])} pixels; "
        f"errors are means over the scenes {', '.join(source['scenes'])}, on one of which it is "
        f"mostly {low:.2f} to {high:.2f} times that"
    )
    lines.append(f"  {command}")
    return "\n".join(lines)


def _on_choosing(advice: "Advice") -> list[str]:
    verdict = advice.verdict
    if verdict is None:
        return []
    at = f"at {verdict.kind}={verdict.amount:g}, on maps left out, "
    worth = (
        f"choosing by features gives {verdict.choice:.2f} times the best one's error, always "
        f"{verdict.average} {verdict.always:.2f}, any {verdict.random:.2f}"
    )
    lines = [f"  {at}{worth}"]
    if advice.by_average:
        reason = "its lead is too small" if verdict.better else "that is no better"
        lines.append(f"  {reason}, so the best on average is taken: {advice.chosen.sampler}")
    return lines


def _why(heading: str, reasons: "tuple[Reason, ...]") -> list[str]:
    if not reasons:
        return []
    return [f"  {heading}"] + [
        f"    {one.feature} {one.value:.3g}, higher than on {100.0 * one.higher_than:.0f} % of "
        f"maps: × {one.factor:.2f} ({one.meaning})"
        for one in reasons
    ]


def _plain(value: Any) -> Any:
    """The same with None for what JSON has no number for."""
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def train_advice(
    runs: Annotated[
        list[Path], typer.Argument(help="Folders of runs, or published ones, with map features.")
    ],
    output: Annotated[Path, typer.Option(help="The model, a JSON file.")],
    aside: Annotated[
        list[str] | None,
        typer.Option(help="Maps, by name: train without them, and judge the advice on them."),
    ] = None,
) -> None:
    """Train the model that advise asks, from the rows of runs such as which-sampler."""
    from experiments.maps.patterns import split_list
    from experiments.questions.advice.aside import judged_aside
    from experiments.questions.advice.model_file import to_json
    from experiments.questions.advice.sections import judged_tables
    from experiments.questions.advice.train import trained_without
    from experiments.report.tables import print_tables
    from experiments.run.loaded_run import Run
    from experiments.run.outputs import Kind, check_output
    from experiments.run.record import write_text

    check_output(output, Kind("a model of errors", (b'"seconds_per_ray": ',)))
    names = split_list(aside or ())
    trained, kept_aside = trained_without([Run.load(folder) for folder in runs], names)
    write_text(output, to_json(trained.model))
    print_tables(judged_tables(trained))
    if names:
        print_tables([judged_aside(trained.model, kept_aside)])
    print(output)
