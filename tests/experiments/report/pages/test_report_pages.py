"""The pages of a run: every link leads to a file, numbers agree with the CSV, nothing is stale."""

import math
import re
import shutil
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from experiments import progress
from experiments.report import figures
from experiments.report.figures import line_plot, save_plot
from experiments.report.pages import pictures, write
from experiments.report.pages.cases import Case
from experiments.report.pages.markdown import as_html, docstring_html, quoted, slug
from experiments.report.pages.write import MARK, write_report_pages
from experiments.report.rankings import BASELINE, results, verdict
from experiments.report.style import label_of
from experiments.run.loaded_run import Run
from experiments.run.store import IMAGE, Store
from metrics.registry import leading_metric, metrics, ranked_metrics
from samplers.files.image_file import read_radiance
from tests.experiments.report.pages.parsed_page import Page
from tests.experiments.stored import forget

REPORT = f"experiments/{slug('a run')}.html"


def case(name: str, run: str = "a run") -> str:
    return f"runs/{run}/cases/{slug(f'three-boxes_{name}')}.html"


@pytest.fixture(scope="module")
def run(finished, maps_folder, suffixes_of_plots, tmp_path_factory) -> Path:
    """A complete run with its report, plots of all kinds among it."""
    folder = shutil.copytree(finished, tmp_path_factory.mktemp("reported") / "a run")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures, "SUFFIXES", suffixes_of_plots)
        assert write_report_pages(folder, maps=(maps_folder,)) == folder / "report/index.html"
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
    expected = {f"{name}.html" for name in ("index", "samplers", "maps", "downloads")}
    expected |= {REPORT, *(case(name) for name in maps)}
    expected |= {f"maps/{name}.html" for name in maps}
    expected |= {f"samplers/{name}.html" for name in samplers}
    assert set(pages) == expected


def test_every_page_is_reached_from_the_first(run, pages):
    report = (run / "report").resolve()
    known, left = {"index.html"}, ["index.html"]
    while left:
        here = report / left.pop()
        for link in local_links(pages[here.relative_to(report).as_posix()]):
            target = (here.parent / unquote(urlsplit(link).path)).resolve()
            name = target.relative_to(run.resolve()).as_posix().removeprefix("report/")
            if name in pages and name not in known:
                known.add(name)
                left.append(name)
    assert known == set(pages)


def test_the_report_and_its_tables_are_those_of_the_run(run, pages):
    """The page prints the numbers of the CSV and the sentences of the report."""
    for name in ("summary.csv", "measurements.csv", "summary.tex", "report.md"):
        assert (run / "report/files/a run" / name).read_bytes() == (run / name).read_bytes()
    table = pd.read_csv(run / "summary.csv")
    table = table.set_index(table["sampler"].map(label_of))
    _, (headings, *rows) = pages[REPORT].tables[0]
    assert len(rows) == len(table) == 3
    for place, metric in enumerate(ranked_metrics()):
        first = headings.index(metric.label)
        rank = [k for k, text in enumerate(headings) if text == "rank"][place]
        ratio = [k for k, text in enumerate(headings) if text == f"× {label_of(BASELINE)}"][place]
        for cells in rows:
            row = table.loc[cells[0]]
            assert cells[first] == f"{row[metric.name]:.4f}"
            assert cells[rank] == f"{row[f'{metric.name}_rank']:.2f}"
            middle, low, high = (row[f"{metric.name}_{part}"] for part in ("ratio", "low", "high"))
            assert cells[ratio].split() == f"{middle:.2f} [{low:.2f}, {high:.2f}]".split()
    (result,) = results(Run.load(run).rows)
    for name, told in (("index.html", result.rankings[:1]), (REPORT, result.rankings)):
        text = " ".join(pages[name].text.split())
        assert all(verdict(ranking) in text for ranking in told), name


def test_an_incomplete_run_says_so_on_every_page(copied):
    with Store.writing(copied) as store:
        sun = (one for one in store.results(IMAGE) if one.result["environment"] == "sun")
        forget(store, next(sun).key)
    write_report_pages(copied, images=False)
    for path in (copied / "report").rglob("*.html"):
        assert "Incomplete: 24 of 25 measurements are finished" in Page(path).text, path
    assert "over 4 maps" in Page(copied / f"report/experiments/{copied.name}.html").text


def test_stale_pages_and_pictures_go(copied):
    write_report_pages(copied)
    report, place = copied / "report", f"runs/{copied.name}"
    stale = [f"{place}/cases/old.html", f"{place}/pictures/old.webp", "maps/old.html"]
    mine = ["mine.html", f"{place}/pictures/mine.webp"]
    for path in (*stale, *mine):
        (report / path).write_bytes(b"old")
    with (report / MARK).open("a", encoding="utf-8") as listed:
        listed.write("\n".join([*stale, "../run.json", ""]))
    made = {file: file.stat().st_ino for file in (report / place / "errors").iterdir()}
    write_report_pages(copied)
    assert [path for path in stale if (report / path).exists()] == []
    assert all((report / path).is_file() for path in mine) and (copied / "run.json").is_file()
    # Pictures are not made again; of a reference there is a thumbnail, too.
    assert {file: file.stat().st_ino for file in (report / place / "errors").iterdir()} == made
    assert len(list((report / place / "pictures").iterdir())) == 5 * (2 + 3) + 1
    assert len(made) == 5 * 3 * len(pictures.mapped_metrics())


def test_processes_make_the_pages_that_one_makes(copied, maps_folder, monkeypatch, capsys):
    def contents() -> dict[str, bytes]:
        files = (path for path in (copied / "report").rglob("*") if path.is_file())
        return {str(path): path.read_bytes() for path in files}

    write_report_pages(copied, maps=(maps_folder,))
    alone = contents()
    shutil.rmtree(copied / "report")
    monkeypatch.setattr(write, "WORKERS", 2)
    for name in ("SOON_SECONDS", "SAID_SECONDS"):
        monkeypatch.setattr(progress, name, 0.01)
    write_report_pages(copied, maps=(maps_folder,))
    assert contents() == alone
    assert "envlight: pages: writing them, " in capsys.readouterr().err


def test_case_pages_hold_means_over_seeds(run, pages):
    rows = pd.read_csv(run / "measurements.csv")
    for name in ("black", "sun"):
        page = pages[case(name)]
        (_, lines), *_ = page.tables
        own = rows[rows["environment"] == name]
        means = own.groupby(own["sampler"].map(label_of))
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


def test_a_run_without_images_still_has_its_numbers(copied):
    shutil.rmtree(copied / "images")
    shutil.rmtree(copied / "references")
    write_report_pages(copied)
    page = Page(copied / "report" / case("sun", copied.name))
    assert "kept no images" in page.text
    assert len(page.tables[0][1]) == 4


def test_previews_decode_to_srgb():
    """The page's table undoes `coded`: half a code is 1 / 510 of the logarithm's range."""
    linear = np.linspace(0.0, 1.0, 101, dtype=np.float32)
    code = pictures.coded(linear) / 255.0
    table = pictures.decoding_table(256)
    shown = np.interp(code, np.linspace(0.0, 1.0, 256), table)
    curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    # A half code is a relative step of log(257) / 510 = 1.1 % of 1 / 16 + x in x. The sRGB curve's
    # slope is at most 12.92, at x = 0, so the error there is at most 12.92 · 0.011 / 16 = 0.009,
    # and 1.055 / 2.4 · 0.011 · (1 + 1 / 16) = 0.005 at white; 0.0025 more for table and rounding.
    assert np.abs(shown - curve).max() < 0.0115
    white = pictures.WHITEST
    assert pictures.coded(np.float32([white, 2 * white])).tolist() == [255, 255]
    assert math.isclose(math.log1p(pictures.STEEPNESS * white), math.log(257.0))


def test_error_maps_show_the_stored_error(run):
    """Their mean level, read back through the colours, is the stored value of the first seed."""
    import matplotlib as mpl

    table = mpl.colormaps["magma"](np.linspace(0.0, 1.0, 32), bytes=True)[:, :3].astype(int)
    rows = pd.read_csv(run / "measurements.csv")
    page = Page(run / "report" / case("noise"))
    assert pictures.mapped_metrics()
    for method in page.data["budgets"][0]["methods"]:
        first = rows[(rows["environment"] == "noise") & (rows["sampler"] == method["name"])]
        for name, file in method["errors"].items():
            path = run / "report/runs/a run/cases" / unquote(file)
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
    page = Page(run / "report" / case("sun"))
    row = rows[(rows["environment"] == "sun") & (rows["sampler"] == "mis")].iloc[0]
    image = read_radiance(Run.load(run).kept_image(row))
    (method,) = (m for m in page.data["budgets"][0]["methods"] if m["name"] == "mis")
    shown = np.asarray(
        Image.open(run / "report/runs/a run/cases" / unquote(method["image"])).convert("RGB")
    )
    exposed = (image * np.float64(row["exposure"])).astype(np.float32)
    assert (page.data["width"], page.data["height"]) == (24, 18)
    assert np.array_equal(shown, pictures.coded(exposed))


def test_large_images_show_no_blocks(tmp_path):
    """Steps across the edges of blocks of 8, and within them, are changed alike by compression."""
    rng = np.random.default_rng(0)
    y, x = np.mgrid[:600, :800] / 100.0
    smooth = 0.5 + 0.3 * np.sin(x + 0.3 * y) * np.cos(0.7 * y)
    noisy = smooth * rng.lognormal(0.0, 0.3, smooth.shape)
    image = np.where(x > 4.0, noisy, smooth).astype(np.float32)[..., None] * np.float32(
        [1, 0.8, 0.6]
    )
    code = pictures.coded(image)
    assert code.shape[0] * code.shape[1] > pictures.LOSSLESS_PIXELS
    pictures.save(code, pictures.COMPRESSED, tmp_path / "picture.avif")
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


def test_a_case_begins_with_the_budget_of_most_measurements(run):
    rows = Run.load(run).rows
    rows = pd.concat([rows.assign(budget="lights=64"), rows[:1].assign(budget="lights=1")])
    assert list(Case(rows, (1, 1), {}).numbers) == ["lights=64", "lights=1"]


def test_different_names_have_different_files():
    names = ["a b", "a_b", "a=b", "a/b", "..", "ours[upsampling=4]", "ours"]
    assert len({slug(name) for name in names}) == len(names)
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+", slug(name)) for name in names)
    assert slug("median-cut") == "median-cut"
    assert quoted("a b/c=#.exr") == "a%20b/c%3D%23.exr"


def test_docstrings_become_paragraphs_lists_and_code():
    shown = docstring_html(
        """Idea: `x` < y, x**2 + y**2.

Parameters
    first, second : one
        two
    third : "a" (default)

Cost:

    code(<b>)
"""
    )
    assert "<p>Idea: <code>x</code> &lt; y, x**2 + y**2.</p>" in shown
    assert "<li><code>first, second</code>: one\ntwo</li>" in shown and shown.count("<li>") == 2
    assert "<code>code(&lt;b&gt;)" in shown


def test_markdown_keeps_what_a_report_has():
    """Headings of one name have places of their own; a picture that is not there is left out."""
    text = (
        "# T\n\n## A\n\n**b** `c` <i>\n\n## A\n\n![a `b`](x.svg)\n\n*a `b`*\n\n![n](no.svg)\n\n*n*"
    )
    shown = as_html(text, "files/", {"x.svg", "x.pdf"})
    assert ">T<" not in shown.html
    assert shown.headings == [("A", "A"), ("A-2", "A")]
    assert "<p><strong>b</strong> <code>c</code> &lt;i&gt;</p>" in shown.html
    assert shown.html.count("<figure") == 1 and shown.html.count("a <code>b</code>") == 1
    assert (
        'alt="a b"' in shown.html and 'href="files/x.pdf"' in shown.html and ">T<" not in shown.html
    )
    table = "| a | b |\n|:--|--:|\n| x\\|y | 1.00 [0.50, 2.00] |\n"
    assert '<td data-label="b" class="two">1.00\n[0.50, 2.00]</td>' in as_html(table).html
    assert '<th scope="row" class="name">x|y</th>' in as_html(table).html
