"""Readings beside their default, on rows whose ratios are known."""

import pandas as pd
import pytest

from experiments.questions.comparison import beaten_defaults, comparisons, deciding
from experiments.questions.readings import ALL, choices_in_words, found_in, readings, ruled_out
from experiments.report.write import write_report
from experiments.run.loaded_run import Run, write_run
from metrics.registry import find_metric, leading_metric
from tests.experiments.grid_rows import grid_run

MAPS = tuple(f"map-{k}" for k in range(8))
DEFAULT, BETTER, WORSE, SAME = (
    "median-cut", "median-cut[order=rounds]", "median-cut[position=middle]",
    "median-cut[aspect=False]",
)  # fmt: skip
RATIO = {DEFAULT: 1.0, BETTER: 0.9, WORSE: 2.0, SAME: 1.0}
CHOICES = {BETTER: "in rounds", WORSE: "in the middle", SAME: "in pixels"}
RMSE = find_metric("rmse")


def errors(scene: str, environment: str, sampler: str, lights: int) -> tuple[float, float]:
    """Maps differ by a factor of 2 each, and the better reading wins by 10 % on all of them."""
    level = 2.0 ** MAPS.index(environment) / lights
    return RATIO[sampler] * level, RATIO[sampler] * level / 2.0


def run_of(folder, error=errors, maps=MAPS):
    return grid_run(folder, ("vase", "teapot"), maps, tuple(RATIO), error, (8, 16))


def by_reading(rows) -> dict[str, object]:
    return {one.reading: one for one in comparisons(rows, RMSE)}


def test_ratios_wins_and_means_are_those_of_the_rows(tmp_path):
    found = by_reading(run_of(tmp_path).rows)
    assert set(found) == {BETTER, WORSE, SAME}
    for label, one in found.items():
        assert one.sampler == DEFAULT and set(one.ratios) == {"lights=8", "lights=16"}
        for ratio in (one.overall, *one.ratios.values()):
            # The same on every map, so that the bootstrap has no width.
            assert (ratio.ratio, ratio.low, ratio.high) == pytest.approx((RATIO[label],) * 3)
            assert ratio.maps == len(MAPS)
        assert one.error["lights=8"] == pytest.approx(RATIO[label] * (2**8 - 1) / 8 / 8)
        assert one.default_error["lights=8"] == pytest.approx((2**8 - 1) / 8 / 8)
    assert (found[BETTER].overall.wins, found[WORSE].overall.wins) == (8, 0)
    assert found[SAME].overall.wins == found[SAME].overall.losses == 0


def test_a_sampler_may_be_a_reading_of_another(tmp_path):
    def error(scene, environment, sampler, lights):
        level = 0.8 if sampler == "mis-compensated" else 1.0
        return level, level

    run = grid_run(tmp_path, ("vase",), MAPS, ("mis", "mis-compensated"), error)
    assert not list(comparisons(run.rows, RMSE))
    (one,) = comparisons(run.rows, RMSE, {"mis-compensated": "mis"})
    assert one.sampler == "mis" and one.overall.ratio == pytest.approx(0.8)


def test_an_extent_for_all_samplers_is_compared_over_all_of_them(tmp_path):
    ratios = {f"{name}[light_extent=full]": r for name, r in (("fhis", 0.8), ("uniform", 0.5))}
    error = lambda scene, environment, sampler, lights: (ratios.get(sampler, 1.0), 0.5)  # noqa: E731
    run = grid_run(tmp_path, ("vase",), MAPS, ("fhis", "uniform", *ratios), error)
    run.rows["rmse_floor"] = 0.2  # 0.5 counts as 0.6
    (one,) = (one for one in found_in(run) if one.metric == RMSE and one.sampler == ALL)
    assert one.overall.ratio == pytest.approx((0.8 * 0.6) ** 0.5) and one.overall.wins == len(MAPS)
    (line,) = beaten_defaults([one], choices_in_words(), ruled_out())
    assert line.startswith("Every set of lights is beaten by perturbed by the full angle")
    assert line.endswith(" at lights=16; 8 of 32 errors lie near the noise floor).")


def test_words_are_those_of_the_figures(tmp_path):
    found = by_reading(run_of(tmp_path).rows)
    (line,) = beaten_defaults(list(found.values()), CHOICES)
    assert line.startswith("Median cut (Debevec 2005) is beaten by in rounds (RMSE × 0.900")
    kept, none = beaten_defaults(list(found.values()), CHOICES, {BETTER: "its paper says so"})
    assert kept == f"{line} It stays: its paper says so."
    assert none.startswith("No other default of")
    (line,) = beaten_defaults([found[WORSE]], CHOICES)
    assert line.startswith("No default of 1 comparisons is beaten by more than 3 %")
    assert "lights=8, lights=16" in line


def test_what_changes_the_cost_is_decided_at_equal_time_and_all_else_at_equal_lights(tmp_path):
    run = run_of(tmp_path)
    # In the same time what loses by 2 at equal lights wins by as much, and what wins loses.
    timed = run.rows.assign(budget="time=median-cut:8")
    timed["rmse"] = timed["rmse"] / timed["sampler"].map(RATIO) ** 2
    found = list(comparisons(pd.concat([run.rows, timed]), RMSE))
    for costly, equal, beaten in ((True, "time", {WORSE}), (False, "lights", {BETTER})):
        chosen = deciding(found, lambda label, costly=costly: costly)
        assert {one.equal for one in chosen} == {equal} and len(chosen) == 3
        assert {one.reading for one in chosen if one.beaten} == beaten
    (line,) = beaten_defaults(deciding(found, lambda label: True), CHOICES)
    assert line.startswith("Median cut (Debevec 2005) is beaten by in the middle (RMSE × 0.500")
    assert "at time=median-cut:8)" in line
    # Where nothing was timed, what changes the cost is judged at what there is.
    rays = run.rows.assign(budget="rays=16")
    untimed = deciding(list(comparisons(pd.concat([run.rows, rays]), RMSE)), lambda label: True)
    assert {one.equal for one in untimed} == {"rays"}
    # Who takes more than the budget is not compared at it: 12 rays in the mean are too many.
    assert not list(comparisons(run.rows.assign(budget="rays=10"), RMSE))


def test_errors_near_the_floor_are_ties(tmp_path):
    run = run_of(tmp_path)
    # 3 × 0.5: at 16 lights the default, 2^k / 16, is below on the maps 0 to 4.
    found = by_reading(run.rows.assign(rmse_floor=0.5))
    better, worse = found[BETTER].ratios["lights=16"], found[WORSE].ratios["lights=16"]
    assert (better.wins, better.losses, better.maps) == (3, 0, 8)
    assert better.ratio == pytest.approx(0.9 ** (3 / 8))
    (line,) = beaten_defaults([found[BETTER]], CHOICES)  # with 8 lights on the maps 0 to 3
    assert line.endswith(" at equal lights; 18 of 32 errors lie near the noise floor).")
    # Twice the error is clear of it on map 4 too: 2 against the 1.5 that the default counts as.
    assert worse.losses == 4 and worse.ratio == pytest.approx((2.0**3 * 2.0 / 1.5) ** (1 / 8))
    nothing = by_reading(run.rows.assign(rmse_floor=1e9))
    assert nothing[WORSE].overall.wins == nothing[WORSE].overall.losses == 0
    assert beaten_defaults(list(nothing.values()), {})[0].startswith("No default of 3")


def test_few_maps_say_nothing(tmp_path):
    found = list(by_reading(run_of(tmp_path, maps=MAPS[:5]).rows).values())
    assert beaten_defaults(found, {}) == ["No comparison has enough maps to say anything."]


def test_report_has_a_table_per_metric(tmp_path):
    write_report(readings(), run_of(tmp_path))
    table = pd.read_csv(tmp_path / "readings.csv")
    assert len(table) == 2 * len(RATIO) and set(table["metric"]) == {"rmse", "flip"}
    assert table["metric"].iloc[0] == leading_metric().name
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "Median cut (Debevec 2005) is beaten by all regions are cut once a round" in text


def test_parts_are_compared_each_by_itself_and_the_largest_images_decide(tmp_path):
    stays = lambda *of: tuple((0.8 if of[2] == SAME else 1.0) * e for e in errors(*of))  # noqa: E731
    for folder, maps, width in ((tmp_path, MAPS, 320), (tmp_path / "part", MAPS[:7], 640)):
        run = run_of(folder, stays, maps)
        folder.mkdir(exist_ok=True)
        scale = {**run.record["scale"], "width": width}
        write_run(folder, run.rows, {**run.record, "experiment": "readings", "scale": scale})
    write_report(readings(), Run.load(tmp_path))
    table = pd.read_csv(tmp_path / "readings.csv")
    better = table[(table["label"] == BETTER) & (table["metric"] == "rmse")]
    assert list(better["images"]) == ["320×84", "640×84"]
    assert list(better["wins"]) == ["8 of 8", "7 of 7"]
    decided = pd.read_csv(tmp_path / "decided.csv").set_index("label")  # a reading, a line
    assert set(decided["images"]) == {"640×84"} and decided.loc[BETTER, "rmse_wins"] == 7
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    decisive, _, others = text.partition("In smaller images, or")
    assert "(640×84, RMSE × 0.900" in decisive and "(320×84" not in decisive
    assert "(320×84, RMSE × 0.900" in others.partition("## ")[0]
    assert "× 0.800" in decisive and "× 0.800" not in others.partition("## ")[0]
