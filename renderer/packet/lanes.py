"""Shading points into a packet's lanes, and the directions of its rays."""

import numpy as np

from renderer.packet import coated, ggx, lambert, material_table
from renderer.packet.embree import DIR_X, DIR_Y, DIR_Z, LANES, ORG_X, ORG_Y, ORG_Z
from renderer.packet.layout import (
    ALPHA_2,
    COSINE,
    DIFFUSE_B,
    DIFFUSE_G,
    DIFFUSE_R,
    DIMMED,
    F0_R,
    FACING,
    GLOSSY,
    GREEN,
    GX,
    GY,
    GZ,
    NV,
    NX,
    NY,
    NZ,
    ONE,
    RED,
    ROOT_V,
    SHARE,
    VX,
    VY,
    VZ,
    ZERO,
    new_packets,
)
from samplers.compiled import inner, kernel, prefetch


@kernel
def lane_materials(materials):
    """What packets need of `material_table.pack`'s table, (m, 12) float32.

    α², diffuse f_r (3), 1 for a coat, reflectance (3), 1 for a specular lobe, 1 for Ward's model,
    and what the choice between the lobes weighs: luminance of the diffuse colour, and of the
    specular one where it does not depend on the eye
    """
    table = np.zeros((len(materials), 12), np.float32)
    for m in range(len(materials)):
        row = materials[m]
        kind = int(row[material_table.KIND])
        scale = row[material_table.BASE_SCALE] if kind == material_table.COATED else 1.0
        glossy = kind == material_table.COATED or kind == material_table.CONDUCTOR
        table[m, 0] = row[material_table.ALPHA_X] ** 2 if glossy else 1.0
        f0 = material_table.COAT
        for c in range(3):
            table[m, 1 + c] = lambert.evaluate(row[material_table.DIFFUSE + c]) * scale
            specular = row[material_table.SPECULAR + c]
            table[m, 5 + c] = row[f0] if kind == material_table.COATED else specular
        table[m, 4] = 1.0 if kind == material_table.COATED else 0.0
        table[m, 8] = 1.0 if glossy else 0.0
        table[m, 9] = 1.0 if kind == material_table.WARD else 0.0
        # So that the share of specular samples is 0 for Lambert's surfaces and 1 for metals.
        if kind == material_table.LAMBERT:
            table[m, 10] = 1.0
        elif kind == material_table.CONDUCTOR:
            table[m, 11] = 1.0
        else:
            table[m, 10] = material_table.luminance(row, material_table.DIFFUSE)
    return table


@inner
def _fill_materials(packet, start, stop, material, table):
    """Rows ALPHA_2 … GLOSSY, RED and GREEN; the first nine of the table lie in the same order."""
    first, alike, ward = material[start], True, False
    for k in range(LANES):
        alike &= material[min(start + k, stop - 1)] == first
    if alike:  # as most are: rows of one number each
        for row in range(GLOSSY - ALPHA_2 + 1):
            for k in range(LANES):
                packet[(ALPHA_2 + row) * LANES + k] = table[first, row]
        for k in range(LANES):
            packet[RED * LANES + k], packet[GREEN * LANES + k] = table[first, 10], table[first, 11]
        return table[first, 9] > ZERO
    for k in range(LANES):
        m = material[min(start + k, stop - 1)]
        for row in range(GLOSSY - ALPHA_2 + 1):
            packet[(ALPHA_2 + row) * LANES + k] = table[m, row]
        packet[RED * LANES + k], packet[GREEN * LANES + k] = table[m, 10], table[m, 11]
        ward |= table[m, 9] > ZERO
    return ward


@inner
def fill_packet(packet, start, stop, position, normal, geometric, toward_eye, material, table):
    """Put the points start … stop, at most sixteen, into a packet; the last one into spare lanes.

    Returns whether a surface follows Ward's model.
    """
    for k in range(LANES):
        i = min(start + k, stop - 1)
        packet[ORG_X * LANES + k] = position[i, 0]
        packet[ORG_Y * LANES + k] = position[i, 1]
        packet[ORG_Z * LANES + k] = position[i, 2]
        packet[NX * LANES + k] = normal[i, 0]
        packet[NY * LANES + k] = normal[i, 1]
        packet[NZ * LANES + k] = normal[i, 2]
        packet[GX * LANES + k] = geometric[i, 0]
        packet[GY * LANES + k] = geometric[i, 1]
        packet[GZ * LANES + k] = geometric[i, 2]
        packet[VX * LANES + k] = toward_eye[i, 0]
        packet[VY * LANES + k] = toward_eye[i, 1]
        packet[VZ * LANES + k] = toward_eye[i, 2]
    for array in (position, normal, geometric, toward_eye):
        _ask_for_points(array, start + LANES)
    ward = _fill_materials(packet, start, stop, material, table)
    _view_terms(packet)
    return ward


@inner
def _ask_for_points(array, start):
    """Ask for three numbers of each of sixteen points: the next packet's, while this one is lit."""
    flat = array.reshape(-1)
    for line in range(3):
        prefetch(flat, 3 * start + line * LANES)


@inner
def _view_terms(packet):
    """What depends on the eye: n·v, Smith's root, the coat's dimming, the lobes' shares.

    RED and GREEN hold the luminances of the diffuse and the specular colour.
    """
    for k in range(LANES):
        nv = (
            packet[NX * LANES + k] * packet[VX * LANES + k]
            + packet[NY * LANES + k] * packet[VY * LANES + k]
            + packet[NZ * LANES + k] * packet[VZ * LANES + k]
        )
        coat = coated.coat_reflectance(packet[DIMMED * LANES + k], packet[F0_R * LANES + k], nv)
        packet[NV * LANES + k] = nv
        packet[ROOT_V * LANES + k] = ggx.smith_root(packet[ALPHA_2 * LANES + k], nv)
        packet[DIFFUSE_R * LANES + k] *= ONE - coat
        packet[DIFFUSE_G * LANES + k] *= ONE - coat
        packet[DIFFUSE_B * LANES + k] *= ONE - coat
        packet[SHARE * LANES + k] = coated.specular_share(
            coat, packet[RED * LANES + k], packet[GREEN * LANES + k]
        )


@kernel
def packets_of(points, position, normal, geometric, toward_eye, material, materials):
    """The points points[0] … points[1] as packets, and whether any surface follows Ward's model."""
    start, stop = points
    table = lane_materials(materials)
    packets = new_packets((stop - start + LANES - 1) // LANES)
    ward = False
    for b in range(len(packets)):
        ward |= fill_packet(
            packets[b], start + b * LANES, stop, position, normal, geometric, toward_eye, material,
            table,
        )  # fmt: skip
    return packets, ward


@inner
def aim(packet, x, y, z):
    """Put one direction into all lanes of the packet's rays."""
    for k in range(LANES):
        packet[DIR_X * LANES + k], packet[DIR_Y * LANES + k], packet[DIR_Z * LANES + k] = x, y, z


@inner
def aim_each(packet, direction, first):
    """Put the sixteen directions (rows, 3) from row `first` on into the packet's rays."""
    for k in range(LANES):
        packet[DIR_X * LANES + k] = direction[first + k, 0]
        packet[DIR_Y * LANES + k] = direction[first + k, 1]
        packet[DIR_Z * LANES + k] = direction[first + k, 2]


@inner
def face_lights(packet):
    """COSINE and FACING of the directions in the packet's rays; returns how many lanes face.

    COSINE = n·l;  FACING = 1 where n·l > 0 and g·l > 0 (g: the geometric normal)
    """
    count = 0
    for k in range(LANES):
        lx, ly, lz = (
            packet[DIR_X * LANES + k], packet[DIR_Y * LANES + k], packet[DIR_Z * LANES + k],
        )  # fmt: skip
        cosine = (
            packet[NX * LANES + k] * lx + packet[NY * LANES + k] * ly + packet[NZ * LANES + k] * lz
        )
        above = (
            packet[GX * LANES + k] * lx + packet[GY * LANES + k] * ly + packet[GZ * LANES + k] * lz
        )
        facing = (cosine > ZERO) & (above > ZERO)
        packet[COSINE * LANES + k] = cosine
        packet[FACING * LANES + k] = ONE if facing else ZERO
        count += 1 if facing else 0
    return count


@inner
def face_above(packet):
    """COSINE and FACING by the shading normal alone, as where nothing shadows the light."""
    for k in range(LANES):
        cosine = (
            packet[NX * LANES + k] * packet[DIR_X * LANES + k]
            + packet[NY * LANES + k] * packet[DIR_Y * LANES + k]
            + packet[NZ * LANES + k] * packet[DIR_Z * LANES + k]
        )
        packet[COSINE * LANES + k] = cosine
        packet[FACING * LANES + k] = ONE if cosine > ZERO else ZERO


@inner
def store_lanes(total, start, stop, out):
    """Put a packet's sums (48,) into the rows start … stop, at most sixteen, of out (n, 3)."""
    for i in range(start, stop):
        for channel in range(3):
            out[i, channel] = total[channel * LANES + i - start]
