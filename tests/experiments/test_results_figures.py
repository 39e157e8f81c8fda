"""Figures on the page of results and in README, from the published rows by pandas alone."""

import re
from functools import cache
from itertools import combinations, product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import gmean, wilcoxon

RESULTS = Path(__file__).parents[2] / "results"
PAGE = (RESULTS / "README.md").read_text(encoding="utf-8")
README = (RESULTS.parent / "README.md").read_text(encoding="utf-8")
PAPERS = [
    "ours",
    "ours-no-upsampling",
    "mis",
    "fhis",
    "median-cut",
    "tmms",
    "variance-minimization",
]
FIXED = ["median-cut", "variance-minimization", "tmms"]
LABELS = ["Median cut (Debevec 2005)", "Variance min. (Viriyothai 2009)", "TMMS (Feng 2016)"]
CASE = ["scene", "environment"]


@cache
def read(folder: str, wanted: str = "index == index", file: str = "measurements.csv.gz"):
    (record,) = RESULTS.rglob(f"{folder}/run.json")
    return pd.read_csv(record.parent / file, low_memory=False).query(wanted)


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
        places = resolved(read("ranking"), metric)[PAPERS].rank(axis=1, method="min").mean()
        yield f"{places['ours']:.2f} ("
        yield f"{['1st', '2nd', '3rd'][(places < places['ours']).sum()]} by {metric.upper()}"


def false_edges():
    rows = read("illumination-cut", file="false_edges.csv")
    error = rows.groupby(["budget", "sampler"])["false_edges"].mean().unstack()
    original = "[variance_weight=1.0, extent_weight=0.0, energy_weight=0.0]"
    names = ["ours", "ours-no-upsampling"]
    ratio = error[[f"{name}{original}" for name in names]].to_numpy() / error[names].to_numpy()
    yield f"fewer edges in {(ratio > 1.0).sum()} of {ratio.size}**"
    yield f"in {(ratio > 1.0).sum()} of {ratio.size} comparisons"
    yield f"{ratio.min():.2f} to {ratio.max():.2f} times"


def glossy():
    error = means(read("glossy", file="glossy.csv"), "flip_glossy", cases=(*CASE, "budget"))
    for name, label in zip(
        ("mis", "median-cut", "tmms"), ("MIS (Veach 1995)", *LABELS[::2]), strict=True
    ):
        yield f"{label} on {(error['ours'] < error[name]).sum()} of {len(error)} cases"


def reuse():
    rows = read("reuse", "budget == 'time=restir:1'")
    found = (means(rows, metric, cases=tuple(CASE)) for metric in ("rmse", "flip"))
    rmse, flip = (one["ours"] < one["restir"] for one in found)
    yield f"in {rmse.sum() + flip.sum()} of {2 * len(flip)}"
    yield f"RMSE on {rmse.sum()} and FLIP on {flip.sum()} of {len(flip)}"


def light_times():
    rows = read("light-generation-time")
    seconds = rows.pivot_table("seconds", ["environment", "width"], "method")
    yield f"{1e3 * seconds['ours'].min():.1f} to {1e3 * seconds['ours'].max():.1f} ms"
    for name in ("median-cut", "variance-minimization", "tmms"):
        ratio = seconds[name] / seconds["ours"]
        yield f"{ratio.min():.2f} to {ratio.max():.2f} times as long, less on {(ratio < 1).sum()}"


def anisotropic():
    rows = read("kd-tree-quality", "scene == 'brushed-metal'")
    psnr = means(rows, "psnr", cases=("budget",))
    names = ["kd-tree[numbers=independent]", "filtered-importance-sampling"]
    for budget, tree, rival in psnr[names].itertuples():
        yield f"{budget} {tree:.2f} against {rival:.2f} dB"
    yield f"better at {(psnr[names[0]] > psnr[names[1]]).sum()} of {len(psnr)}"


def area_lights():
    lights = read("area-lights", "table == 'lights'")
    found = lights.loc[lights["lights"] > 0, "lights"]
    yield f"{len(found)} of {len(lights)} maps**. {found.min():.0f} to {found.max():.0f} of them"
    yield f"{1e3 * lights['seconds'].min():.0f} to {1e3 * lights['seconds'].max():.0f} ms"


def emissive():
    share = read("light-distribution").groupby("environment")["emissive_energy"].first()
    share = share[share > 0.0]
    yield f"on {len(share)} of 16 maps"
    yield f"{100 * share.min():.0f} % to {100 * share.max():.0f} %"


def on_emissive():
    rows = read("light-distribution", "emissive_energy > 0")
    lights = rows.pivot_table("energy_on_emissive", "environment", "sampler")
    more = [int((lights["ours"] > lights[name]).sum()) for name in FIXED]
    yield f"more in {sum(more)} of {3 * len(lights)}"
    yield from (f"{label} on {count}" for label, count in zip(LABELS, more, strict=True))
    direct = read("light-distribution", "sampler == 'ours'")["direct_on_emissive"]
    yield f"{100 * direct.mean():.0f} % of the EnvDirects'"


def hardest():
    rows = read("equal-time")
    best = means(rows, "flip", cases=("environment",)).min(axis=1)
    count = 0
    for metric in ("flip", "rmse"):
        errors = resolved(rows, metric).loc[best.nlargest(2).index]
        first = int((errors["ours"] <= errors.min(axis=1)).sum())
        yield f"Ours (Wu 2025) on {first}"
        count += first
    yield f"in {count} of 4"


def criteria():
    rows = read("kd-tree-fits", "blocks == 6144 and environment != 'constant'")
    left = rows.pivot_table("unexplained", "environment", "criterion")
    left = left[["sse", "variance", "range"]]
    yield f"best on {(left.idxmin(axis=1) == 'sse').sum()} of {len(left)}"
    yield f"{100 * left['sse'].max():.1f} % of"
    yield f"{rows['compression'].min():.0f} : 1;"


def law():
    rows = read("kd-tree-fits", "blocks == 6144 and criterion == 'sse' and variance_blocks > 0")
    times, off = rows["variance_law"] / rows["variance_blocks"], 100 * rows["distance_law"]
    yield f"{times.min():.1f}× to {times.max():.1f}×"
    yield f"on {len(rows)} maps; the law misplaces {off.min():.0f} to {off.max():.0f} %"


def throughput():
    rows = read("kd-tree-throughput")
    seconds = rows.pivot_table("seconds", ["environment", "width", "threads"], "method")
    times = seconds["binary search"] / seconds["kd-tree"]
    yield f"{times.min():.1f}× to {times.max():.1f}×"
    one = seconds.query("width == 512 and threads == 1")
    yield from (f" {low:.2f}" for low in one.min() / one.max())


def spheres():
    names = ["chrome-steel", "blue-metallic-paint", "pink-fabric"]
    psnr = means(read("kd-tree-quality"), "psnr", cases=("scene", "budget")).unstack("budget")
    time, samples = [], []
    for numbers in ("low-discrepancy", "independent"):
        tree = psnr.loc[names, f"kd-tree[numbers={numbers}]"]
        base = psnr.loc[names, f"mis[guided=False, numbers={numbers}]"]
        time += list(tree["seconds=0.015"] - base["seconds=0.015"])
        samples += list(tree["lights=32"] - base["lights=8"])
    yield f"{min(time):+.1f} to {max(time):+.1f} dB in equal time"
    yield f"{min(samples):+.1f} to {max(samples):+.1f} dB, the paper"


def disc_energy():
    share = 100 * read("area-lights", "table == 'lights' and lights > 0")["energy_lights"]
    yield f"{len(share)} maps with lights"
    yield f"{share.min():.0f} to {share.max():.0f} %"
    yield f"{share.median():.0f} % in the median"


def disc_images():
    error = read("area-lights", "table == 'images'").groupby("method")["flip"].mean()
    assert error.idxmin() == "ours"
    yield from (f" {error[name]:.3f}" for name in ("area", "centre", "median-cut", "ours"))


def patterns():
    rows = read("discrepancy")
    count = 0
    for _, _, points, own, *_ in rows[rows["pattern"] == "HEALPix"].itertuples():
        others = rows[rows["pattern"] != "HEALPix"]
        far = np.abs(np.log(others["points"] / points)).groupby(others["pattern"])
        count += own < others.loc[far.idxmin(), "discrepancy"].min()
    yield f"lowest at {count} of {(rows['pattern'] == 'HEALPix').sum()}"


def many_lights():
    rows = read("static-sampling")
    yield f"{rows['sampler'].nunique()} methods on {rows['environment'].nunique()} maps"


def psnr_of_sets():
    printed = {"q2-tree": 33.9, "structured": 33.9, "fhis": 33.3, "lightgen": 31.9}
    psnr = means(read("static-sampling"), "psnr")
    yield from (f"{psnr[name]:.1f} ({value:.1f})" for name, value in printed.items())
    ordered = [
        psnr[one] > psnr[other] for one, other in combinations(printed, 2)
        if printed[one] > printed[other]
    ]  # fmt: skip
    yield f"{sum(ordered)} of {len(ordered)} pairs"


def calm():
    squares = read("dynamic-sequence")[["temporal_noise", "true_change"]] ** 2
    mean = np.sqrt(squares.groupby(read("dynamic-sequence")["method"]).mean())
    noise = mean["temporal_noise"] / mean["true_change"]
    names = ["q2-tree", "structured", "fhis"]
    yield from (f" {noise[name]:.2f}" for name in names)
    yield f"calmer than {(noise[names] > noise['q2-tree']).sum()} of 2"


def from_before():
    rows = read("dynamic-sequence", "method == 'timing'")
    yield f"{(rows['seconds_alone'] / rows['seconds_coherent']).median():.2f}× as fast"
    yield f"alone {(rows['seconds_tree_alone'] / rows['seconds_tree_coherent']).median():.2f}×"
    yield f"in {int(rows['identical'].sum())} of {len(rows)} frames"


@pytest.mark.parametrize(
    ("line", "figures"),
    [
        ("Wu 2025, Table 1", table_1), ("Wu 2025, Table 2", table_2), ("Wu 2025, Fig. 8", ranks),
        ("Wu 2025, Fig. 1, 9 and 10", equal_time), ("Wu 2025, Fig. 6", false_edges),
        ("Wu 2025, Fig. 11", glossy), ("Wu 2025, Fig. 13", reuse),
        ("Wu 2025, §4.5", light_times), ("Ergun 2012, Fig. 7", anisotropic),
        ("Arbree 2005, Table 1", area_lights), ("Wu 2025, Fig. 4", emissive),
        ("Wu 2025, Fig. 5", on_emissive), ("Wu 2025, Fig. 14", hardest),
        ("Ergun 2012, Fig. 1", criteria), ("Ergun 2012, Fig. 2", law),
        ("Ergun 2012, Fig. 3 and 4", throughput), ("Ergun 2012, Fig. 6", spheres),
        ("Arbree 2005, Fig. 2", disc_energy), ("Arbree 2005, Fig. 3", disc_images),
        ("Wan 2005, Fig. 4", patterns), ("Wan 2005, Fig. 7", many_lights),
        ("Wan 2005, Fig. 9", psnr_of_sets), ("Wan 2005, Fig. 10", calm),
        ("Wan 2005, §6", from_before),
    ],
)  # fmt: skip
def test_the_line_of_a_figure_has_what_the_rows_give(line, figures):
    (told,) = re.findall(rf"^- {re.escape(line)}: .*$", PAGE, re.MULTILINE)
    for figure in figures():
        assert figure in told, figure


@pytest.mark.parametrize(
    ("folder", "budget"),
    [
        ("table1-equal-time", "time=median-cut:8"), ("table1-lights", "lights=32"),
        ("table1-quick", "lights=16"), ("convergence", "lights=16"), ("renderers", "lights=32"),
    ],
)  # fmt: skip
def test_the_line_of_a_folder_has_the_ranking_of_its_rows(folder, budget):
    """Wins, ties, losses, mean ranks, the ratio and Wilcoxon's p by Holm of the first two."""
    (told,) = re.findall(rf"^- .*\]\({folder}/report.md\).*$", PAGE, re.MULTILINE)
    rows = read(folder, f"budget == '{budget}'")
    if "allowed" in rows:
        spent = (rows["seconds_render"] / rows["allowed"]).groupby(rows["sampler"]).mean()
        rows = rows[rows["sampler"].map(spent) <= 1.1]
    errors = resolved(rows, "flip")
    rank = errors.rank(axis=1, method="min").mean().sort_values(kind="stable")
    first, after = (errors[name] for name in rank.index[:2])
    wins, ties = (first < after).sum(), (first == after).sum()
    logs = np.log(errors)
    found = [
        wilcoxon(one[one != 0.0]).pvalue if (one != 0.0).any() else 1.0
        for one in (logs[a] - logs[b] for a, b in combinations(rank.index, 2))
    ]
    holm = np.maximum.accumulate(np.sort(found) * np.arange(len(found), 0, -1)).clip(max=1.0)
    p = holm[np.argsort(found, kind="stable").tolist().index(0)]
    near = (means(rows, "flip", cases=("environment",)) < errors).sum().sum()
    for figure in (
        f"least mean rank, {rank.iloc[0]:.2f}; against the next",
        f"({rank.iloc[1]:.2f}): wins {wins}, ties {ties}, loses {len(errors) - wins - ties}, "
        f"ratio {gmean(first / after):.2f} [",
        f"p = {p:.2g}", *([f"{near} of {errors.size} errors"] if near else []),
    ):  # fmt: skip
        assert figure in told, figure


def interval(errors: pd.DataFrame) -> tuple[float, float, float]:
    """Ours over median cut, and where the middle 95 % of all resamples of the maps lie."""
    pair = errors[["ours", "median-cut"]].to_numpy()
    drawn = pair[np.array(list(product(range(len(pair)), repeat=len(pair))))].sum(axis=1)
    low, high = np.quantile(drawn[:, 0] / drawn[:, 1], [0.025, 0.975])
    return pair[:, 0].sum() / pair[:, 1].sum(), low, high


@pytest.mark.parametrize("text", [README, PAGE])
@pytest.mark.parametrize(
    ("told", "folder", "budget"),
    [
        ("as its paper ran it", "table1-as-published", "rays=median-cut:8"),
        ("by their defaults", "table1-equal-time", "time=median-cut:8"),
    ],
)  # fmt: skip
def test_ours_over_median_cut_as_the_opening_says(text, told, folder, budget):
    _, _, said = " ".join(text.split()).partition(told)
    number = r"(\d\.\d\d)"
    for metric in ("rmse", "flip"):
        match = re.search(rf"{number} \[{number}, {number}\] times the {metric.upper()}", said)
        rows = read(folder, f"budget == '{budget}'")
        ratio, low, high = interval(means(rows, metric, cases=("environment",)))
        assert match and match[1] == f"{ratio:.2f}"
        # A quantile of 10,000 draws is off by 4 √(.025 · .975 / 10⁴) / φ(1.96) = .11 deviations,
        # of which the interval has 3.92; and figures are rounded.
        off = 0.11 / 3.92 * (high - low) + 0.005
        assert [float(match[2]), float(match[3])] == pytest.approx([low, high], abs=off)


def test_readmes_quick_table_has_the_means_of_the_rows():
    rows = read("table1-quick", "budget == 'lights=16'")
    rays = (rows["rays_shadow"] + rows["rays_brdf"]) / rows["rays_primary"]
    rows = rows.assign(rays=rays, prepare=1e3 * rows["seconds_lights"])
    rows = rows.assign(render=1e3 * rows["seconds_render"])
    lines = []
    for name in rows["sampler"].unique():
        line = []
        for metric in ("rmse", "flip"):
            rank = resolved(rows, metric).rank(axis=1, method="min").mean()
            line += [f"{means(rows, metric)[name]:.4f}", f"{rank[name]:.2f}"]
        costs = rows[rows["sampler"] == name][["rays", "prepare", "render"]].mean()
        lines.append([*line, *map("{:.{}f}".format, costs, (1, 1, 0))])
    table = README.partition("table1 · lights=16")[2].partition("\n\n")[0].splitlines()[3:]
    assert len(table) > 4 and max(map(len, table)) <= 4 + 88
    for words in (line.split(")")[1].split() for line in table):
        assert words[:2] + words[3:5] + words[6:] in lines
