"""The report in a real browser, without a screen: no error, and the comparison view works."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from experiments.report.pages import write
from experiments.report.pages.markdown import slug
from experiments.report.pages.pictures import STEEPNESS, WHITEST
from experiments.report.pages.reported import Reported
from experiments.report.pages.write import write_report_pages
from experiments.report.style import label_of
from experiments.report.summary import LEAGUES
from experiments.run.loaded_run import Run
from experiments.run.machine import record
from experiments.run.registry import find_experiment
from samplers import sampler_names
from samplers.files.image_file import read_radiance
from samplers.preview import encoded
from tests.experiments.report.ranking_rows import rows_of

SHOWN = ("median-cut", "mis", "uniform")
HELPERS = """
const press = (key, target) => (target || document).dispatchEvent(
  new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));
const look = () => ({
  shown: [...document.querySelectorAll(".stage img.shown")].map((image) => image.alt),
  errors: [...document.querySelectorAll(".stage img.shown")].map((image) => !image.className.includes("coded")),
  drawn: document.querySelector(".plane").style.transform,
  zoom: document.querySelector(".zoom").textContent,
  legend: document.querySelector(".legend").hidden ? "" : document.querySelector(".legend").innerText,
  clip: [...document.querySelectorAll(".stage img.shown")].map((image) => image.style.clipPath).join(""),
  left: document.querySelector(".tag.left").textContent,
  right: document.querySelector(".tag.right").hidden ? "" : document.querySelector(".tag.right").textContent,
  table: document.querySelector("#exposure feFuncR").getAttribute("tableValues").split(" ").map(Number),
  hash: location.hash, help: !document.querySelector(".help").hidden,
});
"""  # noqa: E501


@pytest.fixture(scope="module")
def report(finished, maps_folder, tmp_path_factory) -> Path:
    folder = shutil.copytree(finished, tmp_path_factory.mktemp("browser") / "run")
    return write_report_pages(folder, maps=(maps_folder,)).parent


@pytest.fixture
def browse(browser, report):
    """Open a page, run a script that calls report(...), and return what it reported.

    width : of the window; picture : of it, written once the script has run, which reports nothing
    """

    def run(page, script: str, after: str = "", width: int = 1400, picture: Path | None = None):
        opened = browser.new_page(viewport={"width": width, "height": 1000})
        said: list[str] = []
        opened.on("console", lambda message: said.append(message.text))
        opened.on("pageerror", lambda error: said.append(str(error)))
        opened.goto((report / page).as_uri() + after)
        script = script + (" report(null);" if picture else "")
        found = opened.evaluate(f"new Promise((report) => {{ {HELPERS} {script} }})")
        if picture:
            opened.screenshot(path=picture)
        opened.close()
        assert said == []
        return found

    return run


def case(name: str) -> str:
    return f"runs/run/cases/{slug(f'three-boxes_{name}')}.html"


ALL_LOADED = """
for (const image of document.images) image.loading = "eager";
setTimeout(() => report({
  broken: [...document.images].filter((i) => !i.complete || !i.naturalWidth).map((i) => i.src),
  images: document.images.length,
  wide: document.documentElement.scrollWidth, window: innerWidth,
  cut: [...document.querySelectorAll(".scroll")].filter((b) => b.scrollWidth > b.clientWidth + 1)
    .map((b) => [b.querySelector("table").className, b.scrollWidth, b.clientWidth]),
  low: [...document.querySelectorAll(".viewer button")].filter((b) => b.offsetHeight < 30).length,
}), 500);
"""


@pytest.mark.parametrize("width", [1400, 390])
@pytest.mark.parametrize(
    "page", ["index.html", case("sun"), "maps/sun.html", "samplers/median-cut.html"]
)
def test_pages_load_whole_and_fit_the_window(browse, page, width):
    found = browse(page, ALL_LOADED, width=width)
    assert found["broken"] == []
    assert found["window"] == width
    assert found["wide"] <= found["window"]
    assert found["low"] == 0
    if page == "index.html":
        assert found["cut"] == []
    assert found["images"] >= {"index.html": 5, case("sun"): 1 + 2 * 3}.get(page, 0)


@pytest.mark.parametrize("width", [1400, 390])
def test_no_column_is_cut_off_with_25_samplers(browse, report, monkeypatch, tmp_path, width):
    """On the first page, with names and leagues as long as any."""
    names = [*sampler_names(), *(f"a-sampler-with-a-long-name-{k}" for k in range(25))][:25]
    rng = np.random.default_rng(0)
    rows = rows_of({name: rng.lognormal(0.0, 1.0, 4) for name in names}, floor=0.3)
    rows = rows.assign(
        key=[f"{k:024d}" for k in range(len(rows))],
        reference="r",
        exposure=1.0,
        scale="standard",
        league=LEAGUES[4],
    )
    facts = {
        "experiment": "table1", "scale": {"name": "s", "width": 640, "height": 480, "subpixels": 4},
        "samplers": names, "budgets": ["lights=4"], "planned": len(rows), "missing": {},
        "machine": record(),
    }  # fmt: skip
    one = Reported(Run(tmp_path / "run", rows, facts), find_experiment("table1"))
    (tmp_path / "run").mkdir()
    monkeypatch.setattr(write, "at_hand", lambda folder: one)
    monkeypatch.setattr(write._Pages, "_stale_reports", lambda self: ())
    target = write_report_pages(tmp_path / "run", images=False)
    found = browse(target, ALL_LOADED, width=width)
    assert found["cut"] == []
    assert found["wide"] <= found["window"] == width


def test_keys_toggle_images_in_place(browse):
    steps = """
    const seen = [look()];
    for (const key of ["2", "0", "ArrowRight", "ArrowLeft", "ArrowLeft", "f", "f", "h", "s", "x"]) {
      press(key); seen.push(look());
    }
    report({ seen, names: [...document.querySelectorAll(".methods b")].map((b) => b.textContent) });
    """
    found = browse(case("noise"), steps)
    names, seen = found["names"], found["seen"]
    assert names[0] == "reference" and sorted(names[1:]) == sorted(map(label_of, SHOWN))
    expected = [1, 2, 0, 1, 0, 3, 3, 3, 3, 3, 3]
    shown = [state["shown"][0] for state in seen[:9]]
    assert ["reference" if one == "reference" else label_of(one) for one in shown] == [
        names[k] for k in expected[:9]
    ]
    assert all(state["left"].startswith(names[k]) for state, k in zip(seen, expected, strict=True))
    assert [state["errors"][0] for state in seen[5:8]] == [False, True, False]
    # An error map has its scale drawn below it.
    assert [state["legend"] for state in seen[5:8]][::2] == ["", ""]
    assert seen[6]["legend"].split() == ["FLIP", "0", "0.25", "0.5", "0.75", "1"]
    assert [state["help"] for state in seen[7:9]] == [False, True]
    assert [len(state["shown"]) for state in seen] == [1] * 9 + [2] * 2
    assert sorted(map(label_of, seen[9]["shown"])) == sorted([names[3], "reference"])
    assert seen[9]["right"] == "reference"
    assert seen[1]["hash"] == f"#show={shown[1]}"


def test_the_slider_follows_the_pointer_and_the_address(browse):
    steps = """
    const stage = document.querySelector(".stage");
    const first = look();
    stage.setPointerCapture = () => {};
    stage.hasPointerCapture = () => true;
    const box = stage.getBoundingClientRect();
    const at = (type, part) => stage.dispatchEvent(new PointerEvent(type,
      { clientX: box.left + part * box.width, clientY: box.top + 9, pointerId: 1, bubbles: true }));
    at("pointerdown", 0.5); at("pointermove", 0.8);
    const second = look();
    at("pointerup", 0.8);
    const range = document.querySelectorAll(".viewer input[type=range]")[0];
    range.value = 10; range.dispatchEvent(new Event("input"));
    report({ first, second, third: look(), width: stage.clientWidth });
    """
    found = browse(case("sun"), steps, "#show=mis&right=uniform&split=25")
    assert found["first"]["left"].startswith(label_of("mis")) and "FLIP" in found["first"]["left"]
    assert found["first"]["right"].startswith(label_of("uniform"))
    assert sorted(found["first"]["shown"]) == ["mis", "uniform"]
    assert "split=80" in found["second"]["hash"]
    left, scale = place(found["first"])[0], place(found["first"])[2]
    for state, split in (("first", 0.25), ("second", 0.8), ("third", 0.1)):
        (hidden,) = re.findall(r"inset\(0px ([\d.]+)px 0px 0px\)", found[state]["clip"])
        # The image is clipped in its own pixels, of which 24 are there.
        assert left + (24 - float(hidden)) * scale == pytest.approx(
            split * found["width"], abs=0.01 * scale
        )


def place(state: dict) -> tuple[float, float, float]:
    """Where the image's corner lies on the stage, and how large its pixels are."""
    form = r"translate\(([-\d.]+)px, ([-\d.]+)px\) scale\(([\d.]+)\)"
    left, top, scale = map(float, re.fullmatch(form, state["drawn"]).groups())
    return left, top, scale


def test_zoom_and_place_are_shared_by_all_images(browse):
    """They are the plane's on which all images lie; pixels are whole, and a point stays put."""
    steps = """
    const stage = document.querySelector(".stage");
    stage.setPointerCapture = () => {};
    const box = stage.getBoundingClientRect();
    const seen = [look()];
    const wheel = (x, y, deltaY) => stage.dispatchEvent(new WheelEvent("wheel",
      { clientX: box.left + x, clientY: box.top + y, deltaY, bubbles: true, cancelable: true }));
    const at = (type, x, y) => stage.dispatchEvent(new PointerEvent(type,
      { clientX: box.left + x, clientY: box.top + y, pointerId: 1, bubbles: true }));
    press("i"); seen.push(look());
    wheel(300, 200, -1); seen.push(look());
    at("pointerdown", 300, 200); at("pointermove", 260, 230); at("pointerup", 260, 230); seen.push(look());
    press("ArrowRight"); seen.push(look());
    press("f"); seen.push(look());
    press("c"); seen.push(look());
    report({ seen, width: stage.clientWidth, height: stage.clientHeight,
      inside: [...document.querySelectorAll(".stage img")].every((i) => i.parentElement.className.includes("plane")),
      sizes: [...document.querySelectorAll(".plane img")].map((i) => [i.offsetWidth, i.offsetHeight, i.naturalWidth]) });
    """  # noqa: E501
    found = browse(case("noise"), steps)
    seen = [place(state) for state in found["seen"]]
    assert found["inside"] and found["sizes"] == [[24, 18, 24]] * len(found["sizes"])
    fitting = min(found["width"] // 24, found["height"] // 18)
    assert seen[0][2] == fitting == seen[6][2]
    assert found["seen"][0]["zoom"] == f"{100 * fitting} %"
    assert fitting < seen[1][2] < seen[2][2] and all(scale == int(scale) for *_, scale in seen)
    before, after = ([(300 - s[0]) / s[2], (200 - s[1]) / s[2]] for s in seen[1:3])
    # Corners are rounded to whole pixels of the screen, either may be off by one half.
    assert before == pytest.approx(after, abs=1.0 / seen[1][2])
    assert seen[3][0] - seen[2][0] == pytest.approx(-40, abs=1)
    assert seen[3][1] - seen[2][1] == pytest.approx(30, abs=1)
    names = [state["shown"][0] for state in found["seen"]]
    assert names[3] == names[2] != names[4]  # a drag is no click
    assert seen[3] == seen[4] == seen[5]
    assert "zoom=" in found["seen"][3]["hash"] and "zoom=" not in found["seen"][6]["hash"]
    again = browse(case("noise"), "report(look())", found["seen"][3]["hash"])
    assert place(again) == pytest.approx(seen[3], abs=1.0 + 0.05 * seen[3][2])


def test_what_the_address_says_wrongly_does_no_harm(browse):
    after = "#show=nobody&right=nothing&split=x&exposure=999&budget=none&zoom=x&at=1,y&error=q"
    found = browse(case("sun"), "report(look())", after)
    assert len(found["shown"]) == 2
    # Half of 24 pixels; the image's corner is rounded to a pixel of the screen, some 1/40 of these.
    (hidden,) = re.findall(r"inset\(0px ([\d.]+)px 0px 0px\)", found["clip"])
    assert float(hidden) == pytest.approx(12.0, abs=0.05)
    assert "reference" in found["shown"]


@pytest.mark.parametrize("stops", [0, -2])
def test_the_exposure_shown_is_the_exposure_asked_for(browse, report, tmp_path, stops):
    """Every pixel of the reference on the screen is the sRGB value of its exposed radiance."""
    size = "{position:fixed!important;left:0;top:0;width:480px!important;height:360px!important;"
    steps = f"""
    const style = document.createElement("style");
    style.textContent = ".stage{size}max-width:none!important;z-index:99}} .tag{{display:none}}";
    document.head.append(style);
    """
    picture = tmp_path / "shot.png"
    browse(case("noise"), steps, f"#show=reference&exposure={stops}", picture=picture)
    screen = np.asarray(Image.open(picture).convert("RGB"))[10:360:20, 10:480:20].astype(float)
    run = Run.load(report.parent)
    row = run.rows[run.rows["environment"] == "noise"].iloc[0]
    reference = run.kept_reference(row)
    source = (report / case("noise")).read_text(encoding="utf-8")
    preview = json.loads(re.search(r'id="case">(.*?)</script>', source)[1])["reference"]
    code = np.asarray(Image.open(report / "runs/run/cases" / preview).convert("RGB")) / 255.0
    linear = np.expm1(code * np.log1p(STEEPNESS * WHITEST)) / STEEPNESS
    expected = encoded(linear, stops).astype(float)
    assert screen.shape == expected.shape == (18, 24, 3)
    # The preview has no loss: what is left are the tables' steps and rounding.
    assert np.abs(screen - expected).max() <= 2.0
    # Against the float image there are the codes: half of one is 1.1 % of 1 / 16 + radiance, which
    # is at most 2.6 levels of sRGB; two stops change a middle grey by some 90.
    truth = encoded(read_radiance(reference) * row["exposure"], stops).astype(float)
    assert np.abs(screen - truth).max() <= 5.0
