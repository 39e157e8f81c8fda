"""What Wan, Wong and Leung 2005 print, in the paper and on its project page."""

import math

from experiments.run.experiment import Published

FIGURE9 = Published(
    "Fig. 9 of Wan 2005, as on its project page",
    {
        name: {"psnr": (value, math.nan)}
        for name, value in {
            "q2-tree": 33.9, "structured": 33.9, "fhis": 33.3, "lightgen": 31.9,
        }.items()
    },
)  # fmt: skip
"""PSNR in dB of one scene under one map by 300 lights, against 100,000 uniform ones."""
SECONDS_ALONE, SECONDS_COHERENT = 0.70, 0.41
"""Section 6: a frame of the sequence by itself, and from the frame before."""
