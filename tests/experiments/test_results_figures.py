"""Figures on the page of results, computed from the published rows by pandas alone."""

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


def light_times():
    rows = read("light-generation-time")
    seconds = rows.pivot_table("seconds", ["environment", "width"], "method")
    yield f"{1e3 * seconds['ours'].min():.1f} to {1e3 * seconds['ours'].max():.1f} ms"
    for name in ("median-cut", "variance-minimization", "tmms"):
        ratio = seconds[name] / seconds["ours"]
        yield f"{ratio.min():.2f} to {ratio.max():.2f} times"


def anisotropic():
    rows = read("kd-tree-quality", "scene == 'brushed-metal'")
    psnr = means(rows, "psnr", cases=("budget",))
    names = ["kd-tree[numbers=independent]", "filtered-importance-sampling"]
    for budget, tree, rival in psnr[names].itertuples():
        yield f"{budget} {tree:.2f} against {rival:.2f} dB"


def area_lights():
    lights = read("area-lights", "table == 'lights'")
    yield f"{(lights['lights'] > 0).sum()} of {len(lights)} maps"
    yield f"{1e3 * lights['seconds'].min():.0f} to {1e3 * lights['seconds'].max():.0f} ms"


@pytest.mark.parametrize(
    ("line", "figures"),
    [
        ("Wu 2025, Table 1", table_1), ("Wu 2025, Table 2", table_2), ("Wu 2025, Fig. 8", ranks),
        ("Wu 2025, Fig. 1, 9 and 10", equal_time), ("Wu 2025, Fig. 6", false_edges),
        ("Wu 2025, Fig. 11", glossy), ("Wu 2025, Fig. 13", reuse),
        ("Wu 2025, §4.5", light_times), ("Ergun 2012, Fig. 7", anisotropic),
        ("Arbree 2005, Table 1", area_lights),
    ],
)  # fmt: skip
def test_the_line_of_a_figure_has_what_the_rows_give(line, figures):
    (told,) = re.findall(rf"^- {re.escape(line)}: .*$", PAGE, re.MULTILINE)
    for figure in figures():
        assert figure in told, figure
