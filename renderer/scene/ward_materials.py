"""Ward materials that stand for three measured ones.

"pink-fabric", "blue-metallic-paint" and "chrome-steel" are materials of the MERL database
(Matusik, Pfister, Brand and McMillan, "A data-driven reflectance model", SIGGRAPH 2003), to which
Ngan, Durand and Matusik ("Experimental analysis of BRDF models", EGSR 2005) fitted Ward's model.
Their parameters are published only as pictures of lobes, so the values here are surrogates:
isotropic Ward models fitted by least squares of f·cos θ to published compact fits of the same
measurements, the SGD model (Bagher, Soler and Holzschuch, "Accurate fitting of measured
reflectances using a shifted gamma micro-facet distribution", EGSR 2012) and the ABC model (Löw,
Kronander, Ynnerman and Unger, "BRDF models for accurate and efficient rendering of glossy
surfaces", TOG 2012), at angles below 80°. Blue metallic paint is the fit to SGD. Pink fabric and
chrome steel are rounded between the two, the fabric with a lobe held at α = 0.6, because an
unbounded fit makes it a second diffuse term. Images compare with others made from these values,
not in absolute numbers with images of the originals.
"""

from renderer.scene.materials import Ward

PINK_FABRIC = Ward((0.24, 0.18, 0.19), (0.10, 0.10, 0.10), 0.6, 0.6)
BLUE_METALLIC_PAINT = Ward((0.0105, 0.0066, 0.0188), (0.066, 0.057, 0.140), 0.188, 0.188)
CHROME_STEEL = Ward((0.03, 0.025, 0.027), (0.10, 0.08, 0.10), 0.005, 0.005)
MILD_CHROME_STEEL = Ward((0.03, 0.025, 0.027), (0.10, 0.08, 0.10), 0.05, 0.05)
"""Chrome steel with a highlight that a finite set of lights can still meet."""
BRUSHED_METAL = Ward((0.03, 0.025, 0.027), (0.30, 0.28, 0.26), 0.5, 0.001)
"""The extreme anisotropy (0.5, 0.001) at which filtered importance sampling is biased."""

MATERIALS: dict[str, Ward] = {
    "pink-fabric": PINK_FABRIC,
    "blue-metallic-paint": BLUE_METALLIC_PAINT,
    "chrome-steel": CHROME_STEEL,
    "mild-chrome-steel": MILD_CHROME_STEEL,
    "brushed-metal": BRUSHED_METAL,
}
