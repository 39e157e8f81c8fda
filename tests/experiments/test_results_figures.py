"""Figures on the page of results, computed from the published rows by pandas alone.

Nothing of the code that makes the page is used, so that a fault of it shows as a difference.
"""

import re
from pathlib import Path

import pandas as pd
import pytest

RESULTS = Path(__file__).parents[2] / "results"
PAGE = (RESULTS / "README.md").read_text(encoding="utf-8")
PAPERS = [
    "ours",
    "ours-no-upsampling",
    "mis",
    "fhis",
    "median-cut",
    "tmms",
    "variance-minimization",
]
CASE = ["scene", "environment"]


def read(folder: str, wanted: str = "index == index", file: str = "measurements.csv.gz"):
    return pd.read_csv(RESULTS / folder / file, low_memory=False).query(wanted)


def means(rows: pd.DataFrame, value: str, by: str = "sampler", cases: tuple[str, ...] = ()):
    """Cases × samplers, or by sampler alone: the mean over seeds of each case, then over cases."""
    per_case = rows.groupby([*dict.fromkeys([*CASE, *cases]), by])[value].mean()
    return (
        per_case.groupby([*cases, by]).mean().unstack(by) if cases else per_case.groupby(by).mean()
    )


def resolved(rows: pd.DataFrame, metric: str) -> pd.DataFrame:
    """Maps × samplers; nothing is below 3 times the noise of the references."""
    floor = means(rows, f"{metric}_floor", cases=("environment",)).max(axis=1)
    return means(rows, metric, cases=("environment",)).clip(lower=3.0 * floor, axis="index")


def table_1():
    rows = read("table1-as-published", "budget == 'rays=median-cut:8'")
    for error in (means(rows, "rmse"), means(rows, "flip")):
        yield f"{error['ours'] / error['median-cut']:.2f} ["


def table_2():
    error = means(read("table2"), "rmse")
    for without in ("masking=False, kmeans=False", "kmeans=False", "masking=False"):
        yield f"{error[f'ours[{without}]'] / error['ours']:.2f} ("


def equal_time():
    found = [resolved(read("equal-time"), metric) for metric in ("flip", "rmse")]
    first = [int((one["ours"] <= one.min(axis=1)).sum()) for one in found]
    yield f"in {sum(first)} of 12"
    yield from (f"Ours (Wu 2025) on {count}" for count in first)


def ranks():
    for metric in ("flip", "rmse"):
        places = resolved(read("ranking"), metric)[PAPERS].rank(axis=1, method="min")
        yield f"{places['ours'].mean():.2f} ("


def false_edges():
    rows = read("illumination-cut", file="false_edges.csv")
    error = rows.groupby(["budget", "sampler"])["false_edges"].mean().unstack()
    original = "[variance_weight=1.0, extent_weight=0.0, energy_weight=0.0]"
    names = ["ours", "ours-no-upsampling"]
    ratio = error[[f"{name}{original}" for name in names]].to_numpy() / error[names].to_numpy()
    yield f"in {(ratio > 1.0).sum()} of {ratio.size} comparisons"
    yield f"{ratio.min():.2f} to {ratio.max():.2f} times"


def glossy():
    error = means(read("glossy", file="glossy.csv"), "flip_glossy", cases=(*CASE, "budget"))
    for name in ("mis", "median-cut", "tmms"):
        yield f"on {(error['ours'] < error[name]).sum()} of {len(error)} cases"


def reuse():
    rows = read("reuse", "budget == 'time=restir:1'")
    found = (means(rows, metric, cases=tuple(CASE)) for metric in ("rmse", "flip"))
    rmse, flip = (one["ours"] < one["restir"] for one in found)
    yield f"RMSE on {rmse.sum()} and FLIP on {flip.sum()} of {len(flip)}"


def kd_tree_speed():
    rows = read("kd-tree-throughput")
    case = ["environment", "width", "threads"]
    seconds = rows.assign(each=rows["seconds"] / rows["samples"]).pivot_table(
        "each", case, "method"
    )
    ratio = seconds["binary search"] / seconds["kd-tree"]
    yield f"{ratio.min():.1f}× to {ratio.max():.1f}×"


def area_lights():
    lights = read("area-lights", "table == 'lights'")
    yield f"{(lights['lights'] > 0).sum()} of {len(lights)} maps"
    yield f"{1e3 * lights['seconds'].min():.0f} to {1e3 * lights['seconds'].max():.0f} ms"


def soft_shadows():
    error = means(read("area-lights", "table == 'images'"), "flip", "method")
    yield from (f" {one:.3f}" for one in error)


def fixed_patterns():
    psnr = means(read("static-sampling"), "psnr")
    yield from (f"{psnr[name]:.1f} (" for name in ("q2-tree", "structured", "fhis", "lightgen"))


def fire():
    rows = read("dynamic-sequence").set_index("method")
    total = rows[["temporal_noise", "true_change"]].pow(2).groupby(level=0).sum().pow(0.5)
    ratio = total["temporal_noise"] / total["true_change"]
    yield from (f" {ratio[name]:.2f}" for name in ("q2-tree", "structured", "fhis"))


@pytest.mark.parametrize(
    ("line", "figures"),
    [
        ("Wu 2025, Table 1", table_1), ("Wu 2025, Table 2", table_2), ("Wu 2025, Fig. 8", ranks),
        ("Wu 2025, Fig. 1, 9 and 10", equal_time), ("Wu 2025, Fig. 6", false_edges),
        ("Wu 2025, Fig. 11", glossy), ("Wu 2025, Fig. 13", reuse),
        ("Ergun 2012, Fig. 3 and 4", kd_tree_speed), ("Arbree 2005, Table 1", area_lights),
        ("Arbree 2005, Fig. 3", soft_shadows), ("Wan 2005, Fig. 9", fixed_patterns),
        ("Wan 2005, Fig. 10", fire),
    ],
)  # fmt: skip
def test_the_line_of_a_figure_has_what_the_rows_give(line, figures):
    (told,) = re.findall(rf"^- {re.escape(line)}: .*$", PAGE, re.MULTILINE)
    for figure in figures():
        assert figure in told, figure
