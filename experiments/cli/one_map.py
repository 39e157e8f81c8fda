"""The commands about one map: `envlight render`, `inspect` and `new-map`.

Heavy imports stand inside, so that `--help` answers at once.
"""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.progress import telling

if TYPE_CHECKING:
    from samplers import EnvironmentMap

MAP_HEIGHT = 512
"""Rows of the embedded maps."""
MOST_SUBPIXELS = 1 << 27

Environment = Annotated[str, typer.Argument(help="An embedded map's name, or a file.")]
Count = Annotated[int, typer.Option(min=1, max=1 << 20, help="Number of lights.")]
Repair = Annotated[bool, typer.Option("--repair", help="Clamp NaN, infinity and negatives.")]
Seed = Annotated[int, typer.Option(min=0, help="Seed of everything random.")]
Sampler = Annotated[str, typer.Option(help="Name, NAME\\[a=1], or FILE:CLASS.")]


def load_map(text: str, repair: bool) -> "EnvironmentMap":
    """An embedded map by its name, or a file by its path; tells of repairs and of clipping."""
    from experiments.maps.sources import clipping_sentence, repair_sentence, single_environment

    environment = single_environment(text, MAP_HEIGHT, repair).load()
    if environment.repair:
        print(repair_sentence(environment.name, environment.repair), file=sys.stderr)
    clipped = clipping_sentence(environment)
    if clipped:
        print(clipped, file=sys.stderr)
    return environment


def files_read(environment: str, sampler: str = "", scene: str = "") -> list[Path | str]:
    """The files that a command reads, which it must not write over."""
    from experiments.run.identity import dependencies
    from experiments.run.sampler_spec import single_sampler
    from renderer.scene.load import files_of, is_scene_file

    found: list[Path | str] = [environment, scene]
    if scene and is_scene_file(scene):
        found += files_of(scene).values()
    if ".py:" in sampler:
        found += dependencies(type(single_sampler(sampler).sampler).__module__).values()
    return found


def render(
    environment: Environment,
    scene: Annotated[
        str, typer.Option(help="The scene's name, or its file: .toml, .glb, .xml, .pbrt, a mesh.")
    ] = "rubiks-cube",
    sampler: Annotated[
        str, typer.Option(help="Name, NAME\\[a=1], FILE:CLASS, or 'reference'.")
    ] = "median-cut",
    count: Annotated[int, typer.Option(min=1, max=1 << 20, help="Lights per shading point.")] = 16,
    width: Annotated[int, typer.Option(min=1, max=16384)] = 640,
    height: Annotated[int, typer.Option(min=1, max=16384)] = 480,
    subpixels: Annotated[int, typer.Option(min=1, max=64)] = 4,
    seed: Seed = 0,
    repair: Repair = False,
    output: Annotated[
        Path, typer.Option(help="The image is NAME.exr, and exposed NAME.png.")
    ] = Path("render"),
) -> None:
    """Render one image, as OpenEXR and PNG."""
    with telling(f"{scene} · {sampler}"):
        import numpy as np

        from experiments.run.outputs import EXR, PNG, check_name, check_output
        from experiments.run.sampler_spec import single_sampler
        from metrics.errors import exposure_scale
        from renderer.image import write_exr, write_png
        from renderer.reference import render_reference
        from renderer.render import render as render_image
        from renderer.scene.load import load_scene
        from renderer.view import make_view
        from samplers import EnvlightError
        from samplers.conformance.lighting_check import prepared
        from samplers.preview import encoded

        check_name(output)
        # Names may hold dots (a file called map_1.5 say): no other suffix is taken off.
        stem = output.name.removesuffix(".exr").removesuffix(".png")
        exr, png = (output.with_name(stem + end) for end in (".exr", ".png"))
        for file, kind in ((exr, EXR), (png, PNG)):
            check_output(file, kind, reads=files_read(environment, sampler, scene))
        if width * height * subpixels > MOST_SUBPIXELS:
            raise EnvlightError(
                f"{width}×{height} pixels with {subpixels} sub-pixels: use at "
                f"most {MOST_SUBPIXELS:,} sub-pixels in all"
            )
        made = None if sampler == "reference" else single_sampler(sampler)
        loaded = load_scene(scene)
        source = load_map(environment, repair)
        view = make_view(loaded, width, height, subpixels)
        if made is None:
            reference = render_reference(view, source, 0.01, 4096, seed)
            image, note = reference.image, f"noise floor {reference.noise_floor:.3g}"
        else:
            lighting = prepared(made.sampler, source, count, np.random.default_rng(seed))
            done = render_image(view, lighting, source, seed=seed)
            image, note = done.image, f"{done.rays.traced} rays, {done.seconds:.2f} s"
    write_exr(exr, image)
    write_png(png, encoded(image * exposure_scale(image, view.coverage > 0.0)))
    print(f"{loaded.name} · {source.name} · {sampler}: {note}")
    print(f"{exr}\n{png}")


def inspect(
    environment: Environment,
    sampler: Sampler = "median-cut",
    count: Count = 16,
    seed: Seed = 0,
    repair: Repair = False,
    output: Annotated[Path, typer.Option(help="The picture.")] = Path("inspect.png"),
) -> None:
    """Print a map's statistics; draw it with its emissive region and a sampler's lights."""
    with telling(f"looking at {environment}"):
        import numpy as np

        from experiments.report.map_picture import circles, draw_circles, statistics
        from experiments.run.outputs import PNG, check_output
        from experiments.run.sampler_spec import single_sampler
        from renderer.image import write_png
        from samplers import EnvlightError
        from samplers.conformance.lighting_check import prepared

        if output.suffix.lower() != ".png":
            raise EnvlightError(f"--output {output}: it is a PNG picture; name it FILE.png")
        check_output(output, PNG, reads=files_read(environment, sampler))
        chosen = single_sampler(sampler).sampler
        source = load_map(environment, repair)
        told = statistics(source)
        lighting = prepared(chosen, source, count, np.random.default_rng(seed))
        write_png(output, draw_circles(source, circles(lighting)))
    for name, value in told.items():
        print(f"{name:28} {value}")
    print(f"{output}")


def new_map(
    file: Annotated[Path, typer.Argument(help="An .exr or .hdr picture of the whole sphere.")],
    output: Annotated[Path, typer.Argument(help="The latitude-longitude map, an .exr file.")],
    projection: Annotated[
        str,
        typer.Option(
            help="lat-long, cube-cross, cube-column, cube-row, cube-stack, octahedral, angular or "
            "mirror-ball; else by the picture's shape."
        ),
    ] = "",
    height: Annotated[int, typer.Option(min=0, max=16384, help="Rows; 0: as many as seen.")] = 0,
) -> None:
    """Make a latitude-longitude map of another projection or size; no energy is lost."""
    from experiments.run.outputs import EXR, check_output
    from renderer.image import write_exr
    from samplers import EnvlightError
    from samplers.files.image_file import read_radiance
    from samplers.files.projections import to_lat_long

    if output.suffix.lower() != ".exr":
        raise EnvlightError(f"{output}: it is an OpenEXR map; name it FILE.exr")
    check_output(output, EXR, "OUTPUT", [file])
    made = to_lat_long(read_radiance(file), projection, height, file.stem)
    write_exr(output, made.radiance)
    print(f"{output}: {made.width}×{made.height} pixels")
