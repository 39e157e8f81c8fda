"""Reference images for experiments that judge images of their own: rendered once per run folder."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.run.identity import digest, source_digest
from experiments.run.scale import Scale
from renderer.image import write_exr, write_whole
from renderer.reference import render_reference
from renderer.view import View
from samplers import EnvironmentMap, EnvlightError
from samplers.files.image_file import read_radiance


@dataclass(frozen=True, eq=False)
class KeptReference:
    """image : (height, width, 3), linear; noise_floor : its estimated RMSE"""

    image: NDArray[np.float32]
    noise_floor: float


def kept_reference(
    folder: Path, view: View, environment: EnvironmentMap, scale: Scale
) -> KeptReference:
    """The reference of a view under a map: from the folder where it is there, or made and kept.

    scale : gives the wanted noise and the most samples
    """
    identity = {
        "scene": view.scene.digest,
        "view": [view.width, view.height, view.subpixels],
        "map": environment.digest,
        "quality": [scale.noise_target, scale.max_samples],
        "source": source_digest("renderer.reference"),
    }
    path = folder / "references" / f"{digest(identity)}.exr"
    facts = path.with_suffix(".json")
    try:
        return KeptReference(read_radiance(path), json.loads(facts.read_text())["noise_floor"])
    except (EnvlightError, OSError, ValueError, KeyError):
        made = render_reference(
            view, environment, scale.noise_target, scale.max_samples,
            checkpoint=path.with_suffix(".partial.npz"),
        )  # fmt: skip
    write_exr(path, made.image)
    text = json.dumps({"noise_floor": made.noise_floor})
    write_whole(facts, lambda place: place.write_text(text))
    return KeptReference(made.image, made.noise_floor)
