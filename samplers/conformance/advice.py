"""Where to look when a sampler fails a check: one sentence each."""

ADVICE: dict[str, str] = {
    "lighting": "the return statement of _prepare; `samplers/lighting.py` tells what the four kinds"
    " of lighting hold, with shapes and units",
    "every-map-and-count": "what happens at a budget of 1, on a map of 2 × 1 texels, where most"
    " texels are black, and where fewer texels are lit than there are lights",
    "energy": "the sum of irradiance: radiance × the texel's solid angle"
    " (environment.row_solid_angle), summed in float64, each texel exactly once",
    "luminous-energy": "the sum of irradiance, as in 'energy', weighted by Rec. 709 luminance",
    "irradiance": "regions whose centroid lies outside them, as that of a ring or of two suns: cut"
    " such a region, or put its light on what shines in it",
    "determinism": "where random numbers come from: only the generator that _prepare is given; and"
    " sums over threads, whose order must be fixed",
    "scale-invariance": "thresholds with a unit: compare luminance with a mean or a quantile of the"
    " map, not with a number",
    "rotation": "what treats the seam (column 0) as a border; a method that is tied to the map's"
    " plane by design may fail: say so by --allow rotation",
    "single-texel": "the direction of a light: `samplers.sphere.pixel_direction` gives a texel's"
    " centre; row 0 is +Y, and azimuths wrap at the seam",
    "seam": "means of positions: average directions as vectors, not column numbers, which jump at"
    " the seam",
    "black": "divisions by the total flux: a black map has none; return DirectionalLights.none() or"
    " a uniform density",
    "pdf-integral": "the unit of the density: per steradian, so a texel's probability divided by"
    " its solid angle; and texels that no sample can reach",
    "pdf-of-samples": "`sample` and `pdf` side by side: both must look the density up at the same"
    " texel, also where a direction rounds across its edge",
    "surface-mean": "the weights of `sample_at`: 1 / (density · draws) over all techniques; and"
    " what was chosen among candidates has their mean weight, not its own. A density that is 0"
    " where there is light needs BRDF samples beside it: minimum_count = 2",
    "chi-square": "the inversion of the cumulative distribution: the order of rows and columns, and"
    " which texel a number on a boundary belongs to",
}
"""{check: where to look}"""
