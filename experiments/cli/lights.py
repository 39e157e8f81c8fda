"""What `envlight lights` does: the lights of a map by a sampler, as a file or on the terminal."""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.cli.single_image import MAP_HEIGHT, check_output
from experiments.export.blender import as_blender
from experiments.export.light_set import LightSet, light_set
from experiments.export.text import as_csv, as_json
from experiments.export.usd import as_usd
from experiments.maps.sources import repair_sentence, single_environment
from experiments.run.parameters import parse_parameters
from experiments.run.record import write_text
from experiments.run.sampler_choice import single_sampler
from renderer.image import write_exr
from samplers import EnvlightError, make_sampler

TEXTS = {"json": as_json, "csv": as_csv, "blender": as_blender}
USD = "usd"
USD_SUFFIXES = (".usda", ".usdc", ".usd")
SUFFIXES = {".json": "json", ".csv": "csv", ".py": "blender", **dict.fromkeys(USD_SUFFIXES, USD)}


@dataclass(frozen=True)
class LightsRequest:
    """The options of `envlight lights`; an empty format is told by the output's suffix."""

    environment: str
    sampler: str
    count: int
    parameters: list[str]
    file_format: str
    seed: int
    repair: bool
    output: Path | None


def write_lights(request: LightsRequest) -> None:
    """Write the lights; EnvlightError for a distribution, or a format that does not exist."""
    kind = _format(request)
    if request.output is not None:
        check_output(request.output)
    spec = single_sampler(request.sampler)
    sampler = make_sampler(
        spec.name, **{**dict(spec.parameters), **parse_parameters(request.parameters)}
    )
    environment = single_environment(request.environment, MAP_HEIGHT, request.repair).load()
    if environment.repaired:
        print(repair_sentence(environment.name, environment.repaired), file=sys.stderr)
    lighting = sampler.prepare(environment, request.count, np.random.default_rng(request.seed))
    lights = light_set(lighting, environment, spec.label, request.count, request.seed)
    _write(lights, kind, request.output)
    print(f"{lights.title}{_angles(lights)}", file=sys.stderr)
    if lights.ambient is not None:
        print(_ambient(lights, request.output), file=sys.stderr)


def _format(request: LightsRequest) -> str:
    if request.file_format:
        if request.file_format not in (*TEXTS, USD):
            raise EnvlightError(f"--format {request.file_format}: use {', '.join(TEXTS)} or {USD}")
        return request.file_format
    if request.output is None:
        return "json"
    suffix = request.output.suffix.lower()
    if suffix not in SUFFIXES:
        raise EnvlightError(
            f"--output {request.output}: the suffix tells no format; give --format, or one of "
            f"{', '.join(SUFFIXES)}"
        )
    return SUFFIXES[suffix]


def _write(lights: LightSet, kind: str, output: Path | None) -> None:
    if kind != USD:
        text = TEXTS[kind](lights)
        if output is None:
            print(text, end="")
        else:
            write_text(output, text)
        return
    stage = as_usd(lights)
    if output is None:
        print(stage.GetRootLayer().ExportToString(), end="")
    elif output.suffix.lower() not in USD_SUFFIXES:
        raise EnvlightError(f"--output {output}: name a USD file {', '.join(USD_SUFFIXES)}")
    else:
        stage.GetRootLayer().Export(str(output))


def _angles(lights: LightSet) -> str:
    largest = max((layer.angle.max(initial=0.0) for layer in lights.layers), default=0.0)
    return f"; angular radius up to {np.degrees(largest):.3g}°"


def _ambient(lights: LightSet, output: Path | None) -> str:
    """Write the ambient remainder beside the lights, where those go to a file; say what it is."""
    assert lights.ambient is not None
    whole = lights.ambient.total_flux + sum(layer.irradiance.sum(0) for layer in lights.layers)
    share = f"{100.0 * lights.ambient.total_flux.sum() / max(whole.sum(), 1e-300):.1f} %"
    sentence = f"the ambient remainder, {share} of the energy, is no light"
    if output is None:
        return f"{sentence}; with --output it is written beside the lights"
    path = output.with_name(f"{output.name}.ambient.exr")
    write_exr(path, lights.ambient.radiance)
    return f"{sentence}; it is written as a map to {path}"
