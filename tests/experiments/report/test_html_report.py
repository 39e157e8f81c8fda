"""The HTML report: every link leads to a file, numbers agree with the CSV, nothing is stale."""

import json
import math
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from experiments.report import figures
from experiments.report.figures import line_plot, save_plot
from experiments.report.html import LIST, write_html
from experiments.report.previews import (
    COMPRESSED,
    LOSSLESS_PIXELS,
    STEEPNESS,
    WHITEST,
    _save,
    coded,
    decoding_table,
    mapped_metrics,
    reduced,
)
from experiments.report.rankings import BASELINE, results
from experiments.report.run_data import load_run, quoted, slug
from experiments.report.sampler_pages import inline, parts_of
from experiments.report.sections.ranks import words
from experiments.run.record import write_csv
from experiments.run.store import IMAGE, Store
from metrics.registry import leading_metric, metrics, ranked_metrics
from samplers import EnvlightError
from samplers.files.image_file import read_radiance
from tests.experiments.stored import alter, forget

VOID = {
    "meta",
    "link",
    "img",
    "br",
    "input",
    "image",
    "circle",
    "path",
    "fefuncr",
    "fefuncg",
    "fefuncb",
}


class Page(HTMLParser):
    """Links, ids, tables (lists of rows of cells) and text of a page; checks that tags nest."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.ids: list[str] = []
        self.tables: list[tuple[dict, list[list[str]]]] = []
        self.text = ""
        self.open: list[str] = []
        self.data: dict = {}
        self.feed(path.read_text(encoding="utf-8"))
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.links += [found[name] for name in ("href", "src") if found.get(name)]
        self.ids += [found["id"]] if "id" in found else []
        if tag not in VOID:
            self.open.append(tag)
        if tag == "table":
            self.tables.append((found, []))
        if tag == "tr":
            self.tables[-1][1].append([])
        if tag in ("td", "th"):
            self.tables[-1][1][-1].append("")

    def handle_startendtag(self, tag, attributes):
        self.links += [value for name, value in attributes if name == "href"]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open[-1:] == ["script"] and data.strip():
            self.data = json.loads(data)
            return
        self.text += data
        if self.tables and {"td", "th"} & set(self.open):
            self.tables[-1][1][-1][-1] += data


@pytest.fixture(scope="module")
def run(finished, maps_folder, suffixes_of_plots, tmp_path_factory) -> Path:
    """A complete run with its report, plots of all kinds among it."""
    folder = shutil.copytree(finished, tmp_path_factory.mktemp("reported") / "a run")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures, "SUFFIXES", suffixes_of_plots)
        assert write_html(folder, maps=(maps_folder,)) == folder / "report/index.html"
    return folder


@pytest.fixture(scope="module")
def pages(run) -> dict[str, Page]:
    report = run / "report"
    return {str(path.relative_to(report)): Page(path) for path in sorted(report.rglob("*.html"))}


def local_links(page: Page) -> list[str]:
    found = [link for link in page.links if not link.startswith(("#", "data:"))]
    data = page.data
    if data:
        methods = [method for budget in data["budgets"] for method in budget["methods"]]
        found += [data["reference"], *(m["image"] for m in methods)]
        found += [file for method in methods for file in method["errors"].values()]
    return found


def test_there_is_a_page_for_every_case_map_and_sampler(pages):
    maps = ("black", "constant", "noise", "other", "sun")
    samplers = ("median-cut", "mis", "uniform")
    expected = {"index.html"}
    expected |= {f"cases/{slug(f'three-boxes_{name}')}.html" for name in maps}
    expected |= {f"maps/{name}.html" for name in maps}
    expected |= {f"samplers/{name}.html" for name in samplers}
    assert set(pages) == expected


def test_every_link_leads_to_a_file(run, pages):
    checked = 0
    for name, page in pages.items():
        for link in local_links(page):
            parts = urlsplit(link)
            assert parts.scheme == "" and parts.netloc == "", link
            target = (run / "report" / name).parent / unquote(parts.path)
            assert target.resolve().is_file(), (name, link)
            checked += 1
        for link in page.links:
            if link.startswith("#"):
                assert link[1:] in page.ids, (name, link)
    assert checked > 100


def test_nothing_comes_from_a_network(run):
    for path in (run / "report").rglob("*"):
        if path.suffix in (".html", ".css", ".js"):
            text = path.read_text(encoding="utf-8")
            assert not re.search(r"https?://|//cdn|@import|url\(\s*['\"]?//", text), path


def test_every_page_is_reached_from_the_first(run, pages):
    report = run / "report"
    linked = {
        str((report / unquote(link)).resolve().relative_to(report.resolve()))
        for link in local_links(pages["index.html"])
    }
    assert set(pages) - {"index.html"} <= linked
    assert {f"tables/{name}" for name in ("summary.csv", "summary.md", "summary.tex")} <= linked
    figures = {str(path.relative_to(report)) for path in (report / "figures").iterdir()}
    assert len(figures) == 3 * len(ranked_metrics()) * len(("rank", "pairs", "cd", "pareto"))
    assert figures <= linked


def test_the_table_prints_the_numbers_of_the_csv(run, pages):
    table = pd.read_csv(run / "report/tables/summary.csv").set_index("sampler")
    _, (headings, *rows) = next(
        found for found in pages["index.html"].tables if "data-budget" in found[0]
    )
    assert len(rows) == len(table) == 3
    for place, metric in enumerate(ranked_metrics()):
        first = headings.index(metric.label)
        rank = [k for k, text in enumerate(headings) if text == "rank"][place]
        ratio = [k for k, text in enumerate(headings) if text == f"× {BASELINE}"][place]
        for cells in rows:
            row = table.loc[cells[0]]
            assert cells[first] == f"{row[metric.name]:.4f}"
            assert cells[rank] == f"{row[f'{metric.name}_rank']:.2f}"
            middle, low, high = (row[f"{metric.name}_{part}"] for part in ("ratio", "low", "high"))
            assert cells[ratio].split() == f"{middle:.2f} [{low:.2f}, {high:.2f}]".split()
    markdown = (run / "report/tables/summary.md").read_text(encoding="utf-8")
    lines = [line for line in markdown.splitlines() if line.startswith("| ")][1:]
    printed = [[cell.split() for cell in line.strip("|").split("|")] for line in lines]
    assert printed == [[cell.split() for cell in row] for row in rows]


def test_tables_and_sentences_are_those_of_the_report(run, pages):
    report = (run / "report.md").read_text(encoding="utf-8")
    assert (run / "report/tables/summary.csv").read_bytes() == (run / "summary.csv").read_bytes()
    assert (run / "report/tables/measurements.csv").read_bytes() == (
        run / "measurements.csv"
    ).read_bytes()
    page = " ".join(pages["index.html"].text.split())
    (result,) = results(load_run(run).rows)
    assert len(result.rankings) == len(ranked_metrics())
    for ranking in result.rankings:
        for sentence in words(ranking):
            assert f"- {sentence}\n" in report
            assert sentence in page


def test_the_page_names_the_starts_that_measured(copied):
    with Store.writing(copied) as store:
        (first,), plan = store.starts().values(), store.plan
        for name in ("more", "idle"):
            told = {"started": f"at {name}", "command": f"envlight {name}", "commit": f"by {name}"}
            store.begin({**first, **told}, store.selection.about, plan)
            if name == "more":
                alter(store, store.results(IMAGE)[0].key, start=store.selection.starts[-1])
    text = " ".join(Page(write_html(copied, images=False, lights=False)).text.split())
    assert f"started{first['started']} commandenvlight more commit" in text
    assert f"commit{first['commit'] or 'unknown'}, by more processor" in text
    assert "starts2 versions" in text
    assert "envlight idle" not in text and "by idle" not in text


def test_case_pages_hold_means_over_seeds(run, pages):
    rows = pd.read_csv(run / "measurements.csv")
    for name in ("black", "sun"):
        page = pages[f"cases/{slug(f'three-boxes_{name}')}.html"]
        (_, lines), *_ = page.tables
        means = rows[rows["environment"] == name].groupby("sampler")
        headings, *lines = lines
        assert len(lines) == 3
        for metric in metrics():
            column = headings.index(metric.label)
            for cells in lines:
                mean = means.get_group(cells[0])[metric.name].mean()
                assert cells[column].rstrip("*") == f"{mean:.{metric.digits}f}"
        lead = headings.index(leading_metric().label)
        errors = [float(cells[lead].rstrip("*")) for cells in lines]
        assert errors == sorted(errors)


def test_ratios_leave_out_maps_without_error(run):
    """Under the black map all images equal the reference: no ratio exists there."""
    (found,) = results(load_run(run).rows)
    for ranking in found.rankings:
        assert ranking.maps == 5
        assert ranking.ratio_maps == 4
        errors = ranking.resolved.drop(index="black").to_numpy()
        base = errors[:, [ranking.samplers.index(BASELINE)]]
        expected = np.exp(np.log(errors / base).mean(axis=0))
        np.testing.assert_allclose(ranking.ratio.ratio, expected, rtol=1e-12)
        assert (ranking.ratio.low <= ranking.ratio.ratio).all()
        assert (ranking.ratio.ratio <= ranking.ratio.high).all()


def test_csv_keeps_all_digits_whatever_was_imported(tmp_path):
    """colour-science makes NumPy print 12 digits when it is imported."""
    values = [0.1, 1 / 3, math.pi, 5e-324, 1e300 / 7]
    with np.printoptions(legacy="1.13"):
        write_csv(tmp_path / "table.csv", pd.DataFrame({"x": values}))
    lines = (tmp_path / "table.csv").read_text(encoding="utf-8").splitlines()
    assert lines == ["x", *map(repr, values)]


def test_plots_are_the_same_bytes_whatever_was_imported(tmp_path):
    rows = pd.DataFrame({"x": [1.0, 1 / 3], "y": [0.1, math.pi], "who": ["a", "a"]})

    def drawn() -> list[bytes]:
        save_plot(
            tmp_path, "plot", lambda: line_plot(rows, "x", "y", "who", ("x", "y"), log_y=False)
        )
        return [file.read_bytes() for file in sorted(tmp_path.iterdir())]

    before = drawn()
    with np.printoptions(legacy="1.13"):
        assert drawn() == before
    # Something is clipped, so that there is a name that could differ.
    assert any(b"clip-path" in content for content in before)


def test_a_second_report_gives_the_same_bytes(run, maps_folder, suffixes_of_plots, monkeypatch):
    monkeypatch.setattr(figures, "SUFFIXES", suffixes_of_plots)

    def contents() -> dict[str, bytes]:
        files = (path for path in (run / "report").rglob("*") if path.is_file())
        return {str(path): path.read_bytes() for path in files}

    before = contents()
    write_html(run, maps=(maps_folder,))
    after = contents()
    assert set(before) == set(after)
    assert [name for name in before if before[name] != after[name]] == []


def test_an_incomplete_run_says_so_on_every_page(copied):
    with Store.writing(copied) as store:
        sun = (one for one in store.results(IMAGE) if one.result["environment"] == "sun")
        forget(store, next(sun).key)
    write_html(copied, images=False, lights=False)
    for path in (copied / "report").rglob("*.html"):
        page = Page(path)
        assert "Incomplete: 24 of 25 measurements are finished" in page.text, path
    text = Page(copied / "report/index.html").text
    assert "all is over the 4 maps on which every sampler is finished" in text


def test_stale_pages_and_pictures_go(copied):
    write_html(copied, lights=False)
    report = copied / "report"
    name = "0123456789abcdef"
    stale = [f"cases/{name}.html", f"pictures/{name}.webp", f"errors/{name}.png"]
    mine = ["cases/mine.html", "pictures/mine.webp", "errors/mine.png"]
    for path in (*stale, *mine):
        (report / path).write_bytes(b"old")
    with (report / LIST).open("a", encoding="utf-8") as pages:
        pages.write(f"{stale[0]}\n../run.json\n")
    write_html(copied, lights=False)
    assert [path for path in stale if (report / path).exists()] == []
    assert (copied / "run.json").is_file()
    for path in mine:
        (report / path).unlink()
    # Of a reference there is a thumbnail, too; it is as wide as the image here, but has its name.
    assert len(list((report / "pictures").iterdir())) == 5 * (2 + 3)
    assert len(list((report / "errors").iterdir())) == 5 * 3 * len(mapped_metrics())


def test_a_run_without_images_still_has_its_numbers(copied):
    shutil.rmtree(copied / "images")
    shutil.rmtree(copied / "references")
    write_html(copied, lights=False)
    page = Page(copied / "report/cases" / f"{slug('three-boxes_sun')}.html")
    assert "kept no images" in page.text
    assert len(page.tables[0][1]) == 4


def test_an_empty_folder_is_refused(tmp_path):
    with pytest.raises(EnvlightError, match="no results there"):
        write_html(tmp_path)


def test_previews_decode_to_srgb():
    """The page's table undoes `coded`: half a code is 1 / 510 of the logarithm's range."""
    linear = np.linspace(0.0, 1.0, 101, dtype=np.float32)
    code = coded(linear) / 255.0
    table = decoding_table(256)
    shown = np.interp(code, np.linspace(0.0, 1.0, 256), table)
    curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    # A half code is a relative step of log(257) / 510 = 1.1 % of 1 / 16 + x in x. The sRGB curve's
    # slope is at most 12.92, at x = 0, so the error there is at most 12.92 · 0.011 / 16 = 0.009,
    # and 1.055 / 2.4 · 0.011 · (1 + 1 / 16) = 0.005 at white; 0.0025 more for table and rounding.
    assert np.abs(shown - curve).max() < 0.0115
    assert coded(np.float32([WHITEST, 2 * WHITEST])).tolist() == [255, 255]
    assert math.isclose(math.log1p(STEEPNESS * WHITEST), math.log(257.0))


def test_reducing_keeps_the_mean():
    image = np.random.default_rng(0).random((60, 80, 3), np.float32)
    small = reduced(image, 20)
    assert small.shape == (15, 20, 3)
    # A box filter over whole 4 × 4 cells: the mean differs by float32 rounding of sums alone.
    np.testing.assert_allclose(small.mean((0, 1)), image.mean((0, 1)), rtol=1e-5)
    assert reduced(image, 80) is image


def test_error_maps_show_the_stored_error(run):
    """Their mean level, read back through the colours, is the stored value of the first seed."""
    import matplotlib as mpl

    table = mpl.colormaps["magma"](np.linspace(0.0, 1.0, 32), bytes=True)[:, :3].astype(int)
    rows = pd.read_csv(run / "measurements.csv")
    page = Page(run / "report/cases" / f"{slug('three-boxes_noise')}.html")
    assert mapped_metrics()
    for method in page.data["budgets"][0]["methods"]:
        first = rows[(rows["environment"] == "noise") & (rows["sampler"] == method["name"])]
        for name, file in method["errors"].items():
            path = run / "report/cases" / unquote(file)
            pixels = np.asarray(Image.open(path).convert("RGB")).reshape(-1, 3).astype(int)
            distance = np.abs(pixels[:, None] - table[None]).sum(axis=2)
            assert distance.min(axis=1).max() == 0
            mean = distance.argmin(axis=1).mean() / 31
            stored = first[first["seed"] == 0][name].item()
            # Rounded to 32 levels: a pixel is at most half a level off.
            assert mean == pytest.approx(stored, abs=0.5 / 31)


def test_small_images_are_shown_without_loss(run):
    """A preview's pixels are the codes of the stored image, one by one."""
    rows = pd.read_csv(run / "measurements.csv")
    page = Page(run / "report/cases" / f"{slug('three-boxes_sun')}.html")
    data = load_run(run)
    row = rows[(rows["environment"] == "sun") & (rows["sampler"] == "mis")].iloc[0]
    image = read_radiance(data.image(row["key"], row["scene"], row["environment"]))
    (method,) = (m for m in page.data["budgets"][0]["methods"] if m["name"] == "mis")
    shown = np.asarray(Image.open(run / "report/cases" / unquote(method["image"])).convert("RGB"))
    exposed = (image * np.float64(row["exposure"])).astype(np.float32)
    assert (page.data["width"], page.data["height"]) == (24, 18)
    assert np.array_equal(shown, coded(exposed))


def test_large_images_show_no_blocks(tmp_path):
    """Steps across the edges of blocks of 8, and within them, are changed alike by compression."""
    rng = np.random.default_rng(0)
    y, x = np.mgrid[:600, :800] / 100.0
    smooth = 0.5 + 0.3 * np.sin(x + 0.3 * y) * np.cos(0.7 * y)
    noisy = smooth * rng.lognormal(0.0, 0.3, smooth.shape)
    image = np.where(x > 4.0, noisy, smooth).astype(np.float32)[..., None] * np.float32(
        [1, 0.8, 0.6]
    )
    code = coded(image)
    assert code.shape[0] * code.shape[1] > LOSSLESS_PIXELS
    _save(tmp_path / "picture.avif", code, COMPRESSED)
    shown = np.asarray(Image.open(tmp_path / "picture.avif").convert("RGB")).astype(float)
    error = shown - code
    # An eighth of a stop is some 4 codes, which is where a step begins to be seen.
    assert np.sqrt((error**2).mean()) < 4.0
    # Rounding to luma and chroma and back is some 1 code by itself.
    assert np.sqrt((error[:, :390] ** 2).mean()) < 1.5
    for half in (error[:, :400], error[:, 400:]):
        steps = np.abs(np.diff(half, axis=1)).mean(axis=(0, 2))
        edge = np.arange(len(steps)) % 8 == 7
        # 50 edges of 600 pixels each; JPEG of the same size has 1.5 times the step there.
        assert steps[edge].mean() < 1.2 * steps[~edge].mean()


def test_docstrings_become_paragraphs_and_lists():
    parts = parts_of(
        """Idea: `x` < y.

        Second
        paragraph.

        Parameters
            first, second : one
                two
            third : "a" (default)

            code()
        """
    )
    assert [part.kind for part in parts] == ["text", "text", "list", "code"]
    assert parts[0].text == "Idea: <code>x</code> &lt; y."
    assert parts[1].text == "Second paragraph."
    assert parts[2].text == "Parameters"
    assert parts[2].items == (("first, second", "one two"), ("third", "&#34;a&#34; (default)"))
    assert parts[3].text == "code()"


def test_names_are_marked_and_powers_are_not():
    assert inline("**ours** in `2 s`, **mis-compensated**.") == (
        "<strong>ours</strong> in <code>2 s</code>, <strong>mis-compensated</strong>."
    )
    assert inline("x**2 + y**2 < 1") == "x**2 + y**2 &lt; 1"


def test_sampler_pages_tell_what_the_module_says(pages):
    text = " ".join(pages["samplers/median-cut.html"].text.split())
    assert "Debevec" in text
    assert "O(n log(W + H))" in text


def test_different_names_have_different_files():
    names = ["a b", "a_b", "a=b", "a/b", "..", "ours[upsampling=4]", "ours"]
    assert len({slug(name) for name in names}) == len(names)
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+", slug(name)) for name in names)
    assert slug("median-cut") == "median-cut"
    assert quoted("a b/c=#.exr") == "a%20b/c%3D%23.exr"
