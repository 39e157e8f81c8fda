"""Materials as a table of numbers, which compiled kernels read: one row for each material."""

import math

import numpy as np
from numpy.typing import NDArray

from renderer.scene.materials import Coated, Conductor, Lambert, Material, Ward
from samplers.compiled import inner

LAMBERT, COATED, CONDUCTOR, WARD = range(4)
KIND, ALPHA_X, ALPHA_Y, COAT, DIFFUSE, SPECULAR, BASE_SCALE = 0, 1, 2, 3, 4, 7, 10
COLUMNS = 11
"""Kind, roughness along and across, the coat's reflectance at normal incidence, diffuse (3) and
specular (3) colour, and what the base under a coat is scaled by."""
INV_PI = 1.0 / math.pi
LEAST_ALPHA = 1e-4
LEAST_SHARE = 0.1
"""Of samples to either lobe of a surface that has two."""


def pack(materials: list[Material]) -> NDArray[np.float64]:
    """The materials as the table (m, 11) that the compiled functions read."""
    table = np.zeros((len(materials), COLUMNS))
    for row, material in zip(table, materials, strict=True):
        match material:
            case Lambert(albedo):
                row[KIND] = LAMBERT
                row[DIFFUSE : DIFFUSE + 3] = albedo
            case Coated(albedo, roughness, ior):
                row[KIND] = COATED
                row[ALPHA_X] = row[ALPHA_Y] = max(roughness, LEAST_ALPHA)
                row[COAT] = normal_reflectance(ior)
                row[DIFFUSE : DIFFUSE + 3] = albedo
                # The cosine-weighted mean of Schlick's term is F0 + (1 − F0)/21.
                row[BASE_SCALE] = 21.0 / (20.0 * (1.0 - row[COAT]))
            case Conductor(reflectance, roughness):
                row[KIND] = CONDUCTOR
                row[ALPHA_X] = row[ALPHA_Y] = max(roughness, LEAST_ALPHA)
                row[SPECULAR : SPECULAR + 3] = reflectance
            case Ward(diffuse, specular, roughness_x, roughness_y):
                row[KIND] = WARD
                row[ALPHA_X] = max(roughness_x, LEAST_ALPHA)
                row[ALPHA_Y] = max(roughness_y, LEAST_ALPHA)
                row[DIFFUSE : DIFFUSE + 3] = diffuse
                row[SPECULAR : SPECULAR + 3] = specular
    return table


def normal_reflectance(ior: float) -> float:
    """Fresnel reflectance of a dielectric at normal incidence."""
    return ((ior - 1.0) / (ior + 1.0)) ** 2


@inner
def luminance(row, first):
    """Luminance of the colour that begins in column `first`."""
    return 0.2126 * row[first] + 0.7152 * row[first + 1] + 0.0722 * row[first + 2]
