"""Maps that several tests look at, and what lies in the data folder."""

import os
from pathlib import Path

import numpy as np
import pytest

from samplers import EnvironmentMap


def noisy_map(height: int, seed: int = 0, sun: float = 1.0) -> EnvironmentMap:
    """Log-normal noise, in which one texel is `sun` times as bright."""
    radiance = np.exp(np.random.default_rng(seed).normal(size=(height, 2 * height, 3)))
    radiance[height // 3, height // 2] *= sun
    return EnvironmentMap.from_array(radiance.astype(np.float32))


def data_folder(name: str) -> Path:
    """A folder of photographed maps or scanned meshes; skips where it is not there."""
    folder = Path(os.environ.get("ENVLIGHT_DATA", "none"), name)
    if not folder.is_dir():
        pytest.skip(f"ENVLIGHT_DATA names no folder with {name}/")
    return folder
