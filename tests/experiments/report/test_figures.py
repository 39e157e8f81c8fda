"""The SVGs of a report: small, and the same drawing as matplotlib's."""

from __future__ import annotations

import re
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest
from PIL import Image

from experiments.report.figures import METADATA, save_figure
from experiments.report.style import STYLE, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SVG = "{http://www.w3.org/2000/svg}"
RULE = re.compile(r"\.(\w+)\{([^}]*)\}")
FONT = "; font-family: 'DejaVu Sans', sans-serif"
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


def heatmap() -> Figure:
    """Sixty cells with figures, names that are turned, and markers."""
    figure = new_figure(6.0, 4.0)
    axes = figure.add_subplot()
    for row in range(6):
        for column in range(10):
            axes.add_patch(mpl.patches.Rectangle((column, row), 1.0, 1.0, clip_on=True))
            axes.text(column + 0.5, row + 0.5, f"{row}<{column}", ha="center", color="#222222")
    axes.set_xticks(np.arange(10) + 0.5, [f"map {k}" for k in range(10)], rotation=35.0)
    axes.set_ylabel("RMSE")
    axes.plot([0.0, 10.0], [0.0, 6.0], marker="o")
    axes.text(10.2, 5.0, "Variance min. (Viriyothai 2009) [light_extent=full] " * 3)
    return figure


def elements(svg: str, name: str) -> list[ElementTree.Element]:
    """The elements of a name, in the order of drawing."""
    return list(ElementTree.fromstring(svg).iter(SVG + name))


def places(element: ElementTree.Element) -> list[float]:
    """All numbers that say where an element is, but turns by nothing."""
    turn = element.get("transform", "")
    values = [element.get(one, "") for one in ("x", "y", "d")]
    if not turn.startswith(("rotate(0 ", "rotate(-0 ")):
        values.append(turn)
    return [float(number) for number in NUMBER.findall(" ".join(values))]


def styles(svg: str) -> list[str]:
    """The style of every element, whether it is named or stands there, without the font."""
    (sheet,) = elements(svg, "style")
    rules = dict(RULE.findall(sheet.text or ""))
    drawn = ElementTree.fromstring(svg).iter()
    told = (one.get("style") or rules.get(one.get("class", ""), "") for one in drawn)
    return [style.replace(FONT, "") for style in told if style]


@pytest.fixture
def drawn(tmp_path: Path) -> tuple[str, str]:
    """One figure as matplotlib writes it, and as a report does."""
    whole = BytesIO()
    with mpl.rc_context(STYLE):
        figure = heatmap()
        stem = save_figure(tmp_path, "heatmap", figure, ("svg", "png"))
        box = figure.get_tightbbox().padded(0.1)
        with np.printoptions(legacy=False):
            figure.savefig(whole, format="svg", metadata=METADATA["svg"], bbox_inches=box, dpi=110)
    return whole.getvalue().decode(), (tmp_path / f"{stem}.svg").read_text(encoding="utf-8")


def test_an_svg_is_the_drawing_of_matplotlib(drawn: tuple[str, str]) -> None:
    whole, small = drawn
    for name, count in {"text": 72, "path": 60, "use": 10}.items():
        pairs = list(zip(elements(whole, name), elements(small, name), strict=True))
        assert len(pairs) >= count, name
        for before, after in pairs:
            assert (after.text or "").strip() == (before.text or "").strip()
            # Two decimals are kept, the rest is cut.
            np.testing.assert_allclose(places(after), places(before), rtol=0.0, atol=0.01)
    turned = [one.text for one in elements(small, "text") if one.get("transform")]
    assert turned == [*(f"map {k}" for k in range(10)), "RMSE"]


def test_an_svg_keeps_every_style(drawn: tuple[str, str]) -> None:
    whole, small = drawn
    assert styles(small) == styles(whole)
    assert len(set(styles(small))) > 4  # fills, lines and letters differ
    own = [one.get("style") for one in ElementTree.fromstring(small).iter() if one.get("style")]
    assert len(own) == len(set(own))
    assert small.count("DejaVu Sans") == 1 and len(small) < 0.55 * len(whole)


def test_no_letter_is_cut(drawn: tuple[str, str], tmp_path: Path) -> None:
    with Image.open(tmp_path / "heatmap.png") as picture:
        assert np.asarray(picture.convert("L"))[:, -5:].min() == 255


ROOT = Path(__file__).parents[3]
OTHER_SIZE = re.compile(r"(?:fontsize|labelsize)=\(?\d|font\.size|frameon|#[0-9a-fA-F]{6}\b")


def test_letters_and_lines_have_their_style_from_one_file() -> None:
    """Sizes elsewhere are words that count from it; none has a colour."""
    files = ROOT.glob("experiments/**/*.py")
    found = {file for file in files if OTHER_SIZE.search(file.read_text(encoding="utf-8"))}
    assert [str(file.relative_to(ROOT / "experiments")) for file in found] == ["report/style.py"]


def test_another_font_size_is_one_number(tmp_path: Path) -> None:
    sizes = []
    for size in (STYLE["font.size"], 2.0 * STYLE["font.size"]):
        with mpl.rc_context({**STYLE, "font.size": size}):
            figure = heatmap()
            figure.legend(["line"])
            save_figure(tmp_path, f"heatmap{size:g}", figure)
        svg = (tmp_path / f"heatmap{size:g}.svg").read_text(encoding="utf-8")
        sizes.append([float(one) for one in re.findall(r"font(?:-size)?: ([\d.]+)px", svg)])
    assert len(set(sizes[0])) >= 2  # ticks and labels
    np.testing.assert_allclose(sizes[1], 2.0 * np.array(sizes[0]), rtol=1e-3)
