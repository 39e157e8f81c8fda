"""The fixed order of a grid's rows, whichever was measured first."""

import pandas as pd

ORDER = ["scale", "scene", "environment", "budget", "sampler", "seed", "key"]


def in_fixed_order(rows: pd.DataFrame) -> pd.DataFrame:
    """The same rows in the order of what they measure."""
    return rows.sort_values(ORDER, kind="stable").reset_index(drop=True)
