"""Maps that several tests look at, and what lies in the data folder."""

import os
from collections.abc import Iterator
from pathlib import Path

import healpix
import numpy as np
import pytest
from numpy.typing import NDArray

from samplers import EnvironmentMap
from samplers.sphere import angular_distance, pixel_directions


def noisy_map(height: int, seed: int = 0, sun: float = 1.0) -> EnvironmentMap:
    """Log-normal noise, in which one texel is `sun` times as bright."""
    radiance = np.exp(np.random.default_rng(seed).normal(size=(height, 2 * height, 3)))
    radiance[height // 3, height // 2] *= sun
    return EnvironmentMap.from_array(radiance.astype(np.float32))


def sizes_of_a_sun(
    environment: EnvironmentMap, sun: NDArray[np.bool_], direction: NDArray[np.float64]
) -> Iterator[tuple[int, float, float]]:
    """Of each light at these directions that has pixels of a sun: its place, and the solid angles
    between which it has to be as large as what shines there.

    With a sun of radiance 1, flux and size a, and a sky of flux f and square q ≤ f:
    a ≤ (a + f)² / (a + q) ≤ a (1 + f / a)²."""
    owner = angular_distance(pixel_directions(len(sun))[:, :, None], direction).argmin(axis=-1)
    flux = environment.flux
    size = np.broadcast_to(environment.row_solid_angle[:, None], sun.shape)
    for light in np.unique(owner[sun]):
        mine = owner == light
        lit = float(size[mine & sun].sum())
        more = float(flux[mine & ~sun].sum()) / lit
        yield int(light), lit, lit * (1.0 + more) ** 2


def healpix_cells(direction: NDArray[np.float64], side: int) -> NDArray[np.int64]:
    """NESTED numbers of the cells that hold directions (n, 3), by HEALPix's own library.

    Its pole is z and its longitude runs from x; here they are +Y and φ."""
    x, y, z = direction.T
    cells: NDArray[np.int64] = healpix.vec2pix(side, -z, x, y, nest=True)
    return cells


def data_folder(name: str) -> Path:
    """A folder of photographed maps or scanned meshes; skips where it is not there."""
    folder = Path(os.environ.get("ENVLIGHT_DATA", "none"), name)
    if not folder.is_dir():
        pytest.skip(f"ENVLIGHT_DATA names no folder with {name}/")
    return folder
