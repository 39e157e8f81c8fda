"""Which sampler may fail which conformance check, and why. Data, so that it can be reported."""

TIED_TO_THE_SEAM = (
    "regions are rectangles of the map's plane, whose left and right borders are the seam"
)
DRAWN_FROM_THE_SEAM = (
    "starts are drawn by inverting a distribution whose columns begin at the seam, so that the "
    "same random numbers choose other texels of a turned map"
)

OTHER_CELLS = "its table has cells of its own, which reach beyond a texel of the map"
FIXED_SQUARE = "its square is fixed to the frame, and cuts a turned map into other cells"

EXCEPTIONS: dict[str, dict[str, str]] = {
    "uniform": {"rotation": "its cells are fixed to the frame, whatever the map shows"},
    "median-cut": {"rotation": TIED_TO_THE_SEAM},
    "variance-minimization": {"rotation": TIED_TO_THE_SEAM},
    "fhis": {"rotation": "the tiling is fixed to the map's plane"},
    "q2-tree": {
        "rotation": "its quads are fixed to the frame: only quarter turns map them to themselves"
    },
    "kd-tree": {
        "rotation": "blocks of equal energy get unequal shares of its law, in the order in which "
        "they were cut, and larger maps are cut into blocks that begin at the seam"
    },
    "filtered-importance-sampling": {
        "surface-mean": "a round blur of the map stands for the part of the lobe around a sample"
    },
    "ours": {"rotation": DRAWN_FROM_THE_SEAM},
    "ours-no-upsampling": {"rotation": DRAWN_FROM_THE_SEAM},
    "pbrt-v4": {"rotation": FIXED_SQUARE, "single-texel": OTHER_CELLS},
    "falcor": {"rotation": FIXED_SQUARE, "single-texel": OTHER_CELLS},
    "mitsuba-3": {
        "single-texel": "its density is bilinear, so a lit texel's reaches to the next ones, and "
        "nothing is drawn for light in a pole's row alone"
    },
    "kollig-keller": {"rotation": DRAWN_FROM_THE_SEAM},
    "lightgen": {"rotation": DRAWN_FROM_THE_SEAM},
    "tmms": {
        "rotation": "near the poles it segments groups of cells, and the groups begin at the seam"
    },
}
"""{sampler: {check: reason}}"""
