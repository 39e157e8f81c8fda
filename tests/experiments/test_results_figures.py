"""Figures on the page of results and in README, from the published rows by pandas alone.

Of the project's code it asks for labels, what the papers print, and what samplers declare.
"""

import json
import re
import tomllib
from collections.abc import Collection, Iterator
from functools import cache
from itertools import combinations, product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import gmean, wilcoxon

from experiments.maps.features import FEATURES
from experiments.questions.readings import ruled_out
from experiments.questions.stability.figures import PROPERTIES
from experiments.wu2025.published import TABLE1, TABLE2
from samplers import sampler_class
from samplers.conformance.exceptions import EXCEPTIONS

RESULTS = Path(__file__).parents[2] / "results"
PAGE = (RESULTS / "README.md").read_text(encoding="utf-8")
README = (RESULTS.parent / "README.md").read_text(encoding="utf-8")
PAPERS = list(TABLE1.values)
RUN_AS = {"mis": "mis[numbers=independent]", "fhis": "fhis[light=point]"}
RUN_AS["tmms"] = "tmms[useful_solid_angle=0.01, widest=None]"
FIXED = ["median-cut", "variance-minimization", "tmms"]
CASE = ["scene", "environment"]
N = r"(\d\.\d+)"
RAYS, TIME = "budget == 'rays=median-cut:8'", "budget == 'time=median-cut:8'"


def of_paper(table, metric: str) -> pd.Series:
    return pd.Series({name: value[metric][0] for name, value in table.values.items()})


@cache
def read(folder: str, wanted: str = "index == index", file: str = "measurements.csv.gz"):
    (record,) = RESULTS.rglob(f"{folder}/run.json")
    return pd.read_csv(record.parent / file, low_memory=False).query(wanted)


GRIDS, SIZES, WIDTHS = {}, {}, {}
"""Of every run over a grid, by folder: the experiment, and the size of the images."""
for file in sorted(RESULTS.rglob("run.json"), key=lambda file: file.parent):
    record = json.loads(file.read_text(encoding="utf-8"))
    if "planned" in record:
        GRIDS[file.parent.name] = record["experiment"]
        WIDTHS[file.parent.name] = record["scale"]["width"]
        SIZES[file.parent.name] = "{width}×{height}".format(**record["scale"])


def rays_of(rows: pd.DataFrame) -> pd.Series:
    return (rows["rays_shadow"] + rows["rays_brdf"]) / rows["rays_primary"]


def of(sampler: str) -> str:
    return sampler_class(sampler).label


def line_of(folder: str) -> str:
    """The line of a folder on the page."""
    (told,) = re.findall(rf"^- .*\({folder}/report.md\).*$", PAGE, re.MULTILINE)
    return told


def means(rows: pd.DataFrame, value: str, by: str = "sampler", cases: tuple[str, ...] = ()):
    """Cases × samplers, or by sampler alone: the mean over seeds of each case, then over cases."""
    per_case = rows.groupby([*dict.fromkeys([*CASE, *cases]), by])[value].mean()
    return (
        per_case.groupby([*cases, by]).mean().unstack(by) if cases else per_case.groupby(by).mean()
    )


def cells(rows: pd.DataFrame, metric: str) -> pd.DataFrame:
    """Cases × samplers, and the noise of the references; NaN where not all seeds are there."""
    groups = rows.groupby([*CASE, "sampler"])
    seeds = groups.size().unstack()
    floor = rows.groupby(CASE)[f"{metric}_floor"].mean()
    return groups[metric].mean().unstack().where(seeds == seeds.max()).assign(floor=floor)


def ranked(errors: pd.DataFrame) -> pd.DataFrame:
    """Of cells, maps × samplers; nothing is below 3 times the noise of the references."""
    errors = errors.groupby("environment").mean()
    floor = errors.pop("floor")
    return errors.clip(lower=3.0 * floor, axis="index")


def resolved(rows: pd.DataFrame, metric: str) -> pd.DataFrame:
    return ranked(cells(rows, metric).dropna())


def table_1():
    rows = read("table1-as-published", RAYS)
    for error in (means(rows, "rmse"), means(rows, "flip")):
        yield f"{error['ours'] / error['median-cut']:.2f} ["


def table_2():
    alike = []
    for metric in ("flip", "rmse"):
        printed = of_paper(TABLE2, metric)
        error = means(read("table2"), metric)[printed.index]
        for a, b in combinations(printed.index, 2):
            alike.append((error[a] < error[b]) == (printed[a] < printed[b]))
    yield f"{sum(alike)} of {len(alike)} pairs"
    for label in printed.index.drop("ours"):
        yield "{:.2f} ({:.2f})".format(*(one[label] / one["ours"] for one in (error, printed)))


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
    rivals = error[["mis", "median-cut", "tmms"]]
    for name in rivals:
        yield f"{of(name)} on {(error['ours'] < error[name]).sum()} of {len(error)} cases"
    yield f"beats {(rivals.mean() > error['ours'].mean()).sum()} of 3"


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
    yield from (f"{of(name)} on {count}" for name, count in zip(FIXED, more, strict=True))
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


def about(told: list[str], values: np.ndarray, unit: float = 0.01) -> None:
    """A mean, and the middle 95 % of its resamples: quantiles of the page's 10,000 draws and of
    these 40,000 differ by 4 √(1.25 · .025 · .975 / 10⁴) / φ(1.96) = .12 of a deviation, of which an
    interval has 3.92. values : the mean, then the resamples"""
    low, high = np.quantile(values[1:], [0.025, 0.975])
    mean, *ends = map(float, told)
    assert mean == pytest.approx(values[0], abs=0.501 * unit)
    assert ends == pytest.approx([low, high], abs=0.12 / 3.92 * (high - low) + 0.501 * unit)


def resampled(blocks: np.ndarray) -> np.ndarray:
    """The mean of blocks (n, …), and means of blocks drawn anew, (1 + 40,000, …)."""
    count = len(blocks)
    drawn = np.random.default_rng(0).multinomial(count, np.full(count, 1.0 / count), 40_000)
    return np.concatenate([blocks.mean(axis=0)[None], drawn @ blocks / count])


def over(rows: pd.DataFrame) -> pd.Series:
    """By sampler, whether it takes more than 1.1 times the one budget of the rows."""
    spent = rays_of(rows)
    if rows["budget"].iloc[0].startswith("time"):
        spent = rows["seconds_render"]
    return (spent / rows.get("allowed", np.inf)).groupby(rows["sampler"]).mean() > 1.1


@pytest.mark.parametrize(
    ("folder", "budget"),
    [
        ("table1-equal-time", "time=median-cut:8"), ("table1-lights", "lights=32"),
        ("table1-quick", "lights=16"), ("convergence", "lights=16"), ("renderers", "lights=32"),
    ],
)  # fmt: skip
def test_the_line_of_a_folder_has_the_ranking_of_its_rows(folder, budget):
    """Who ties, mean ranks, wins, ties, losses, the ratio and Wilcoxon's p by Holm of the first."""
    told, rows = line_of(folder), read(folder, f"budget == '{budget}'")
    rows = rows[~rows["sampler"].map(over(rows))]
    errors = resolved(rows, "flip")
    both = (resolved(rows, name).rank(axis=1, method="min").mean() for name in ("flip", "rmse"))
    rank = pd.concat(both, axis=1).sort_values([0, 1], kind="stable")[0]
    first, after = (errors[name] for name in rank.index[:2])
    wins, ties = (first < after).sum(), (first == after).sum()
    logs, pairs = np.log(errors), list(combinations(rank.index, 2))
    found = [
        wilcoxon(one[one != 0.0]).pvalue if (one != 0.0).any() else 1.0
        for one in (logs[a] - logs[b] for a, b in pairs)
    ]
    holm = np.maximum.accumulate(np.sort(found) * np.arange(len(found), 0, -1)).clip(max=1.0)
    p = holm[np.argsort(np.argsort(found, kind="stable"))][: len(rank) - 1]
    exact = cells(rows, "flip").dropna().groupby("environment").mean()
    near = (exact[errors.columns] < errors).sum()
    tied = 1 + ((p > 0.05) | (rank.iloc[1:] == rank.iloc[0])).sum()
    least = min(1.0, len(pairs) * 2.0 ** (1 - len(errors)))
    opening = told.partition(f"{budget}: ")[2].partition(f" over {len(errors)} maps")[0]
    if least > 0.05 and tied == len(rank):
        assert f"among {tied} samplers (p is at least {least:.2g})" in opening
    else:
        more = re.search(r"(\d+) more tie", opening)
        assert opening.count(")") + (int(more[1]) if more else 0) == tied
    ((*figures, p_told),) = re.findall(rf", ratio {N} \[{N}, {N}\], p = ([\de.-]*\d)", told)
    about(figures, np.exp(resampled(np.log(first / after).to_numpy())))
    assert p_told == f"{p[0]:.2g}"
    for figure in (
        f"least mean rank, {rank.iloc[0]:.2f}; against the next",
        f"({rank.iloc[1]:.2f}): wins {wins}, ties {ties}, loses {len(errors) - wins - ties}, ",
        *([f"{near.sum()} of {errors.size} errors"] if near.any() else []),
    ):  # fmt: skip
        assert figure in told, figure


def table_1_ratios(rows: pd.DataFrame, metric: str, run_as: dict[str, str]) -> pd.DataFrame:
    """Mean errors over median cut's (the mean, then resamples of the maps × methods)."""
    errors = means(rows, metric, cases=("environment",))[[run_as.get(k, k) for k in PAPERS]]
    drawn = pd.DataFrame(resampled(errors.to_numpy()), columns=PAPERS)
    return drawn.div(drawn["median-cut"], axis=0)


def said(words: str, rows: pd.DataFrame, folder: str) -> str:
    """What follows some words and how much was measured, to the end of the line."""
    maps, scenes = rows["environment"].nunique(), rows["scene"].nunique()
    words = f"{words} ({maps} maps, {scenes} scenes, {SIZES[folder]}): "
    (rest,) = (line.partition(words)[2] for line in PAGE.splitlines() if words in line)
    return rest


@pytest.mark.parametrize("folder", ["table1-as-published", "table1-as-published-standard"])
def test_what_is_said_of_table_1_as_published(folder):
    rows = read(folder, RAYS)
    told = said("as its paper ran it", rows, folder)
    sure = possible = 0
    for metric in ("rmse", "flip"):
        ratios, printed = table_1_ratios(rows, metric, RUN_AS), of_paper(TABLE1, metric)
        (figures,) = re.findall(rf"{N} \[{N}, {N}\] times the {metric.upper()}", told)
        about(figures, ratios["ours"])
        assert ratios.loc[0].idxmin() == "ours"
        assert f"{printed.corr(ratios.loc[0], 'spearman'):.2f} by {metric.upper()}" in told
        for name, paper in (printed / printed["median-cut"]).drop("median-cut").items():
            low, high = ratios[name][1:].quantile([0.025, 0.975])
            near, off = abs(ratios[name][0] / paper - 1.0) <= 0.1, 0.12 / 3.92 * (high - low)
            sure += near or low + off <= paper <= high - off
            possible += near or low - off <= paper <= high + off
    assert "Ours (Wu 2025) is first of 7 by both. Of 12 ratios" in told
    assert sure <= int(re.findall(r"median cut, (\d+) have", told)[0]) <= possible


def test_what_is_said_of_equal_time():
    rows = read("table1-equal-time", TIME)
    rows = rows[~rows["sampler"].map(over(rows))]
    words = f", {rows['sampler'].nunique()} methods by their defaults"
    told = said(words, rows, "table1-equal-time")
    for metric in ("rmse", "flip"):
        (figures,) = re.findall(rf"{N} \[{N}, {N}\] times the {metric.upper()}", told)
        about(figures, table_1_ratios(rows, metric, {})["ours"])
        error = means(rows, metric)
        least = (error / error["median-cut"]).drop("median-cut").nsmallest(3)
        names = [f"{of(name)} {value:.2f}" for name, value in least.items()]
        assert "least {} {}, {} and {}".format(metric.upper(), *names) in told


def test_the_ratios_of_table_1_step_by_step():
    columns, folder = [], "table1-as-published"
    for metric in ("rmse", "flip"):
        columns.append(of_paper(TABLE1, metric) / of_paper(TABLE1, metric)["median-cut"])
        for name, wanted, run_as in (
            (f"{folder}-standard", RAYS, RUN_AS), (folder, RAYS, RUN_AS), (folder, RAYS, {}),
            ("table1-equal-time", TIME, {}),
        ):  # fmt: skip
            columns.append(table_1_ratios(read(name, wanted), metric, run_as).loc[0])
    for name in PAPERS:
        (told,) = re.findall(rf"^\| {re.escape(of(name))} +\| +(\d.*) \|$", PAGE, re.MULTILINE)
        assert re.split(r" \| +", told) == [f"{column[name]:.2f}" for column in columns]


def test_the_answer_names_the_least_error_in_each_time():
    rows = read("convergence")
    rows = rows.assign(seconds=rows["seconds_lights"] + rows["seconds_render"])
    assert rows["machine"].nunique() == 1
    values = ["rmse", "flip", "rmse_floor", "flip_floor", "seconds"]
    points = rows.groupby(["sampler", "budget", "environment"])[values].mean()
    points = points.groupby(["sampler", "budget"]).mean().reset_index()
    lights = rows.loc[rows["league"].isin(["fixed lights", "layers", "disc lights"]), "sampler"]
    uses = list(product(("flip", "rmse"), (lights, points["sampler"])))
    found = re.findall(r"^\| ([\d.]+) (m?s) +\| (.*) \|$", PAGE, re.MULTILINE)
    assert len(found) == 8
    for time, unit, told in found:
        able = points[points["seconds"] <= float(time) * (1e-3 if unit == "ms" else 1.0)]
        for entry, (metric, use) in zip(told.split("|"), uses, strict=True):
            some = able[able["sampler"].isin(use)].sort_values([metric, "seconds"], kind="stable")
            near = some[some[metric] < 3.0 * some[f"{metric}_floor"]]
            best, ties = some.iloc[0], some.index[0] in near.index
            names = list(map(of, (near if ties else some[:1])["sampler"].unique()))
            wanted = ", ".join(names[:2]) + (f" and {len(names) - 2} more" if names[2:] else "")
            wanted += f" {best[metric]:.3f}"
            base = able.loc[able["sampler"] == "median-cut", metric]
            if len(base) and not ties:
                wanted += f" ({best[metric] / base.min():.2f})"
            assert entry.strip() == wanted


def test_readmes_quick_table_has_the_means_of_the_rows():
    rows = read("table1-quick", "budget == 'lights=16'")
    rows = rows.assign(rays=rays_of(rows), prepare=1e3 * rows["seconds_lights"])
    rows = rows.assign(render=1e3 * rows["seconds_render"])
    ranks = {name: resolved(rows, name).rank(axis=1, method="min") for name in ("rmse", "flip")}
    table = README.partition("table1 · lights=16")[2].partition("\n\n")[0].splitlines()[3:]
    assert len(table) > 4 and max(map(len, table)) <= 4 + 88
    for line in table:
        label, _, words = line.strip().partition(")")
        (name,) = (one for one in rows["sampler"].unique() if of(one) == f"{label})")
        costs = rows[rows["sampler"] == name][["rays", "prepare", "render"]].mean()
        told = words.split()
        assert told[6:] == list(map("{:.{}f}".format, costs, (1, 1, 0)))
        for metric, (error, rank, margin) in zip(ranks, (told[:3], told[3:6]), strict=True):
            drawn = resampled(ranks[metric][name].to_numpy())
            assert [error, rank] == [f"{means(rows, metric)[name]:.4f}", f"{drawn[0]:.2f}"]
            half = np.diff(np.quantile(drawn[1:], [0.025, 0.975]))[0] / 2
            # As in `about`; means of ranks go in steps of one over the maps.
            off = 0.12 / 1.96 * half + 1.0 / len(ranks[metric]) + 0.005
            assert float(margin) == pytest.approx(half, abs=off)


def selections(metric: str) -> Iterator[tuple[str, str, pd.DataFrame, pd.DataFrame]]:
    """What two selections of rows at one budget differ in, the runs, and the cells of both."""
    runs = []
    for name in GRIDS:
        rows = read(name)
        parts = {budget: cells(part, metric) for budget, part in rows.groupby("budget")}
        runs.append((name, parts, set(rows["scene"]), set(rows["environment"])))
    for (name, one, scenes, maps), (other, two, scenes_2, maps_2) in [
        *((run, run) for run in runs), *combinations(runs, 2)
    ]:  # fmt: skip
        names, alike = ", ".join(dict.fromkeys([name, other])), SIZES[name] == SIZES[other]
        for budget in one.keys() & two.keys():
            a, b = one[budget], two[budget]
            if not (alike or budget.startswith(("time", "seconds"))):
                both = a.columns.intersection(b.columns)
                a, b = (a, b) if WIDTHS[name] < WIDTHS[other] else (b, a)
                yield "image sizes", names, *shared(a[both].dropna(), b[both].dropna())
            if alike and not maps & maps_2:
                yield "maps", names, *(at_scenes(x, scenes & scenes_2) for x in (a, b))
            if one is two or (alike and GRIDS[name] == GRIDS[other] and not scenes & scenes_2):
                pairs = combinations(sorted(scenes), 2) if one is two else product(scenes, scenes_2)
                for here, there in pairs:
                    pair = (at_scenes(x, [scene]) for x, scene in ((a, here), (b, there)))
                    yield "scenes", names, *shared(*(x.droplevel("scene") for x in pair))


def at_scenes(errors: pd.DataFrame, scenes: Collection[str]) -> pd.DataFrame:
    return errors[errors.index.isin(scenes, "scene")].dropna()


def shared(one: pd.DataFrame, two: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    both = one.index.intersection(two.index)
    return one.loc[both], two.loc[both]


@pytest.mark.parametrize("metric", ["rmse", "flip"])
def test_the_orders_on_other_maps_scenes_and_sizes(metric):
    found: dict[str, list] = {"maps": [], "scenes": [], "image sizes": []}
    for between, names, *pair in selections(metric):
        errors = [ranked(part) for part in pair]
        both = errors[0].columns.intersection(errors[1].columns)
        one, two = (part[both].rank(axis=1, method="min").mean() for part in errors)
        if len(both) > 2 and min(one.nunique(), two.nunique()) > 1:
            far, same = (two - one).abs(), ((one == one.min()) & (two == two.min())).any()
            moved = far.max(), one[far.idxmax()], two[far.idxmax()]
            found[between].append((one.corr(two, "spearman"), same, names, moved))
    for between, lines in found.items():
        told = re.findall(rf"^\| {between} +\| {metric.upper()} .*$", PAGE, re.MULTILINE)
        assert len(told) == bool(lines)
        if lines:
            rho, same, names, moved = map(list, zip(*lines, strict=True))
            wanted = [
                len(set(names)), len(rho), f"{np.median(rho):.2f}", f"{min(rho):.2f}",
                names[np.argmin(rho)], sum(same),
            ]  # fmt: skip
            entries = [entry.strip() for entry in told[0].split("|")[3:-1]]
            assert entries[:6] == list(map(str, wanted))
            assert entries[6].endswith("({:.1f}, {:.1f})".format(*max(moved)[1:]))


def lines() -> Iterator[tuple[str, str, str]]:
    """Every line on a run below the papers' figures: its folder, what was measured, the rest."""
    suite = tomllib.loads((RESULTS / "suite.toml").read_text(encoding="utf-8"))
    titles = {one.get("title"): name.split("/")[-1] for name, one in suite.items()}
    line = r"^- \*\*(.+?)\*\* \(\[(.+?)\]\(.+?\), (.+?)\): (.*)$"
    for title, name, measured, rest in re.findall(line, PAGE, re.MULTILINE):
        yield titles.get(title, name), measured, rest


def test_lines_say_how_much_was_measured():
    for folder, measured, _ in lines():
        rows = read(folder)
        grid = f"{rows.get('environment', rows.index).nunique()} maps, {SIZES.get(folder)}, "
        assert measured.startswith(grid) if folder in GRIDS else measured == f"{len(rows)} rows"


def compared_readings(folder: str) -> Iterator[tuple[str, str, str, tuple, pd.Series]]:
    """Each reading: label, metric, budget or kind, how much it decides, ln of its ratio by map."""
    for kind, alike in read(folder).groupby(read(folder)["budget"].str.partition("=")[0]):
        for metric in ("rmse", "flip"):
            tables = {at: (cells(part, metric), over(part)) for at, part in alike.groupby("budget")}
            for label in alike["sampler"].unique():
                base = "mis" if label == "mis-compensated" else label.partition("[")[0]
                costly = {"sets", *sampler_class(base).costly} & set(re.findall(r"(\w+)=", label))
                logs = {
                    one: np.log(ranked(table[[label, base, "floor"]].dropna())).diff(axis=1)[base]
                    for one, (table, spent) in tables.items()
                    if len({label, base} & set(table)) == 2 and not spent[[label, base]].any()
                }
                if logs:
                    place = ["lights", "rays", "time"].index(kind)
                    weight = (place if costly else -place), WIDTHS[folder]
                    at = next(iter(logs)) if len(logs) == 1 else f"equal {kind}"
                    yield label, metric, at, weight, -pd.concat(logs, axis=1).mean(axis=1)


def test_the_lines_of_readings_name_the_default_that_is_beaten_most():
    names = [name for name, made in GRIDS.items() if made == "readings"]
    found = {name: list(compared_readings(name)) for name in names}
    found["readings"] = [one for each in found.values() for one in each]
    told = [(folder, rest) for folder, _, rest in lines() if folder in found]
    table = read("readings", file="readings.csv").drop_duplicates("label")
    words = table.set_index("label")["choice"]
    assert len(told) == len(found) > 5
    for folder, rest in told:
        most = {one[0]: one[3] for one in sorted(found[folder], key=lambda one: one[3])}
        decisive = [one for one in found[folder] if one[3] == most[one[0]] and len(one[4]) > 5]
        # What samplers share is told of all of them together; what nothing keeps is told first.
        own = [one for one in decisive if not re.search(r"light_extent=|sets=ind", one[0])]
        place = lambda one: (np.exp(one[4].mean()) >= 0.97, one[0] in ruled_out(), one[4].mean())  # noqa: E731
        label, metric, at, (_, size), logs = min(own, key=place)
        if np.exp(logs.mean()) >= 0.97:
            assert rest.startswith(f"No default of {len(own)} comparisons is beaten by more")
            continue
        how = rf"^(.*?)×\d+, {metric.upper()} × {N} \[{N}, {N}\] at {at}"
        ((start, *figures),) = re.findall(how, rest)
        assert start == f"{of(label.partition('[')[0])} is beaten by {words[label]} ({size}"
        about(figures, np.exp(resampled(logs.to_numpy())), 0.001)


def studies() -> Iterator[tuple[str, str]]:
    """Folders and figures of the lines on what is no ranking."""
    for name, rows in read("real-time").sort_values("count").groupby("sampler"):
        (few, many), flip = 1.0 / rows["seconds_frame"].iloc[[0, -1]], rows["flip"].iloc[[0, -1]]
        told = f"{of(name)} {few:.1f} to {many:.1f} frames a second, FLIP "
        yield "real-time", told + "{:.4f} to {:.4f}".format(*flip)
    told = "{width}×{height}, one sample a pixel, {threads} threads of a processor"
    yield "real-time", told.format(**rows.iloc[0])
    yield "real-time", f"{rows['count'].min()} to {rows['count'].max()} lights: "
    seconds = read("renderer-tables").pivot_table("seconds_sample", "environment", "sampler")
    speed = seconds.rdiv(seconds["mis"], axis=0).drop(columns="mis")
    for name, low, high in zip(speed, speed.min(), speed.max(), strict=True):
        label = of(name.partition("[")[0]) + name[name.find("[") :] * ("[" in name)
        yield "renderers/renderer-tables", label.replace("[", " [") + f" {low:.2f} to {high:.2f}"
    yield "renderers/renderer-tables", f"on {len(speed)} maps"
    rows = read("production-renderers", "materials == 'lambert' and samples == samples.max()")
    times = rows.pivot_table("efficiency", CASE, "renderer")
    times = times.div(times["envlight mis"], axis=0).drop(columns="envlight mis")
    kinds = gmean(times, nan_policy="omit"), times.min(), times.max()
    for mean, low, high in zip(*kinds, strict=True):
        yield "production-renderers", f" {mean:.2f} ({low:.2f} to {high:.2f})"
    yield "production-renderers", f"lambert, {rows['samples'].max()} samples a pixel"
    yield "production-renderers", f"over {len(times)} cases"
    rows = read("skipping", "identical.notna() and skip != 'BRDF sampling if Lambertian'")
    yield "stability/skipping", f"{rows['identical'].sum():.0f} of {len(rows)} images"
    rows, found = read("stability", "table == 'samplers'"), {}
    for key, one in PROPERTIES.items():
        if one.tolerance is not None:
            left = rows[rows[key] < one.tolerance if one.least else rows[key] > one.tolerance]
            declared = [one.check in EXCEPTIONS.get(name, ()) for name in left["sampler"]]
            found[one.title] = left[~np.array(declared, bool)]
    every = pd.concat(found, names=["title"]).reset_index("title")
    lit = every[~every["map"].isin(["nearly-denormal", "denormal", "smallest-blue"])]
    dark, count = set(every["sampler"]) - set(lit["sampler"]), rows["sampler"].nunique()
    yield "stability", f"{len(dark)} of {count} samplers leave a tolerance on denormals"
    for title, count in lit.groupby("title")["sampler"].nunique().items():
        yield "stability", f"{title} of {count}"
    choice, always, random, held = np.mean(list(regret_of_advice()), axis=0)
    yield "which-sampler", f"errs {np.exp(choice):.3f} times as much as the best one there"
    yield "which-sampler", f"best on average {np.exp(always):.3f}, any {np.exp(random):.2f};"
    yield "which-sampler", f"hold {100 * held:.0f} % of the errors"


def step(feature: pd.Series) -> pd.Series:
    """A feature of maps such that a step is a factor."""
    match FEATURES[feature.name.removeprefix("map_")].unit:
        case "share":
            feature = feature.clip(1e-3, 1.0 - 1e-3)
            return np.log(feature / (1.0 - feature))
        case "count":
            return np.log1p(feature)
        case "degrees" | "ratio":
            return np.log(feature.clip(1e-30))
    return feature


def regret_of_advice() -> Iterator[list[float]]:
    """At each budget, of ln RMSE over maps kept aside: by advice, which is the mean of the maps
    that are like one, of the best on average, of any; and the share of errors in intervals."""
    rows, tables = read("which-sampler"), {}
    features = rows.groupby("environment")[[f"map_{name}" for name in FEATURES]].first().apply(step)
    features = features.drop(columns="map_contrast")
    for count, part in rows.groupby(rows["budget"].str[7:].astype(int)):
        part, columns = part.assign(rays=rays_of(part)), ("rmse", "rmse_floor", "rays")
        found, floor, traced = (means(part, name, cases=("environment",)) for name in columns)
        tables[count] = np.log(found.clip(lower=3.0 * floor.max(axis=1), axis="index")), traced
    names = rows["sampler"].unique()
    error, rays = (
        np.stack([one.reindex(features.index, columns=names) for one in ones], axis=-1)
        for ones in zip(*tables.values(), strict=True)
    )
    counts, (maps, samplers, _) = np.array(list(tables)), error.shape
    logs, grid, apart = np.log(counts), np.arange(counts[0], counts[-1] + 1), []
    for k in range(maps):
        others = features.drop(features.index[k])
        square = (((others - features.iloc[k]) / others.std(ddof=0)) ** 2).mean(axis=1).to_numpy()
        weight = np.exp((square.min() - square) / (2.0 * 0.8**2))
        known = [np.delete(one, k, 0) for one in (error, rays)]
        for one, c in product(known, range(1, len(counts))):  # as far on as on the other maps
            further = one[..., c - 1] + np.nanmean(one[..., c] - one[..., c - 1], axis=0)
            one[..., c] = np.where(np.isnan(one[..., c]), further, one[..., c])
        level, traced = (np.tensordot(weight / weight.sum(), one, 1) for one in known)
        level = np.array([np.interp(np.log(grid), logs, one) for one in level])
        traced = np.array([np.interp(grid, counts, one) for one in traced])
        apart.append((weight / weight.sum(), known[0], level, traced))
    for amount, lights in [*product(counts, [True]), *product(2.0 ** np.arange(1, 7), [False])]:
        truth = error[..., list(counts).index(amount)] if lights else np.nan * error[..., 0]
        for one in () if lights else np.ndindex(truth.shape):
            order = [c for c in np.argsort(rays[one]) if rays[one][c] > 0.0]
            there = np.log(rays[one][order])
            if len(there) and np.ptp([np.log(amount), *there]) <= np.ptp(there) + np.log(1.25):
                truth[one] = np.interp(np.log(amount), there, error[one][order])
        some = np.isfinite(truth).mean(axis=0) >= 0.9
        if some.sum() < 2:
            continue
        told = np.full((3, maps, samplers), np.nan)
        for (k, (weight, errors, level, traced)), j in product(enumerate(apart), range(samplers)):
            able = (grid == amount if lights else traced[j] <= amount) & np.isfinite(level[j])
            able = np.flatnonzero(able)
            if len(able):
                there = [np.interp(np.log(grid[able[-1]]), logs, one) for one in errors[:, j]]
                order = np.argsort(there)
                place = np.cumsum(weight[order]) - 0.5 * weight[order]
                ends = np.interp([0.1, 0.9], place, np.array(there)[order])
                told[:, k, j] = level[j, able[-1]], *ends
        kept = np.isfinite(truth[:, some]).all(axis=1) & np.isfinite(told[0][:, some]).any(axis=1)
        errors, guess, low, high = (one[np.ix_(kept, some)] for one in (truth, *told))
        regret, every = errors - errors.min(axis=1, keepdims=True), np.arange(len(errors))
        average = ((errors.sum(axis=0) - errors) / (len(errors) - 1)).argmin(axis=1)
        held = ((low <= errors) & (errors <= high))[np.isfinite(guess)].mean()
        chosen = np.where(np.isfinite(guess), guess, np.inf).argmin(axis=1)
        yield [regret[every, chosen].mean(), regret[every, average].mean(), regret.mean(), held]


@pytest.mark.filterwarnings("ignore:Mean of empty slice")
def test_the_lines_of_studies_have_what_the_rows_give():
    for folder, figure in studies():
        assert figure in line_of(folder), (folder, figure)


def test_readme_is_short_and_opens_as_the_page_of_results():
    """The page is what code makes of the rows."""
    readme = " ".join(README.split())
    opening = PAGE.partition("## Which sampler")[2].partition("## The same")[0]
    for part in opening.split("\n\n"):
        assert part.startswith(("| method", "Errors over")) or " ".join(part.split()) in readme
    report = (RESULTS / "table1-as-published" / "report.md").read_text(encoding="utf-8")
    for part in opening.partition("reproduced?")[2].split("\n\n")[1:4]:
        assert part in report and "for first" not in report  # the last from another folder's rows
    assert len(README.splitlines()) <= 130
    # So much prints on ten pages.
    reports = [one.read_text("utf-8") for one in RESULTS.rglob("report.md")]
    assert reports and max(len(text.splitlines()) for text in reports) <= 400
