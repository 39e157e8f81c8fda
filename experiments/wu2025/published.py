"""What Wu 2025 prints: "Efficient environment map rendering based on decomposition", CGF 44(1).

Its times to generate lights stand beside those that the other three papers print.
"""

import math

from experiments.run.budget import Budget
from experiments.run.experiment import Published
from experiments.run.scale import Scale

PAPER_SECONDS, PAPER_PIXELS = 4.0, 1600 * 1200
"""What every method had for an image, and how large that was."""


def seconds_budget(scale: Scale) -> tuple[Budget, ...]:
    """The paper's four seconds for as many pixels as the scale has."""
    seconds = PAPER_SECONDS * scale.width * scale.height / PAPER_PIXELS
    return (Budget(float(f"{seconds:.4g}"), "seconds"),)


def _table(rows: dict[str, tuple[float, float, float, float]]) -> dict:
    return {name: {"rmse": row[:2], "flip": row[2:]} for name, row in rows.items()}


TABLE1 = Published(
    "Table 1 of Wu 2025 (ranks in brackets)",
    _table(
        {
            "mis": (0.1579, 6.00, 0.1212, 2.81),
            "fhis": (0.1572, 5.63, 0.2217, 6.19),
            "median-cut": (0.0881, 4.16, 0.1819, 5.16),
            "variance-minimization": (0.1035, 4.88, 0.1546, 4.22),
            "tmms": (0.0886, 4.00, 0.1895, 5.72),
            "ours-no-upsampling": (0.0579, 2.16, 0.1191, 2.81),
            "ours": (0.0438, 1.16, 0.0865, 1.06),
        }
    ),
)
"""RMSE and FLIP, each with its mean rank over 32 maps, of 4 s at 1600×1200 with 4 sub-pixels."""
TABLE2 = Published(
    "Table 2 of Wu 2025",
    _table(
        {
            "ours[masking=False, kmeans=False]": (0.0599, math.nan, 0.0988, math.nan),
            "ours[kmeans=False]": (0.0560, math.nan, 0.0958, math.nan),
            "ours[masking=False]": (0.0466, math.nan, 0.0877, math.nan),
            "ours": (0.0438, math.nan, 0.0865, math.nan),
        }
    ),
)
"""RMSE and FLIP of the ablation of EnvDirects; no ranks."""
LIGHT_GENERATION_MS = {"ours": 185.7, "median-cut": 10.0, "variance-minimization": 10.0}
"""Section 4.5: the mean over 32 maps, and "about ten milliseconds"; TMMS "might take seconds"."""
LIGHT_GENERATION = {
    "ours": "185.7 ms (Wu 2025)",
    "ours-no-upsampling": "185.7 ms (Wu 2025)",
    "median-cut": "about 10 ms (Wu 2025)",
    "variance-minimization": "about 10 ms (Wu 2025)",
    "tmms": "seconds (Wu 2025)",
    "fhis": "70 ms at 300, its tables made before (Wan 2005)",
    "q2-tree": "700 ms a map at 300 (Wan 2005)",
    "q2-tree update, 1 % changed": "410 ms a coherent frame at 300 (Wan 2005)",
    "center-surround": "0.5-1.5 h (Arbree 2005)",
}
"""As printed, on machines of 2003 to 2025 and maps of their own."""
