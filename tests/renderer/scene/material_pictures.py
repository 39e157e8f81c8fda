"""Pictures of the page about scenes: a teapot of each material that the page shows.

python -m tests.renderer.scene.material_pictures
"""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from experiments.maps.sources import single_environment
from metrics.errors import exposure_scale
from renderer import scenes
from renderer.image import write_webp
from renderer.render import render
from renderer.scene import Object, Scene
from renderer.scene.materials import Lambert, Material
from renderer.scene.scene_file import MATERIALS
from renderer.view import make_view
from samplers.inversion import MultipleImportance
from samplers.preview import encoded

FOLDER = Path(__file__).parents[3] / "renderer" / "scene"
WIDTH, HEIGHT, SUBPIXELS, SAMPLES = 240, 160, 16, 64


def blocks() -> list[str]:
    """The pieces of TOML on the page: a whole file first."""
    return re.findall(r"```toml\n(.*?)```", (FOLDER / "README.md").read_text("utf-8"), re.DOTALL)


def materials() -> Iterator[tuple[str, Material]]:
    """The types that the page shows, and the materials it makes of them."""
    for block in blocks()[1:]:
        for table in tomllib.loads(block)["materials"].values():
            kind = table.pop("type")
            yield kind, MATERIALS[kind](**table)


def main() -> None:
    """Render and write them."""
    scene = scenes.make("teapot")
    environment = single_environment("sunset-mountains", 512).load()
    lighting = MultipleImportance().prepare(environment, SAMPLES, np.random.default_rng(0))
    for kind, material in materials():
        objects = tuple(
            Object(one.name, one.mesh, Lambert((0.4,) * 3) if one.name == "ground" else material)
            for one in scene.objects
        )
        view = make_view(Scene(kind, objects, scene.camera), WIDTH, HEIGHT, SUBPIXELS)
        image = render(view, lighting, environment).image
        exposed = image * exposure_scale(image, view.coverage > 0.0)
        write_webp(FOLDER / "pictures" / f"{kind}.webp", encoded(exposed))


if __name__ == "__main__":
    main()
