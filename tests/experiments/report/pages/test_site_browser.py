"""The site in a real browser: its ranking is that of the reports, filters, sorting, keyboard."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from experiments.report.pages.ranking import script
from experiments.report.pages.reported import Reported, all_leagues, all_looks
from experiments.report.pages.reported import published as published_in
from experiments.report.rankings import Ranking, results, verdict
from experiments.report.style import label_of
from experiments.report.summary import MOST_RANKED
from experiments.run.loaded_run import Run
from experiments.run.registry import find_experiment
from tests.experiments.report.pages.site_rows import HARD, MAPS, TINY

CLOSE = 1e-9
"""Sums over a few maps in another order, exponentials and 64-bit logarithms: a few units of 1e-16
times the number of terms; bootstrap means are sums of less than a hundred."""


@pytest.fixture
def page(browser, site) -> Iterator:
    """A page of 1400 pixels; at the end there was no error and no request left the folder."""
    opened = browser.new_page(viewport={"width": 1400, "height": 1000})
    said, asked = [], []
    opened.on("console", lambda message: said.append(f"{message.type}: {message.text}"))
    opened.on("pageerror", lambda error: said.append(str(error)))
    opened.on("request", lambda request: asked.append(request.url))
    yield opened
    opened.close()
    assert said == []
    outside = [url for url in asked if not url.startswith((site.as_uri(), "data:"))]
    assert asked and outside == []


def ready(page, words: str = "") -> None:
    """Wait until the ranking shows what is chosen."""
    page.wait_for_selector(f"#ranking[data-ready*={words!r}]" if words else "#ranking[data-ready]")


def shown(page) -> list[list[str]]:
    """The cells of the ranking as texts."""
    return page.eval_on_selector_all(
        "[data-part=rows] tr",
        "rows => rows.map(row => [...row.cells].map(c => c.innerText.trim()))",
    )


def ranking_in(page, budget: str, metric: str, chosen: str = "undefined", to: str = "") -> dict:
    """What the page's statistics say."""
    return page.evaluate(
        f"""([run, budget, metric, to]) => {{
          const data = envlight.runs.get(run);
          const chosen = {chosen};
          return envlight.ranking(data, budget, metric, chosen, to);
        }}""",
        [HARD, budget, metric, to],
    )


def assert_same(found: dict, ours: Ranking, whole: bool = True) -> None:
    """The page's ranking and that of the reports; intervals and tests where it is of all rows."""
    lines = found["lines"]
    assert tuple(found["samplers"]) == ours.samplers
    assert (found["maps"], found["cases"]) == (ours.maps, ours.cases)
    assert found["baseline"] == ours.baseline
    base = ours.samplers.index(ours.baseline)

    def column(name: str) -> list:
        return [line[name] for line in lines]

    np.testing.assert_allclose(column("error"), ours.per_map.mean(), rtol=CLOSE)
    np.testing.assert_allclose(column("rank"), ours.ranks.mean(axis=0), rtol=CLOSE)
    assert column("firsts") == list(ours.firsts)
    first = ours.ranks == 1.0
    assert column("shared") == list((first & (first.sum(axis=1) > 1)[:, None]).sum(axis=0))
    assert ours.ratio is not None
    np.testing.assert_allclose(column("ratio"), ours.ratio.ratio, rtol=CLOSE)
    if whole:
        assert column("alike") == [False, *ours.like_first[1:]]
        for name in ("low", "high"):
            np.testing.assert_allclose(column(name), getattr(ours.ratio, name), rtol=CLOSE)
        np.testing.assert_allclose(column("p"), ours.pairs.p_value[base], rtol=CLOSE)
    else:
        assert not any(column("alike"))
        assert np.isnan([column(name) for name in ("low", "high", "p")]).all()
    pairs = ours.pairs
    for name, counts in (("smaller", pairs.wins), ("equal", pairs.ties), ("larger", pairs.losses)):
        assert column(name) == list(counts[:, base])


@pytest.mark.parametrize(("budget", "metric"), [("lights=16", "rmse"), ("rays=4", "flip")])
def test_statistics_of_the_page_are_those_of_the_reports(page, site, published, budget, metric):
    page.goto((site / "index.html").as_uri())
    ready(page)
    one = next(one for one in published_in(published / "results") if one.name == HARD)
    assert_same(ranking_in(page, budget, metric), one.at(budget).by(metric))
    chosen = """(() => {
      const all = envlight.everything(data);
      const without = (name) => name.startsWith("n") || name === "red_wall";
      data.maps.forEach((name, k) => { all.maps[k] = !without(name); });
      data.samplers.forEach((name, k) => { all.samplers[k] = name !== "ours"; });
      all.scenes[0] = false;
      return all;
    })()"""
    rows = one.run.at(budget)
    kept = [name for name in MAPS if not name.startswith("n") and name != "red_wall"]
    rows = rows[rows["environment"].isin(kept) & (rows["sampler"] != "ours")]
    rows = rows[rows["scene"] != sorted(rows["scene"].unique())[0]]
    (few,) = results(rows)
    assert_same(ranking_in(page, budget, metric, chosen), few.by(metric), whole=False)


def test_published_rows_come_out_as_their_tables(page, site):
    """Rows that this project has published: the fewest rows of the most samplers."""
    records = {
        file.parent: json.loads(file.read_text(encoding="utf-8"))
        for file in (Path(__file__).parents[4] / "results").rglob("run.json")
    }
    grids = {place: record for place, record in records.items() if "planned" in record}
    able = [place for place, one in grids.items() if len(one["samplers"]) <= MOST_RANKED]
    if not able:
        pytest.skip("no run that ranks samplers is published in results/")
    place = min(able, key=lambda place: (-len(grids[place]["samplers"]), grids[place]["planned"]))
    one = Reported(Run.load(place), find_experiment(grids[place]["experiment"]))
    page.goto((site / "index.html").as_uri())
    ready(page)
    page.add_script_tag(content=script(one, all_looks([one]), all_leagues([one])))
    for ranking in one.results[0].rankings:
        said = page.evaluate(
            "([run, ...what]) => envlight.ranking(envlight.runs.get(run), ...what)",
            [one.name, one.results[0].budget, ranking.metric.name],
        )
        assert_same(said, ranking)


def test_the_table_shows_the_ranking_and_filters_change_it(page, site, published):
    page.goto((site / "index.html").as_uri())
    ready(page)
    one = next(one for one in published_in(published / "results") if one.name == HARD)
    ours = one.at("lights=16").by("flip")
    before = shown(page)
    assert [line[1].split("\n")[0] for line in before] == list(map(label_of, ours.samplers))
    # So few maps separate nobody: no name is in bold, and the verdict says so.
    assert all(ours.like_first) and page.inner_text("[data-part=leader]") == ""
    assert page.inner_text("[data-part=over]") == verdict(ours)
    assert page.locator("#ranking tr.first").count() == 0
    page.click("[data-part=classes] button[data-name=night]")
    assert "over 2 maps" in page.inner_text("[data-part=over]")
    assert page.evaluate("document.activeElement.dataset.name") == "night"
    assert shown(page) != before
    address = page.url
    assert "class=night" in address
    page.click("text=Choose samplers, maps and scenes")
    page.uncheck("[data-part=samplers] input[value=ours]")
    assert label_of("ours") not in [line[1].split("\n")[0] for line in shown(page)]
    page.click("[data-part=reset]")
    assert shown(page) == before
    page.goto("about:blank#")
    page.goto(address)
    ready(page)
    assert "over 2 maps" in page.inner_text("[data-part=over]")


def test_another_run_metric_and_budget_can_be_chosen(page, site):
    page.goto((site / "index.html").as_uri())
    ready(page)
    page.check("input[value=rmse]")
    ready(page, "rmse")
    page.select_option("[data-part=budget]", "rays=4")
    ready(page, "rays=4 rmse")
    page.select_option("[data-part=to]", "mis")
    assert page.inner_text("th.axis [data-part=against]") == label_of("mis")
    mis = next(line for line in shown(page) if line[1].split("\n")[0] == label_of("mis"))
    assert mis[9] == "1.00 [1.00, 1.00]" and mis[10] == ""
    page.select_option("[data-part=budget]", "lights=4")
    ready(page, f"{TINY} lights=4")
    assert len(shown(page)) == 3


def test_the_ranking_is_sorted_by_its_headings(page, site):
    page.goto((site / "index.html").as_uri())
    ready(page)
    heading = page.locator("#ranking th", has_text="mean rank").locator("button")
    heading.click()
    heading.click()
    ranks = [float(line[3].split()[0]) for line in shown(page)]
    assert ranks == sorted(ranks, reverse=True)
    assert heading.locator("..").get_attribute("aria-sort") == "descending"
    page.locator("#ranking th", has_text="sampler").locator("button").first.click()
    names = [line[1].split("\n")[0] for line in shown(page)]
    assert names == sorted(names, key=str.lower)


def test_everything_can_be_reached_and_used_by_keyboard(page, site):
    page.goto((site / "index.html").as_uri())
    ready(page)
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.className") == "skip"
    page.evaluate(
        """() => { window.reached = []; addEventListener("focusin", (event) =>
          reached.push(event.target.closest("[data-part]")?.dataset.part ?? "")); }"""
    )
    for _ in range(60):
        page.keyboard.press("Tab")
    reached = set(page.evaluate("reached"))
    assert {"size", "budget", "run", "metric", "classes", "to", "reset", "rows", "costs"} <= reached
    page.focus("[data-part=classes] button[data-name=night]")
    page.keyboard.press("Enter")
    assert "over 2 maps" in page.inner_text("[data-part=over]")
    page.focus("input[value=flip]")
    page.keyboard.press("ArrowRight")
    ready(page, "rmse")
    page.focus("#ranking th.place button")
    page.keyboard.press("Space")
    assert page.get_attribute("#ranking th.place", "aria-sort") == "ascending"


def assert_names_beside_points_are_apart(page):
    """The front's samplers are named in the plot, and no name lies over another."""
    boxes = page.evaluate(
        """[...document.querySelectorAll(".costs svg .label")].map((element) => {
          const { x, y, width, height } = element.getBBox();
          return [element.textContent, element.tagName, x, y, x + width, y + height];
        })"""
    )
    fronts = page.locator(".costs g.front").count()
    assert 1 <= fronts == len(boxes)
    for name in boxes:
        for other in boxes:
            apart = (
                name[4] <= other[2]
                or other[4] <= name[2]
                or name[5] <= other[3]
                or other[5] <= name[3]
            )
            assert apart or other is name, f"{name[0]} lies over {other[0]}"


def test_error_against_cost_marks_a_sampler(page, site):
    page.goto((site / "index.html").as_uri())
    ready(page)
    assert page.locator(".costs .spot").count() == 12  # six samplers at two budgets
    assert_names_beside_points_are_apart(page)
    page.click(".costs .legend button[data-sampler=ours]")
    assert page.locator(".costs g.marked").get_attribute("data-sampler") == "ours"
    page.click(".costs .segments button >> text=rays")
    assert "rays" in page.get_attribute(".costs svg", "aria-label")


@pytest.mark.parametrize("width", [1400, 390])
def test_no_page_is_wider_than_the_window(page, site, width):
    page.set_viewport_size({"width": width, "height": 900})
    names = ["index.html", "samplers.html", "maps.html", "experiments.html", "downloads.html",
             "cite.html", f"experiments/{TINY}.html", "samplers/mis.html",
             "maps/sun.html"]  # fmt: skip
    for name in names:
        page.goto((site / name).as_uri())
        if name == "index.html":
            ready(page)
        wide, images = page.evaluate(
            """() => [document.documentElement.scrollWidth,
              [...document.images].filter(i => i.complete && !i.naturalWidth).map(i => i.src)]"""
        )
        assert wide <= width, name
        assert images == [], name
