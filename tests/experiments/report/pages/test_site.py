"""The site's pages: all that they link to is there, and what they say is what the rows say."""

import html
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pandas as pd
import pytest
from PIL import Image

from experiments.report.pages import write
from experiments.report.pages.experiment_pages import context, front
from experiments.report.pages.markdown import slug
from experiments.report.pages.reported import Reported, at_hand, ranking_runs
from experiments.report.pages.reported import published as published_in
from experiments.report.pages.subjects import _measured, _source
from experiments.report.publish import publish, tabulate
from experiments.run.executors import SerialExecutor
from experiments.run.loaded_run import read_run, write_run
from samplers import EnvlightError
from tests.experiments.report.pages.parsed_page import Page
from tests.experiments.report.pages.site_rows import HARD, TINY


@pytest.fixture(scope="module")
def pages(site) -> dict[Path, Page]:
    return {file: Page(file) for file in site.rglob("*.html")}


def test_every_link_leads_to_something_in_the_folder(site, pages):
    assert len(pages) > 15
    for page, found in pages.items():
        assert len(set(found.ids)) == len(found.ids), (page, sorted(found.ids))
        for link in found.links:
            parts = urlsplit(link)
            if link == "data:,":
                continue
            if "/maps/" in page.as_posix() and parts.netloc == "polyhaven.com":
                continue  # where a reader may go; nothing is loaded from there
            assert not parts.scheme and not parts.netloc, (page, link)
            target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            assert target.is_relative_to(site.resolve()) and target.is_file(), (page, link)
            if parts.fragment and "=" not in parts.fragment:
                assert unquote(parts.fragment) in pages[target].ids, (page, link)


def test_nothing_is_loaded_from_elsewhere(site):
    files = [*site.rglob("*.html"), *site.glob("assets/*")]
    text = "".join(file.read_text(encoding="utf-8") for file in files)
    text = text.replace('<a href="https://polyhaven.com/a/', "")  # leads there, and loads nothing
    assert not re.findall(r"""(?:src|href|url|import|fetch)\W{1,3}(?:https?:)?//""", text)
    assert "fetch(" not in text and "XMLHttpRequest" not in text


def test_every_run_map_and_sampler_has_a_page(site):
    for folder, names in {
        "experiments": [TINY], "samplers": ["mis", "median-cut", "uniform", "ours"],
        "maps": ["red_wall", "sun", "noise"],
    }.items():  # fmt: skip
        for name in names:
            assert (site / folder / f"{name}.html").is_file()
    assert not (site / "samplers/mis_numbers_independent.html").exists()
    text = (site / "samplers/mis.html").read_text(encoding="utf-8")
    assert "[numbers=independent]</td>" in text and "MIS (Veach 1995)" in text
    assert "multiple importance sampling" in text.lower()


def test_the_front_page_opens_at_equal_time_where_a_run_gives_it(published, tmp_path):
    rows, record = read_run(published / "results" / HARD)
    parts = [rows.assign(budget=budget) for budget in ("lights=16", "seconds=4", "seconds=0.5")]
    facts = {name: value for name, value in record.items() if name != "types"}
    (tmp_path / "timed").mkdir()
    write_run(tmp_path / "timed", pd.concat(parts), facts | {"budgets": ["seconds=4"]})
    (one,) = published_in(tmp_path)
    assert front([one], [one])["catalogue"]["budget"] == "seconds=0.5"
    (plain,) = (one for one in published_in(published / "results") if one.name == HARD)
    assert front([plain], [plain])["catalogue"]["budget"] == "lights=16"
    some = one.run.rows[one.run.rows["environment"] > "n"]
    few = Reported(replace(one.run, rows=pd.concat([some] * 9)), one.experiment)
    assert ranking_runs([plain, few, one]) == [one, few, plain]


def test_maps_have_their_place_among_all_and_their_source():
    features = pd.DataFrame({"map_contrast": [1.0, 2.0, 2.0, 9.0]}, list("abcd"))
    told = [_measured(features, name)[0] for name in "abd"]
    assert [line["value"] for line in told] == ["1 ×", "2 ×", "9 ×"]
    # Half of those that are equal lie below: 0.5 / 4, 2 / 4 and 3.5 / 4.
    assert [line["percentile of 4 maps"] for line in told] == ["12", "50", "88"]
    assert _source("dikhololo_night_2k")[1].endswith("polyhaven.com/a/dikhololo_night")
    assert _source("my own map") == ("", "") and "Made from code" in _source("noon-desert")[0]


def test_the_record_names_every_processor_that_measured(published, tmp_path):
    rows, record = read_run(published / "results" / HARD)
    first = rows["sampler"] == rows["sampler"].iloc[0]
    kinds = first.map({True: "one, 2 of 2 threads", False: "two, 1 of 2 threads"})
    facts = {name: value for name, value in record.items() if name != "types"}
    (tmp_path / "both").mkdir()
    write_run(tmp_path / "both", rows.assign(machine=kinds), facts)
    (one,) = published_in(tmp_path)
    assert set(context(one, [], tmp_path)["facts"]["processor"].split("; ")) == {"one", "two"}


def test_images_of_runs_are_compared_where_they_are_given(site, published, tmp_path):
    cases = list((site / "runs" / TINY / "cases").glob("*.html"))
    assert len(cases) == 5
    assert "three-boxes" in (site / "maps/sun.html").read_text(encoding="utf-8")
    without = write.write_site(published / "results", tmp_path / "site").parent
    assert not (without / "runs").exists()
    said = "No images to be compared are kept or given"
    assert said in (without / "maps/sun.html").read_text(encoding="utf-8")
    assert said not in (site / "maps/sun.html").read_text(encoding="utf-8")


def test_published_images_are_compared_without_their_run(published, tmp_path):
    run, results = published / "runs" / TINY, tmp_path / "results"
    publish(run, results / TINY, compare=["sun", "three-boxes_noise"])
    publish(run, results / "other", compare=["constant"])
    names = {file.name for file in (results / TINY / "compared").rglob("*.html")}
    assert names == set() and not list((results / TINY).rglob("*.exr"))
    site = write.write_site(results, tmp_path / "site").parent
    pages = sorted((site / "runs" / TINY / "cases").glob("*.html"))
    assert [page.stem for page in pages] == [slug("three-boxes_noise"), slug("three-boxes_sun")]
    front = {link.partition("#")[0] for link in Page(site / "index.html").links}
    assert {f"runs/{TINY}/cases/{page.name}" for page in pages} <= front
    assert any(link.startswith("runs/other/cases/") for link in front)
    given = write.write_site(results, tmp_path / "given", published / "runs").parent
    own = given / "runs" / TINY / "cases"
    assert len(list(own.glob("*.html"))) == 5  # a run that is there has all of its cases
    for page in pages:
        shown = re.findall(r'<script type="application/json".*?</script>', page.read_text("utf-8"))
        assert shown and shown[0] in (own / page.name).read_text(encoding="utf-8")
        for link in Page(page).links:
            path = "" if link == "data:," else unquote(urlsplit(link).path)
            assert not path or (page.parent / path).is_file(), link
    assert not (site / "files" / TINY / "compared").exists()
    publish(run, results / TINY)
    assert not (results / TINY / "compared").exists()


def test_what_cannot_be_compared_is_refused(published, tmp_path):
    run = published / "runs" / TINY
    with pytest.raises(EnvlightError, match="no case matches 'sum'; did you mean sun"):
        publish(run, tmp_path / "a", compare=["sum"])
    bare = shutil.copytree(run, tmp_path / "bare", ignore=shutil.ignore_patterns("images"))
    with pytest.raises(EnvlightError, match="no images are kept there"):
        publish(bare, tmp_path / "b", compare=["sun"])


def test_maps_that_are_at_hand_are_shown(site):
    for name, there in (("sun", True), ("constant", True), ("my own map", False)):
        page = next((site / "maps").glob(f"{name.replace(' ', '_')}*.html"))
        assert ("The map, exposed" in page.read_text(encoding="utf-8")) == there
    with Image.open(site / "maps/pictures/sun.webp") as picture:
        assert picture.size == (32, 16)


def test_only_as_many_cases_have_pictures_as_there_is_room_for(published, tmp_path, monkeypatch):
    monkeypatch.setattr(write, "TOGETHER", 2)
    one = at_hand(published / "runs" / TINY)

    def cases_in(name: str, room: int) -> tuple[int, int, int]:
        """How many have pictures, how many do not, and what they take."""
        place = tmp_path / name
        place.mkdir()
        pages = write._Pages([one], {TINY: one}, place, tmp_path, write.Wanted())
        made, left = pages._cases_of(one, SerialExecutor(), room)
        return len(made), left, write.size_of(place)

    whole, left, size = cases_in("a", 10**9)
    assert (whole, left) == (5, 0)
    some, left, taken = cases_in("b", size // 2)
    assert 1 <= some < 5 and left == 5 - some and taken <= size // 2
    assert cases_in("c", 10) == (0, 5, 0)


def test_studies_alone_make_a_site_without_a_ranking(published, tmp_path):
    record = json.loads((published / "results" / TINY / "run.json").read_text(encoding="utf-8"))
    facts = {"experiment": "discrepancy", "request": {}, "machine": record["machine"]}
    rows = pd.DataFrame({"pattern": ["a", "b"], "points": [4, 16], "discrepancy": [0.2, 0.1]})
    (tmp_path / "results" / "study").mkdir(parents=True)
    write_run(tmp_path / "results" / "study", rows, facts)
    index = write.write_site(tmp_path / "results", tmp_path / "site")
    text = index.read_text(encoding="utf-8")
    assert "2 measurements in 1 run" in text and "ranking.js" not in text
    assert (tmp_path / "site/experiments/study.html").is_file()
    assert not (tmp_path / "site/cite.html").exists()


def test_what_is_no_site_is_not_replaced(published, site, tmp_path):
    (tmp_path / "thesis.md").write_text("ten years of work")
    with pytest.raises(EnvlightError, match="no site made here"):
        write.write_site(published / "results", tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["thesis.md"]
    with pytest.raises(EnvlightError, match="no published run is there"):
        write.write_site(tmp_path, tmp_path / "site")
    assert not (tmp_path / "site").exists()


def test_a_site_is_replaced_but_for_what_is_not_its_own(published, tmp_path):
    results = tmp_path / "results"
    shutil.copytree(published / "results" / TINY, results / TINY)
    first = write.write_site(results, tmp_path / "site").parent
    before = {file: file.read_bytes() for file in first.rglob("*") if file.is_file()}
    (first / "CNAME").write_text("mine")
    mark = (first / write.MARK).read_text(encoding="utf-8")
    (first / write.MARK).write_text(f"{mark}old.html\n", encoding="utf-8")
    (first / "old.html").write_text("old")
    write.write_site(results, tmp_path / "site")
    after = {file: file.read_bytes() for file in first.rglob("*") if file.is_file()}
    assert after.pop(first / "CNAME") == b"mine" and after == before


def test_a_site_that_cannot_be_written_leaves_the_old_one(published, tmp_path, monkeypatch):
    site = write.write_site(published / "results", tmp_path / "site").parent
    before = {file: file.read_bytes() for file in site.rglob("*") if file.is_file()}
    monkeypatch.setattr(write._Pages, "_write_pages", None)  # fails where it is called
    with pytest.raises(TypeError, match="not callable"):
        write.write_site(published / "results", tmp_path / "site")
    assert {file: file.read_bytes() for file in site.rglob("*") if file.is_file()} == before
    assert [path.name for path in tmp_path.iterdir()] == ["site"]


def test_a_site_is_not_written_over_what_it_is_made_of(published, tmp_path):
    site = write.write_site(published / "results", tmp_path / "site").parent
    for results, maps in ((site / "files", ()), (published / "results", [site / "maps"])):
        with pytest.raises(EnvlightError, match="which this command reads, is there"):
            write.write_site(results, site, maps=maps)


STRANGE = (
    "a|b", "<img src=x onerror=alert(1)>", "[a](javascript:alert(1))", "`<b>` \\<i>", "=1+1\n\n<u>",
    "a\\|b <script>alert(1)</script>",
)  # fmt: skip


def test_names_that_are_markup_stand_in_reports_and_pages_as_they_are(published, tmp_path):
    """A label with | once ended the site; now each name is a cell of its own, on every page."""
    rows, record = read_run(published / "results" / TINY)
    known = sorted(rows["environment"].unique())
    rows["environment"] = rows["environment"].map(dict(zip(known, STRANGE, strict=False)))
    rows["sampler"] = rows["sampler"].replace({"mis": STRANGE[5], "uniform": STRANGE[0]})
    samplers = [{"mis": STRANGE[5], "uniform": STRANGE[0]}.get(n, n) for n in record["samplers"]]
    record["missing"] = {STRANGE[1]: [STRANGE[2]]}
    folder = tmp_path / "results" / "strange"
    folder.mkdir(parents=True)
    write_run(folder, rows, record | {"samplers": samplers})
    tabulate(folder)
    report = (folder / "report.md").read_text(encoding="utf-8")
    bare = re.sub(r"\\.|(?<!`)(`+)(?!`).*?(?<!`)\1(?!`)", "", report)
    assert not re.search(r"<[a-z/]|\]\(\s*javascript", bare)
    widths = [len(re.findall(r"(?<!\\)(?:\\\\)*\|", line)) for line in report.splitlines()]
    ruled = [k for k, line in enumerate(report.splitlines()) if line.startswith("|:")]
    assert ruled and all(widths[k - 1] == widths[k] == widths[k + 1] for k in ruled)
    site = write.write_site(tmp_path / "results", tmp_path / "site").parent
    page = html.unescape((site / "experiments/strange.html").read_text(encoding="utf-8"))
    assert f">{STRANGE[0]}<" in page and f">{STRANGE[5]}<" in page
    for file in site.rglob("*.html"):
        text = file.read_text(encoding="utf-8")
        assert not re.search(r"<(img src=x|i>|u>|script>alert)|\"javascript:", text), file


def test_a_site_that_is_too_large_is_refused(published, tmp_path, monkeypatch):
    monkeypatch.setattr(write, "MOST_BYTES", 10_000)
    with pytest.raises(EnvlightError, match="publish fewer runs"):
        write.write_site(published / "results", tmp_path / "site")
