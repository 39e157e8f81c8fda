"""The commands about one map and one sampler: `envlight render`, `inspect` and `lights`.

Heavy imports stand inside, so that `--help` answers at once.
"""

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TextIO

import typer

if TYPE_CHECKING:
    from experiments.export.light_set import LightSet
    from samplers import EnvironmentMap, LightSampler

MAP_HEIGHT = 512
"""Rows of the embedded maps."""
MOST_SUBPIXELS = 1 << 27
TEXTS = ("json", "csv", "blender")
USD = "usd"
USD_SUFFIXES = (".usda", ".usdc", ".usd")
SUFFIXES = {".json": "json", ".csv": "csv", ".py": "blender", **dict.fromkeys(USD_SUFFIXES, USD)}

Environment = Annotated[str, typer.Argument(help="An embedded map's name, or a file.")]
Count = Annotated[int, typer.Option(min=1, max=1 << 20, help="Number of lights.")]
Repair = Annotated[bool, typer.Option("--repair", help="Clamp NaN, infinity and negatives.")]
Seed = Annotated[int, typer.Option(min=0, help="Seed of everything random.")]
Parameters = Annotated[
    list[str] | None,
    typer.Option("--set", help="A sampler's parameter, as name=value; repeatable."),
]


def _load(text: str, repair: bool, told: TextIO | None = None) -> "EnvironmentMap":
    """An embedded map by its name, or a file by its path; what was repaired is `told`."""
    from experiments.maps.sources import repair_sentence, single_environment

    environment = single_environment(text, MAP_HEIGHT, repair).load()
    if environment.repaired:
        print(repair_sentence(environment.name, environment.repaired), file=told)
    return environment


def check_output(output: Path, option: str = "--output") -> None:
    """EnvlightError where a file could not be written, said before the work is done."""
    from samplers import EnvlightError

    folder = output.parent
    if not output.name or output.is_dir():
        raise EnvlightError(f"{option} {output}: it names a folder; give a file's name")
    existing = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    if not existing.is_dir() or not os.access(existing, os.W_OK):
        raise EnvlightError(f"{option} {output}: {existing} cannot be written; give another place")


def render(
    environment: Environment,
    scene: Annotated[
        str, typer.Option(help="The scene's name, or the path of a scene's TOML file.")
    ] = "rubiks-cube",
    sampler: Annotated[
        str, typer.Option(help="The sampler's name, or 'reference'.")
    ] = "median-cut",
    count: Annotated[int, typer.Option(min=1, max=1 << 20, help="Lights per shading point.")] = 16,
    parameters: Parameters = None,
    width: Annotated[int, typer.Option(min=1, max=16384)] = 640,
    height: Annotated[int, typer.Option(min=1, max=16384)] = 480,
    subpixels: Annotated[int, typer.Option(min=1, max=64)] = 4,
    seed: Seed = 0,
    repair: Repair = False,
    output: Annotated[Path, typer.Option(help="Without suffix; .exr and .png are added.")] = Path(
        "render"
    ),
) -> None:
    """Render one image, as OpenEXR and PNG."""
    import numpy as np

    from experiments.report.preview import encoded
    from experiments.run.parameters import parse_parameters
    from metrics.errors import exposure_scale
    from renderer.image import write_exr, write_png
    from renderer.reference import render_reference
    from renderer.render import render as render_image
    from renderer.scene.load import load_scene
    from renderer.view import make_view
    from samplers import EnvlightError, make_sampler

    # Names may hold dots (a file called map_1.5 say), so suffixes are added, never replaced.
    check_output(output)
    exr, png = (output.with_name(output.name + end) for end in (".exr", ".png"))
    if width * height * subpixels > MOST_SUBPIXELS:
        raise EnvlightError(
            f"{width}×{height} pixels with {subpixels} sub-pixels: use at "
            f"most {MOST_SUBPIXELS:,} sub-pixels in all"
        )
    chosen = parse_parameters(parameters or [])
    if sampler == "reference" and chosen:
        raise EnvlightError("the reference has no parameters; leave --set out")
    made = None if sampler == "reference" else make_sampler(sampler, **chosen)
    loaded = load_scene(scene)
    source = _load(environment, repair)
    view = make_view(loaded, width, height, subpixels)
    if made is None:
        reference = render_reference(view, source, 0.01, 4096, seed)
        image, note = reference.image, f"noise floor {reference.noise_floor:.3g}"
    else:
        lighting = made.prepare(source, count, np.random.default_rng(seed))
        rendering = render_image(view, lighting, source, seed=seed)
        image, note = rendering.image, f"{rendering.rays.traced} rays, {rendering.seconds:.2f} s"
    write_exr(exr, image)
    write_png(png, encoded(image * exposure_scale(image, view.coverage > 0.0)))
    print(f"{loaded.name} · {source.name} · {sampler}: {note}")
    print(f"{exr}\n{png}")


def inspect(
    environment: Environment,
    sampler: Annotated[str, typer.Option(help="Draw this sampler's lights.")] = "median-cut",
    count: Count = 16,
    parameters: Parameters = None,
    seed: Seed = 0,
    repair: Repair = False,
    output: Annotated[Path, typer.Option(help="The picture.")] = Path("inspect.png"),
) -> None:
    """Print a map's statistics; draw it with its emissive region and a sampler's lights."""
    import numpy as np

    from experiments.report.map_picture import draw_map, statistics
    from experiments.run.parameters import parse_parameters
    from renderer.image import write_png
    from samplers import make_sampler

    check_output(output)
    chosen = make_sampler(sampler, **parse_parameters(parameters or []))
    source = _load(environment, repair)
    for name, value in statistics(source).items():
        print(f"{name:28} {value}")
    lighting = chosen.prepare(source, count, np.random.default_rng(seed))
    write_png(output, draw_map(source, lighting))
    print(f"{output}")


def lights(
    environment: Environment,
    sampler: Annotated[str, typer.Option(help="Name or FILE:CLASS.")] = "median-cut",
    count: Count = 16,
    parameters: Parameters = None,
    file_format: Annotated[
        str, typer.Option("--format", help="json, csv, usd or blender; else by the suffix.")
    ] = "",
    seed: Seed = 0,
    repair: Repair = False,
    output: Annotated[Path | None, typer.Option(help="The file; else the terminal.")] = None,
    residual: Annotated[
        Path | None,
        typer.Option(help="Write the map without what the lights carry to this .exr file."),
    ] = None,
) -> None:
    """Write a sampler's lights for other programs: JSON, CSV, USD, or a Blender script."""
    import numpy as np

    from experiments.export.light_set import light_set
    from experiments.run.parameters import parse_parameters
    from experiments.run.sampler_choice import single_sampler
    from samplers import make_sampler

    kind = _format(file_format, output)
    if output is not None:
        check_output(output)
    if residual is not None:
        _check_residual(residual, output)
    spec = single_sampler(sampler)
    own = {**dict(spec.parameters), **parse_parameters(parameters or [])}
    source = _load(environment, repair, sys.stderr)
    chosen, rng = make_sampler(spec.name, **own), np.random.default_rng(seed)
    if residual is None:
        found = light_set(chosen.prepare(source, count, rng), source, spec.label, count, seed)
    else:
        found = _with_residual(chosen, source, spec.label, count, seed, residual, output)
    _write(found, kind, output)
    largest = max((layer.angle.max(initial=0.0) for layer in found.layers), default=0.0)
    print(f"{found.title}; angular radius up to {np.degrees(largest):.3g}°", file=sys.stderr)
    if found.ambient is not None:
        print(_ambient(found, output), file=sys.stderr)


def _check_residual(residual: Path, output: Path | None) -> None:
    """EnvlightError where the residual could not be written, or would be read as something else."""
    from samplers import EnvlightError

    if residual.suffix.lower() != ".exr":
        raise EnvlightError(f"--residual {residual}: it is an OpenEXR map; name it FILE.exr")
    if output is not None and residual.resolve() == output.resolve():
        raise EnvlightError(f"--residual {residual}: the lights go there; name another file")
    check_output(residual, "--residual")


def _with_residual(
    sampler: "LightSampler", source: "EnvironmentMap", label: str, count: int, seed: int,
    residual: Path, output: Path | None,
) -> "LightSet":  # fmt: skip
    """A sampler's lights, and the file with what they leave of the map; says what that is."""
    from dataclasses import replace

    import numpy as np

    from experiments.export.light_set import light_set
    from experiments.export.residual import audit, part
    from renderer.image import write_exr

    parted = part(sampler, source, count, np.random.default_rng(seed))
    found = light_set(parted.lights, source, label, count, seed, parted.layer)
    write_exr(residual, parted.residual.radiance)
    print(f"{parted.meaning}\n{audit(parted)}\n{residual}", file=sys.stderr)
    return replace(
        found, ambient=None, residual=parted.residual, residual_file=_named_in(output, residual)
    )


def _named_in(output: Path | None, file: Path) -> str:
    """How a file of lights names another: by its place beside or below it, or in full."""
    whole = file.resolve()
    # Blender does not know where a script lies.
    if output is not None and output.suffix != ".py":
        folder = output.resolve().parent
        if whole.is_relative_to(folder):
            return f"./{whole.relative_to(folder).as_posix()}"
    return whole.as_posix()


def _format(wanted: str, output: Path | None) -> str:
    """The format that is named, or else told by the output's suffix."""
    from samplers import EnvlightError

    if wanted:
        if wanted not in (*TEXTS, USD):
            raise EnvlightError(f"--format {wanted}: use {', '.join(TEXTS)} or {USD}")
        return wanted
    if output is None:
        return "json"
    if output.suffix.lower() not in SUFFIXES:
        raise EnvlightError(
            f"--output {output}: the suffix tells no format; give --format, or one of "
            f"{', '.join(SUFFIXES)}"
        )
    return SUFFIXES[output.suffix.lower()]


def _write(found: "LightSet", kind: str, output: Path | None) -> None:
    from experiments.export import formats
    from experiments.run.record import write_text
    from samplers import EnvlightError

    if kind != USD:
        text = getattr(formats, f"as_{kind}")(found)
        if output is None:
            print(text, end="")
        else:
            write_text(output, text)
        return
    stage = formats.as_usd(found)
    if output is None:
        print(stage.GetRootLayer().ExportToString(), end="")
    elif output.suffix.lower() not in USD_SUFFIXES:
        raise EnvlightError(f"--output {output}: name a USD file {', '.join(USD_SUFFIXES)}")
    else:
        stage.GetRootLayer().Export(str(output))


def _ambient(found: "LightSet", output: Path | None) -> str:
    """Write the ambient remainder beside the lights, where those go to a file; say what it is."""
    from renderer.image import write_exr

    assert found.ambient is not None
    whole = found.ambient.total_flux + sum(layer.irradiance.sum(0) for layer in found.layers)
    share = f"{100.0 * found.ambient.total_flux.sum() / max(whole.sum(), 1e-300):.1f} %"
    sentence = f"the ambient remainder, {share} of the energy, is no light"
    if output is None:
        return f"{sentence}; with --output it is written beside the lights"
    path = output.with_name(f"{output.name}.ambient.exr")
    write_exr(path, found.ambient.radiance)
    return f"{sentence}; it is written as a map to {path}"
