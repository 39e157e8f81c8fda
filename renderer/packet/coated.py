"""A diffuse base under a rough dielectric coat: Lambert's surface below `ggx.py`'s lobe.

    evaluate = GGX(F₀ of the coat) + albedo/π · scale · (1 − F(nv)) (1 − F(nl))
    pdf      = share · GGX's + (1 − share) · Lambert's,  sample one of the two by the same share
    share    = F(nv) / (F(nv) + (1 − F(nv)) luminance(albedo)), away from 0 and 1

The coat lets light through twice; `scale` divides by the hemispherical mean of that (Kelemen and
Szirmay-Kalos, 2001), which keeps the whole reciprocal and, to 0.3 % even for a white base under a
thin smooth coat, below one. One lane at a time. The formulas hold for Lambert's surface and for
metals as well, with a coat that reflects nothing or a base that is black: rows DIMMED and GLOSSY
of a packet are 0 or 1.
"""

import numpy as np

from renderer.packet import ggx, lambert, material_table
from renderer.packet.layout import ONE, TINY, ZERO
from samplers.compiled import inner

_LEAST_SHARE = np.float32(material_table.LEAST_SHARE)


@inner
def coat_reflectance(dimmed, f0, cosine):
    """What the coat reflects of light at this cosine, 0 without a coat."""
    return dimmed * ggx.fresnel(f0, ggx.fifth_power(cosine))


@inner
def specular_share(coat, diffuse, specular):
    """Probability of sampling the specular lobe.

    coat : the coat's reflectance towards v; diffuse, specular : luminances without it
    """
    specular = specular + coat
    diffuse = diffuse * (ONE - coat)
    share = specular / max(specular + diffuse, TINY)
    share = min(max(share, _LEAST_SHARE), ONE - _LEAST_SHARE)
    share = ZERO if specular <= ZERO else share
    return ONE if diffuse <= ZERO else share


@inner
def evaluate(base, through, lobe, f0, power):
    """f_r in sr⁻¹ of one channel.

    base : f_r of the base towards v; through : 1 − F(nl)
    lobe : `ggx.evaluate`; power : `fifth_power` of v·h
    """
    return base * through + lobe * ggx.fresnel(f0, power)


@inner
def pdf(share, half_d, nl, nv, root_v):
    """Density in sr⁻¹ of samples of which `share` are of the lobe."""
    return lambert.pdf(ONE - share, nl) + ggx.pdf(share, half_d, nv, root_v)


@inner
def diffuse_share(row, nv):
    """The part of the diffuse colour that a surface reflects towards v, over all light.

    row : of the material table
    """
    kind = int(row[material_table.KIND])
    if kind == material_table.CONDUCTOR:
        return 0.0
    if kind == material_table.COATED:
        return 1.0 - coat_reflectance(1.0, row[material_table.COAT], nv)
    return 1.0
