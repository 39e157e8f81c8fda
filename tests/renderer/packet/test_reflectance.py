"""Points side by side are shaded as the plain formulas shade them one by one, in float32."""

import numpy as np
import pytest

from renderer.packet.embree import DIR_X, LANES
from renderer.packet.lanes import face_lights, fill_packet, lane_materials
from renderer.packet.layout import FACING, PDF, RED, new_packets
from renderer.packet.material_table import pack
from renderer.packet.reflectance import reflect, reflect_ward
from renderer.scene.materials import Coated
from samplers.compiled import kernel
from tests.renderer import lab
from tests.renderer.packet import plain_brdf

SURFACES = {name: [material] for name, material in lab.SURFACES.items()}
SURFACES["black coat"] = [Coated((0.0, 0.0, 0.0), 0.4)]
SURFACES["all"] = [material for row in list(SURFACES.values()) for material in row]


@kernel
def side_by_side(position, normal, geometric, toward_eye, material, materials, direction, out):
    """f_r · cosine, density and facing (n, 5) of point i towards direction i."""
    packet, table = new_packets(1)[0], lane_materials(materials)
    for start in range(0, len(normal), LANES):
        stop = min(start + LANES, len(normal))
        ward = fill_packet(
            packet, start, stop, position, normal, geometric, toward_eye, material, table
        )
        for k in range(LANES):
            for axis in range(3):
                packet[(DIR_X + axis) * LANES + k] = direction[min(start + k, stop - 1), axis]
        face_lights(packet)
        reflect(packet)
        if ward:
            reflect_ward(packet, start, stop, material, materials)
        for i in range(start, stop):
            for column in range(3):
                out[i, column] = packet[(RED + column) * LANES + i - start]
            out[i, 3] = packet[PDF * LANES + i - start]
            out[i, 4] = packet[FACING * LANES + i - start]


def unit(rng: np.random.Generator, count: int) -> np.ndarray:
    vector = rng.normal(size=(count, 3))
    return (vector / np.linalg.norm(vector, axis=1, keepdims=True)).astype(np.float32)


@pytest.mark.parametrize("name", SURFACES)
def test_lanes_agree_with_the_scalar_model(name: str) -> None:
    rng, count = np.random.default_rng(3), 1003
    normal, toward_eye, direction = unit(rng, count), unit(rng, count), unit(rng, count)
    toward_eye *= np.sign((normal * toward_eye).sum(axis=1, keepdims=True))
    # Half of the directions near the mirror's, where lobes are steep.
    mirror = 2.0 * (normal * toward_eye).sum(axis=1, keepdims=True) * normal - toward_eye
    near = mirror + 0.1 * rng.normal(size=mirror.shape)
    near /= np.linalg.norm(near, axis=1, keepdims=True)
    direction[::2] = near[::2]
    materials = pack(SURFACES[name])
    material = rng.integers(0, len(materials), count).astype(np.int32)
    out = np.empty((count, 5))
    side_by_side(
        np.zeros_like(normal), normal, normal, toward_eye, material, materials, direction, out
    )
    inputs = [array.astype(np.float64) for array in (normal, toward_eye, direction)]
    cosine = (inputs[0] * inputs[2]).sum(axis=1)
    expected = np.array(
        [plain_brdf.evaluate_with_pdf(materials[m], *ways)
         for m, *ways in zip(material, *inputs, strict=True)]
    )  # fmt: skip
    expected[:, :3] *= cosine[:, None]
    clear = np.abs(cosine) > 1e-6
    np.testing.assert_array_equal(out[clear, 4] > 0.0, cosine[clear] > 0.0)
    facing = clear & (cosine > 0.0)
    # A half vector is off by some 2⁻²⁴, a lobe of width α by 4/α of that, and as much again for
    # each of the few roundings on the way; near the horizon the cosine itself is off by 2⁻²³.
    tolerance = 2.0**-24 * (16.0 / 0.1 + 8.0 / cosine[facing, None])
    error = np.abs(out[facing, :4] - expected[facing])
    assert (error <= tolerance * expected[facing] + 1e-12).all()
    assert not out[~facing & clear, :4].any()
