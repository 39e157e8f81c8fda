"""Image strips: windows lie on the largest errors, columns hold what they should, bytes repeat."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from experiments.maps import places as embedded
from experiments.report.case_figures import (
    case_images,
    hardest_maps,
    shown_maps,
    write_strips,
)
from experiments.report.comparison_figure import (
    LEAST_PANEL,
    PANEL,
    StripImage,
    Window,
    flip_colors,
    strip,
    worst_windows,
)
from experiments.run.loaded_run import Run


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


def test_windows_do_not_overlap_even_where_all_errors_are_equal():
    first, second = worst_windows(np.ones((10, 10), np.float32))
    covered = np.zeros((10, 10), int)
    for window in (first, second):
        covered[window.slices] += 1
    assert covered.max() == 1 and covered.sum() == 8


@pytest.mark.parametrize("width", [30, 112, 640])
def test_every_column_has_a_panel_of_readable_size(width):
    image = np.full((width * 3 // 4, width, 3), 0.2, np.float32)
    pictures = [
        StripImage("reference", image, None, ("floor",)),
        StripImage("one", image, image[..., 0], ("numbers", "cost")),
    ]
    sheet = strip(pictures, [Window(0, 0, 5, 5)], "title", 8)
    columns = sheet.shape[1] / 2
    assert LEAST_PANEL <= columns <= max(PANEL, 2 * LEAST_PANEL) + 20
    assert sheet.dtype == np.uint8
    # A single row of columns is lower than two.
    assert strip(pictures, [], "title", 1).shape[0] > sheet.shape[0]


def test_error_colours_run_from_black_to_bright():
    ends = flip_colors(np.array([[0.0, 1.0, 7.0]], np.float32))[0].astype(int)
    assert ends[0].sum() < 10 and ends[1].sum() > 500
    assert (ends[1] == ends[2]).all()


def test_the_hardest_map_is_that_on_which_the_best_is_worst():
    rows = pd.DataFrame(
        [
            {"environment": name, "sampler": sampler, "flip": flip}
            for name, flips in {"a": (0.9, 0.1), "b": (0.3, 0.3), "c": (0.2, 0.25)}.items()
            for sampler, flip in zip(("x", "y"), flips, strict=True)
        ]
    )
    assert hardest_maps(rows) == ["b", "c"]


def test_strips_are_shown_of_named_maps_every_class_and_the_hardest():
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


def test_a_finished_run_has_strips_with_the_same_bytes(copied: Path):
    run = Run.load(copied)
    first = write_strips(run, ["noise", "sun"])
    assert list(first) == ["three-boxes under noise, lights=4", "three-boxes under sun, lights=4"]
    before = {path: path.read_bytes() for path in first.values()}
    assert Image.open(next(iter(before))).width == 4 * 240 + 3 * 4 + 2 * 6
    write_strips(run, ["noise", "sun"])
    assert {path: path.read_bytes() for path in before} == before


def test_flip_maps_are_those_that_were_measured(finished: Path):
    run = Run.load(finished)
    case = case_images(run, "three-boxes", "noise", "lights=4")
    for row, error in zip(case.rows, case.flip_maps(), strict=True):
        # Images are kept with 11 bits, which moves a FLIP of about 0.1 by less than a thousandth.
        assert error.mean() == pytest.approx(row["flip"], abs=1e-3)


def test_without_images_there_is_no_strip(tmp_path, finished):
    run = Run.load(finished)
    assert write_strips(Run(tmp_path, run.rows, run.record), ["noise"]) == {}
