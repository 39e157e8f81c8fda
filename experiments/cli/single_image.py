"""What `envlight render` and `inspect` do: one map, one sampler, one picture."""

import os
from dataclasses import dataclass
from pathlib import Path

from experiments.maps.sources import repair_sentence, single_environment
from experiments.run.parameters import parse_parameters
from samplers import EnvironmentMap, EnvlightError

MAP_HEIGHT = 512
"""Rows of the embedded maps."""
MOST_SUBPIXELS = 1 << 27


def _load(text: str, repair: bool) -> EnvironmentMap:
    """An embedded map by its name, or a file by its path."""
    environment = single_environment(text, MAP_HEIGHT, repair).load()
    if environment.repaired:
        print(repair_sentence(environment.name, environment.repaired))
    return environment


def check_output(output: Path) -> None:
    """EnvlightError where a picture could not be written, said before the work is done."""
    folder = output.parent
    if not output.name or output.is_dir():
        raise EnvlightError(f"--output {output}: it names a folder; give a file's name")
    existing = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    if not existing.is_dir() or not os.access(existing, os.W_OK):
        raise EnvlightError(f"--output {output}: {existing} cannot be written; give another place")


@dataclass(frozen=True)
class RenderRequest:
    """The options of `envlight render`."""

    environment: str
    scene: str
    sampler: str
    count: int
    parameters: list[str]
    width: int
    height: int
    subpixels: int
    seed: int
    repair: bool
    output: Path


def render(request: RenderRequest) -> None:
    """Render one image and write it as OpenEXR and PNG."""
    import numpy as np

    from experiments.report.preview import encoded
    from metrics.errors import exposure_scale
    from renderer.image import write_exr, write_png
    from renderer.reference import render_reference
    from renderer.render import render as render_image
    from renderer.scene.load import load_scene
    from renderer.view import make_view
    from samplers import make_sampler

    # Names may hold dots (a file called map_1.5 say), so suffixes are added, never replaced.
    check_output(request.output)
    exr, png = (request.output.with_name(request.output.name + end) for end in (".exr", ".png"))
    if request.width * request.height * request.subpixels > MOST_SUBPIXELS:
        raise EnvlightError(
            f"{request.width}×{request.height} pixels with {request.subpixels} sub-pixels: use at "
            f"most {MOST_SUBPIXELS:,} sub-pixels in all"
        )
    parameters = parse_parameters(request.parameters)
    if request.sampler == "reference" and parameters:
        raise EnvlightError("the reference has no parameters; leave --set out")
    sampler = (
        None if request.sampler == "reference" else make_sampler(request.sampler, **parameters)
    )
    scene = load_scene(request.scene)
    environment = _load(request.environment, request.repair)
    view = make_view(scene, request.width, request.height, request.subpixels)
    if sampler is None:
        reference = render_reference(view, environment, 0.01, 4096, request.seed)
        image, note = reference.image, f"noise floor {reference.noise_floor:.3g}"
    else:
        rng = np.random.default_rng(request.seed)
        lighting = sampler.prepare(environment, request.count, rng)
        rendering = render_image(view, lighting, environment, seed=request.seed)
        image, note = rendering.image, f"{rendering.rays.traced} rays, {rendering.seconds:.2f} s"
    write_exr(exr, image)
    write_png(png, encoded(image * exposure_scale(image, view.coverage > 0.0)))
    print(f"{scene.name} · {environment.name} · {request.sampler}: {note}")
    print(f"{exr}\n{png}")


def inspect_map(
    environment: str,
    sampler: str,
    count: int,
    parameters: list[str],
    seed: int,
    repair: bool,
    output: Path,
) -> None:
    """Print a map's statistics and draw its emissive region and lights."""
    import numpy as np

    from experiments.report.map_picture import draw_map, statistics
    from renderer.image import write_png
    from samplers import make_sampler

    check_output(output)
    chosen = make_sampler(sampler, **parse_parameters(parameters))
    source = _load(environment, repair)
    for name, value in statistics(source).items():
        print(f"{name:28} {value}")
    lighting = chosen.prepare(source, count, np.random.default_rng(seed))
    write_png(output, draw_map(source, lighting))
    print(f"{output}")
