"""Comparison figures: windows on the largest errors, columns that hold what they should."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from experiments.maps import places as embedded
from experiments.report.case_figures import (
    PANEL,
    Column,
    Window,
    comparison_figure,
    comparison_figures,
    hardest_maps,
    kept_rows,
    read_case,
    shown_maps,
    worst_windows,
)
from experiments.report.parts import Picture, Text
from experiments.run.loaded_run import Run
from samplers.preview import GAP, LEAST_WIDTH


def test_windows_lie_on_the_largest_errors_and_apart():
    error = np.zeros((30, 40), np.float32)
    error[4:6, 30:32] = 1.0
    error[20:22, 5:7] = 0.5
    first, second = worst_windows(error)
    assert (first.height, first.width) == (6, 8)
    for window, (row, column) in ((first, (4, 30)), (second, (20, 5))):
        rows, columns = window.slices
        assert rows.start <= row < row + 1 < rows.stop
        assert columns.start <= column < column + 1 < columns.stop


@pytest.mark.parametrize("width", [30, 112, 640])
def test_every_column_has_a_panel_of_readable_size(width):
    image = np.full((width * 3 // 4, width, 3), 0.2, np.float32)
    pictures = [
        Column("reference", image, None, ("floor",)),
        Column("one", image, image[..., 0], ("numbers", "cost")),
    ]
    sheet = comparison_figure(pictures, [Window(0, 0, 5, 5)], 8)
    columns = sheet.shape[1] / 2
    assert LEAST_WIDTH <= columns <= max(PANEL, 2 * LEAST_WIDTH) + 20
    assert sheet.dtype == np.uint8
    # A single row of columns is lower than two.
    assert comparison_figure(pictures, [], 1).shape[0] > sheet.shape[0]


def test_the_hardest_map_is_that_on_which_the_best_is_worst():
    rows = pd.DataFrame(
        [
            {"environment": name, "sampler": sampler, "flip": flip}
            for name, flips in {"a": (0.9, 0.1), "b": (0.3, 0.3), "c": (0.2, 0.25)}.items()
            for sampler, flip in zip(("x", "y"), flips, strict=True)
        ]
    )
    assert hardest_maps(rows) == ["b", "c"]


def test_figures_are_shown_of_named_maps_every_class_and_the_hardest():
    names = [*embedded.names(), "red_wall_1k"]
    hard = names[5]
    rows = pd.DataFrame(
        {"environment": names, "sampler": "x", "flip": [float(name == hard) for name in names]}
    )
    shown = shown_maps(rows)
    assert "red_wall_1k" in shown and hard in shown
    assert {embedded.kind(name) for name in shown if name in embedded.names()} == {
        embedded.kind(name) for name in embedded.names()
    }
    assert len(shown) <= 1 + 9 + 2
    assert shown_maps(rows.iloc[:8]) == names[:8]


def draw(run: Run) -> dict[Path, bytes]:
    """The figures of a run, drawn below its folder."""
    made = {}
    for part in comparison_figures(2)(run):
        if isinstance(part, Picture):
            path = run.folder / part.file
            path.parent.mkdir(exist_ok=True)
            part.draw(path)
            made[path] = path.read_bytes()
    return made


def test_a_finished_run_has_figures_with_the_same_bytes(copied: Path):
    run = Run.load(copied)
    run = replace(run, rows=run.rows[run.rows["environment"].isin(["noise", "sun"])])
    before = draw(run)
    assert [path.name for path in before] == [
        "three-boxes_noise_lights=4.webp", "three-boxes_sun_lights=4.webp",
    ]  # fmt: skip
    assert Image.open(next(iter(before))).width == 4 * (240 + GAP) + GAP
    assert draw(run) == before


def test_error_maps_are_those_that_were_measured(finished: Path):
    run = Run.load(finished)
    case = read_case(run, kept_rows(run, "three-boxes", "noise", "lights=4"))
    assert len(case.images) == 3
    for row, error in zip(case.rows, case.error_maps(), strict=True):
        assert error.mean(dtype=np.float64) == pytest.approx(row["flip"], rel=1e-12)


def test_figures_without_their_images_stay_and_others_are_told(tmp_path: Path, finished: Path):
    run = replace(Run.load(finished), folder=tmp_path)
    *_, last = comparison_figures()(run)
    assert isinstance(last, Text) and "No images are kept" in last.text
    kept = tmp_path / "figures" / "three-boxes_sun_lights=4.webp"
    kept.parent.mkdir()
    kept.write_bytes(b"drawn before")
    *_, last = comparison_figures()(run)
    assert isinstance(last, Picture) and last.draw is None
    assert last.file == "figures/three-boxes_sun_lights=4.webp"
