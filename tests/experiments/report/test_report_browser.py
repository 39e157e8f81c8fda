"""The report in a real browser, without a screen: no error, and the comparison view works."""

import html
import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from experiments.report.html import ReportOptions, write_html
from experiments.report.links import slug
from experiments.report.preview import encoded
from experiments.report.previews import STEEPNESS, WHITEST
from experiments.report.run_data import load_run
from samplers.files.image_file import read_radiance

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "chrome"))), None)
pytestmark = pytest.mark.skipif(BROWSER is None, reason="no chromium is installed")
OPTIONS = [
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-sync", "--disable-background-networking", "--disable-component-update"),
    *("--hide-scrollbars", "--force-device-scale-factor=1"),
    *("--enable-logging=stderr", "--virtual-time-budget=3000", "--window-size=1280,1000"),
]
RESULT = """
<script>
const report = (result) => {
  const text = JSON.stringify(result);
  if (window.parent !== window) { window.parent.postMessage(text, "*"); return; }
  const place = document.createElement("pre");
  place.id = "result";
  place.textContent = text;
  document.body.append(place);
};
const press = (key, target) => (target || document).dispatchEvent(
  new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));
const look = () => ({
  shown: [...document.querySelectorAll(".stage img.shown")].map((image) => image.alt),
  errors: [...document.querySelectorAll(".stage img.shown")].map((image) => !image.className.includes("coded")),
  clip: [...document.querySelectorAll(".stage img.shown")].map((image) => image.style.clipPath).join(""),
  left: document.querySelector(".tag.left").textContent,
  right: document.querySelector(".tag.right").hidden ? "" : document.querySelector(".tag.right").textContent,
  table: document.querySelector("#exposure feFuncR").getAttribute("tableValues").split(" ").map(Number),
  hash: location.hash, help: !document.querySelector(".help").hidden,
});
window.addEventListener("load", () => { BODY });
</script>
"""  # noqa: E501


@pytest.fixture(scope="module")
def report(finished, maps_folder, tmp_path_factory) -> Path:
    folder = shutil.copytree(finished, tmp_path_factory.mktemp("browser") / "run")
    return write_html(folder, ReportOptions(maps=(maps_folder,))).parent


@pytest.fixture
def browse(report, tmp_path):
    """Open a page, run a script that calls report(...), and return what it reported.

    width : of a frame that the page is shown in; the whole window where it is 0
    """

    def run(page: str, script: str, after: str = "", width: int = 0, picture: Path | None = None):
        source = report / page
        copy = source.with_name(f"_{source.name}")
        text = source.read_text(encoding="utf-8")
        copy.write_text(
            text.replace("</body>", RESULT.replace("BODY", script) + "</body>"), encoding="utf-8"
        )
        url = f"{copy.as_uri()}{after}"
        if width:
            frame = tmp_path / "frame.html"
            frame.write_text(
                "<body><script>addEventListener('message', (event) => { const place = "
                "document.createElement('pre'); place.id = 'result'; place.textContent = "
                "event.data; document.body.append(place); });</script>"
                f"<iframe src='{url}' width={width} height=800 style='border:0'></iframe></body>",
                encoding="utf-8",
            )
            url = frame.as_uri()
        output = [f"--screenshot={picture}"] if picture else ["--dump-dom"]
        done = subprocess.run(
            [BROWSER, *OPTIONS, f"--user-data-dir={tmp_path / 'user'}",
             *output, url],
            capture_output=True, text=True, check=True, timeout=120,
        )  # fmt: skip
        copy.unlink()
        assert [line for line in done.stderr.splitlines() if "CONSOLE" in line] == []
        if picture:
            return None
        found = re.search(r'<pre id="result">(.*?)</pre>', done.stdout, re.DOTALL)
        assert found, done.stdout[-1000:]
        return json.loads(html.unescape(found[1]))

    return run


def case(name: str) -> str:
    return f"cases/{slug(f'three-boxes_{name}')}.html"


ALL_LOADED = """
for (const image of document.images) image.loading = "eager";
setTimeout(() => report({
  broken: [...document.images].filter((i) => !i.complete || !i.naturalWidth).map((i) => i.src),
  images: document.images.length,
  wide: document.documentElement.scrollWidth, window: innerWidth,
  low: [...document.querySelectorAll("button")].filter((b) => b.offsetHeight < 30).length,
}), 500);
"""


@pytest.mark.parametrize("width", [0, 390])
@pytest.mark.parametrize(
    "page", ["index.html", case("sun"), "maps/sun.html", "samplers/median-cut.html"]
)
def test_pages_load_whole_and_fit_the_window(browse, page, width):
    found = browse(page, ALL_LOADED, width=width)
    assert found["broken"] == []
    assert found["window"] == (width or 1280)
    assert found["wide"] <= found["window"]
    assert found["low"] == 0
    assert found["images"] >= {"index.html": 6 + 5 + 5, case("sun"): 1 + 2 * 3}.get(page, 0)


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
    assert names[0] == "reference" and sorted(names[1:]) == ["median-cut", "mis", "uniform"]
    expected = [1, 2, 0, 1, 0, 3, 3, 3, 3, 3, 3]
    assert [state["shown"][0] for state in seen[:9]] == [names[k] for k in expected[:9]]
    assert all(state["left"].startswith(names[k]) for state, k in zip(seen, expected, strict=True))
    assert [state["errors"][0] for state in seen[5:8]] == [False, True, False]
    assert [state["help"] for state in seen[7:9]] == [False, True]
    assert [len(state["shown"]) for state in seen] == [1] * 9 + [2] * 2
    assert sorted(seen[9]["shown"]) == sorted([names[3], "reference"])
    assert seen[9]["right"] == "reference"
    assert seen[1]["hash"] == f"#show={names[2]}"


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
    const range = document.querySelectorAll(".viewer input[type=range]")[0];
    range.value = 10; range.dispatchEvent(new Event("input"));
    report({ first, second, third: look() });
    """
    found = browse(case("sun"), steps, "#show=mis&right=uniform&split=25")
    assert found["first"]["left"].startswith("mis") and "FLIP" in found["first"]["left"]
    assert found["first"]["right"].startswith("uniform")
    assert sorted(found["first"]["shown"]) == ["mis", "uniform"]
    assert found["first"]["clip"] == "inset(0px 75% 0px 0px)"
    assert found["second"]["clip"] == "inset(0px 20% 0px 0px)"
    assert "split=80" in found["second"]["hash"]
    assert found["third"]["clip"] == "inset(0px 90% 0px 0px)"


def test_what_the_address_says_wrongly_does_no_harm(browse):
    after = "#show=nobody&right=nothing&split=x&exposure=999&budget=none"
    found = browse(case("sun"), "report(look())", after)
    assert len(found["shown"]) == 2
    assert found["clip"] == "inset(0px 50% 0px 0px)"
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
    data = load_run(report.parent)
    row = data.rows[data.rows["environment"] == "noise"].iloc[0]
    reference = data.reference(row["key"])
    source = (report / case("noise")).read_text(encoding="utf-8")
    preview = json.loads(re.search(r'id="case">(.*?)</script>', source)[1])["reference"]
    code = np.asarray(Image.open(report / "cases" / preview).convert("RGB")) / 255.0
    linear = np.expm1(code * np.log1p(STEEPNESS * WHITEST)) / STEEPNESS
    expected = encoded(linear, stops).astype(float)
    assert screen.shape == expected.shape == (18, 24, 3)
    # Decoders of JPEG may differ by a code, which is 2.2 % of radiance or 2.6 levels of sRGB.
    assert np.abs(screen - expected).max() <= 4.0
    # Against the float image the compression of noise adds some 5 codes, 13 levels at most, but
    # hardly a bias. Two stops change a middle grey by some 90 levels.
    truth = encoded(read_radiance(reference) * row["exposure"], stops).astype(float)
    assert np.abs(screen - truth).mean() < 13.0
    assert abs((screen - truth).mean()) < 3.0
