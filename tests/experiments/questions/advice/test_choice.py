"""Advice follows the law that the rows follow, says how sure it is, and what it is worth."""

import json
import math
import re
import shlex
from dataclasses import replace

import numpy as np
import pytest

from experiments.cli.advice import advise as advise_command
from experiments.cli.advice import command_for, train_advice
from experiments.maps.features import FEATURES, PREFIX, map_features
from experiments.questions.advice import sections, speed
from experiments.questions.advice.choice import Wish, advise
from experiments.questions.advice.measured import REFERENCE
from experiments.questions.advice.model_file import load_model, to_json
from experiments.questions.advice.reasons import alike_maps, decisive, importance
from experiments.questions.advice.sections import sentences, what_the_model_says
from experiments.report.parts import Plot, Table
from experiments.run.record import write_run
from renderer.image import write_exr
from samplers import EnvironmentMap, EnvlightError
from samplers.conformance.stress_maps import stress_map
from tests.experiments.questions.advice.known_law import (
    RAYS_PER_LIGHT,
    SAMPLERS,
    SIZE,
    law,
    law_run,
)


def middling(**changed):
    """Columns of a map with everything in the middle, but for what is changed."""
    features = dict.fromkeys(FEATURES, 0.5) | {"contrast": 30.0, "emitter_size": 30.0}
    features |= {"emitters": 20.0, "effective_emitters": 20.0, "spectral_slope": 0.0}
    return {PREFIX + name: value for name, value in (features | changed).items()}


def plain(columns):
    return {name.removeprefix(PREFIX): value for name, value in columns.items()}


HIGH, LOW = middling(contrast=900.0), middling(contrast=1.5)


@pytest.mark.parametrize("columns", [HIGH, LOW])
@pytest.mark.parametrize("count", [4, 11, 32])
def test_the_best_by_the_law_is_chosen(model, columns, count):
    found = advise(model, columns, Wish("lights", count, "rmse"))
    errors = {name: law(name, plain(columns), count) for name in SAMPLERS}
    assert found.verdict is not None and found.verdict.better and not found.by_average
    assert found.chosen.sampler == min(errors, key=errors.__getitem__)
    assert found.chosen.count == count
    # Noise of 0.15 over 60 maps, and a ridge: within 0.1 in ln.
    assert found.chosen.error == pytest.approx(errors[found.chosen.sampler], rel=0.1)
    assert found.chosen.low < found.chosen.error < found.chosen.high
    assert found.chosen.rays == pytest.approx(RAYS_PER_LIGHT[found.chosen.sampler] * count, rel=0.1)
    assert found.runner_up is not None and found.runner_up.error >= found.chosen.error


def test_the_features_of_the_law_are_the_reasons(model):
    found = advise(model, HIGH, Wish("lights", 16, "rmse"))
    assert found.chosen.sampler == "ours"
    assert found.level[0].feature == "contrast" and found.level[0].factor < 0.5
    assert found.order[0].feature == "contrast" and found.order[0].factor < 0.5
    values = model.features[:, list(FEATURES).index("contrast")]
    assert found.level[0].higher_than == pytest.approx((values < 900.0).mean())
    assert found.beyond == ()
    assert advise(model, middling(contrast=1e6), Wish("lights", 16, "rmse")).beyond == ("contrast",)


def test_the_features_of_the_law_decide(model):
    names = list(FEATURES)
    for members, feature in (([0, 2], "contrast"), ([0, 1], "texture")):
        assert names[decisive(model, "rmse", members).argmax()] == feature
    assert names[importance(model, "rmse").argmax()] == "contrast"


def test_an_order_with_a_gap_is_sure_and_one_without_is_not(model):
    far = advise(model, HIGH, Wish("lights", 16, "rmse"))
    assert far.sureness > 0.95
    same = model.sureness("rmse", 0, 1, (16, 16), 0.0)
    assert same + model.sureness("rmse", 1, 0, (16, 16), 0.0) == pytest.approx(1.0)
    assert math.isnan(replace(
        model, residuals={"rmse": model.residuals["rmse"] * np.nan}
    ).sureness("rmse", 0, 1, (16, 16), 1.0))  # fmt: skip


def test_leagues_keep_the_others_out(model):
    found = advise(model, LOW, Wish("lights", 16, "rmse", "distribution"))
    assert found.chosen.sampler == "mis" and found.runner_up is None
    assert advise(model, LOW, Wish("lights", 16, "rmse", "fixed")).chosen.sampler == "median-cut"


def test_rays_are_kept_to(model):
    found = advise(model, LOW, Wish("rays", 6.0, "rmse", "distribution"))
    assert 5.0 < found.chosen.rays <= 6.0
    assert found.chosen.count == pytest.approx(8, abs=1)
    with pytest.raises(EnvlightError, match=r"--rays 0\.1: even 4 lights cost more"):
        advise(model, LOW, Wish("rays", 0.1, "rmse"))


def test_seconds_are_those_of_the_rows_times_this_machines_speed(model):
    """0.01 s a light, and 2e-8 s a ray of "mis"."""
    subpixels = 100_000_000
    wish = Wish("seconds", 10.0, "rmse", "distribution", subpixels)
    found = advise(model, LOW, wish).chosen
    cost = 0.01 * found.count + 2e-8 * found.rays * subpixels
    assert found.seconds == pytest.approx(cost, rel=1e-3) and found.seconds <= 10.0
    more = 0.01 * (found.count + 1) + 2e-8 * 0.75 * (found.count + 1) * subpixels
    assert more > 10.0 * 0.95
    slow = advise(model, LOW, replace(wish, speed=1.5)).chosen
    assert slow.count == pytest.approx(found.count / 1.5, abs=1)


def test_the_least_count_that_reaches_an_error(model):
    error = law("ours", plain(HIGH), 12)
    found = advise(model, HIGH, Wish("error", error, "rmse")).chosen
    assert found.sampler == "ours" and found.count == pytest.approx(12, abs=2)
    assert found.error <= error
    fewer = advise(model, HIGH, Wish("lights", found.count - 1, "rmse")).chosen
    assert fewer.error > error
    with pytest.raises(EnvlightError, match="nobody is expected to reach it with 32 lights"):
        advise(model, HIGH, Wish("error", 1e-6, "rmse"))


def test_where_choosing_is_not_worth_it_the_best_on_average_is_taken(model):
    worth = [
        replace(one, better=False, average="median-cut") if one.metric == "rmse" else one
        for one in model.verdicts
    ]
    found = advise(replace(model, verdicts=tuple(worth)), HIGH, Wish("lights", 16, "rmse"))
    assert found.by_average and found.chosen.sampler == "median-cut"
    assert found.runner_up is not None and found.runner_up.sampler == "ours"
    assert found.sureness < 0.5


def test_a_small_lead_is_not_followed(model):
    first = advise(model, HIGH, Wish("lights", 16, "rmse"))
    lead = math.log(first.runner_up.error / first.chosen.error)
    worth = tuple(replace(one, average=first.runner_up.sampler) for one in model.verdicts)
    for margin, taken in ((lead + 1e-6, first.runner_up), (lead - 1e-6, first.chosen)):
        careful = replace(model, margins={"rmse": margin}, verdicts=worth)
        found = advise(careful, HIGH, Wish("lights", 16, "rmse"))
        assert found.chosen == taken
        assert found.by_average == (taken == first.runner_up)


@pytest.mark.parametrize(
    ("wish", "said"),
    [
        (Wish("lights", 16, "psnr"), "--metric psnr: the model knows errors by flip, rmse"),
        (Wish("lights", 16, "rmse", "lamps"), "--league lamps: use all, fixed, distribution"),
        (Wish("lights", 300, "rmse"), "--lights 300: give a number of lights from 4 to 32"),
    ],
)
def test_what_the_model_does_not_know_is_refused(model, wish, said):
    with pytest.raises(EnvlightError) as caught:
        advise(model, HIGH, wish)
    assert set(re.findall(r"\w+", said)) <= set(re.findall(r"\w+", str(caught.value)))


def test_a_measured_map_is_most_alike_to_itself(model):
    columns = dict(zip((PREFIX + name for name in FEATURES), model.features[7], strict=True))
    found = advise(model, columns, Wish("lights", 9, "rmse"))
    assert found.alike[0].name == model.maps[7]
    assert found.alike[0].distance == pytest.approx(0.0, abs=1e-9)
    assert found.alike[0].count == 8
    sampler = model.samplers.index(found.chosen.sampler)
    assert found.alike[0].error == model.measured["rmse"][7, sampler, 1]
    distances = [one.distance for one in found.alike]
    assert len(found.alike) == 5 and distances == sorted(distances)


def test_of_maps_alike_only_what_was_measured_is_told(model):
    """Maps may lack the count that is asked for, or the sampler."""
    errors = model.measured["rmse"].copy()
    errors[7, :, 2:] = np.nan
    errors[8] = np.nan
    gaps = replace(model, measured={**model.measured, "rmse": errors})
    for k in (7, 8):
        found = alike_maps(gaps, model.features[k], "rmse", ("mis", 32))
        assert len(found) == 5 and all(np.isfinite(one.error) for one in found)
        assert model.maps[8] not in {one.name for one in found}
        if k == 7:
            assert found[0].name == model.maps[7] and found[0].count == model.counts[1]
            assert found[0].error == errors[7, model.samplers.index("mis"), 1]


def test_the_report_has_the_model_and_its_sentences_are_the_rows(run, noisy, monkeypatch):
    monkeypatch.setattr(sections, "trained_on", lambda runs: noisy)
    model = noisy.model
    parts = list(what_the_model_says(run))
    tables = {part.stem: part for part in parts if isinstance(part, Table)}
    assert {"regret", "predictions", "terms", "model"} <= set(tables)
    for plot in (part for part in parts if isinstance(part, Plot)):
        plot.draw()
    whole = tables["regret_at_all_budgets"].rows
    lights = whole[(whole["metric"] == "RMSE") & (whole["league"] == "all")]
    better = int((lights["taken"] == "by features").sum())
    words = next(one for one in sentences(model) if one.startswith("By RMSE, league all: choosing"))
    assert f"at {better} of {len(lights)} budgets" in words
    off = np.abs(model.residuals["flip"])
    assert f"a factor of {np.exp(np.nanmedian(off)):.2f};" in next(
        one for one in sentences(model) if one.startswith("By FLIP, half")
    )


def test_a_few_maps_make_no_model(tmp_path):
    assert list(what_the_model_says(law_run(tmp_path, maps=3))) == []
    assert sections.findings(law_run(tmp_path, maps=3)) == ()


@pytest.fixture(scope="module")
def files(run, tmp_path_factory):
    """A run's folder, a model made from it by the command, and a map."""
    folder = tmp_path_factory.mktemp("files")
    facts = dict(run.record)
    write_run(folder / "run", run.rows, facts)
    train_advice([folder / "run"], folder / "model.json")
    write_exr(folder / "sky.exr", stress_map("sun-and-sky").radiance)
    return folder


def ask(files, capsys, **changed):
    given = {
        "lights": 0, "rays": 0.0, "seconds": 0.0, "error": 0.0, "metric": "rmse", "league": "all",
        "width": 64, "height": 48, "subpixels": 1, "model": files / "model.json", "picture": None,
        "repair": False, "as_json": False,
    }  # fmt: skip
    advise_command(str(files / "sky.exr"), **(given | changed))
    return capsys.readouterr().out


def test_the_command_trains_what_the_library_does(files, model):
    wanted = replace(model, source={**model.source, "runs": ["run"]})
    assert (files / "model.json").read_text(encoding="utf-8") == to_json(wanted)


def test_the_command_says_all_of_it(files, capsys):
    told = ask(files, capsys, lights=16)
    columns = map_features(EnvironmentMap.from_file(files / "sky.exr"))
    wanted = advise(load_model(files / "model.json"), columns, Wish("lights", 16, "rmse"))
    assert told.startswith(f"sky: {wanted.chosen.sampler} with 16 lights")
    for words in (
        f"expected RMSE {wanted.chosen.error:.4f}, between {wanted.chosen.low:.4f} and",
        f"then {wanted.runner_up.sampler} with 16",
        f"{100 * wanted.sureness:.0f} % of the measured maps the order would stay",
        "on maps left out, choosing by features gives",
        *(f"    {one.name}: " for one in wanted.alike),
        *(one.feature for one in wanted.level),
        f"known from 60 maps in images of {SIZE[0]}×{SIZE[1]} pixels; errors are means over the "
        "scenes rubiks-cube, vase",
        "mostly 0.80 to 1.20 times that",
        shlex.quote(str(files / "sky.exr")),
    ):
        assert words in told
    assert json.loads(ask(files, capsys, lights=16, as_json=True))["chosen"]["sampler"] == (
        wanted.chosen.sampler
    )


def test_the_command_draws_the_map_among_all(files, capsys):
    picture = files / "among.svg"
    ask(files, capsys, picture=picture)
    drawn = picture.read_text(encoding="utf-8")
    assert "sky" in drawn and "most alike maps" in drawn


def test_a_picture_of_another_kind_is_refused(files, capsys):
    with pytest.raises(EnvlightError, match=r"--picture .*among\.jpg: name a file \.svg, "):
        ask(files, capsys, picture=files / "among.jpg")


def test_two_budgets_are_refused(files, capsys):
    with pytest.raises(EnvlightError, match="--lights and --rays: give one of them"):
        ask(files, capsys, lights=4, rays=3.0)


def test_the_command_that_is_given_makes_the_lights(model):
    columns = HIGH
    fixed = advise(model, columns, Wish("lights", 8, "rmse", "fixed")).chosen
    assert command_for("my sky.exr", fixed, "layers") == (
        f"envlight lights 'my sky.exr' --sampler {fixed.sampler} --count 8"
    )
    drawn = advise(model, columns, Wish("lights", 8, "rmse", "distribution")).chosen
    assert command_for("a.exr", drawn, "distribution").startswith("envlight render a.exr --sampler")


def test_the_probe_is_kept(model, tmp_path, monkeypatch):
    probes = []
    monkeypatch.setattr(speed, "probe", lambda: probes.append(1) or 3e-8)
    assert REFERENCE in SAMPLERS and model.machine_seconds == pytest.approx(1e-8)
    first, second = speed.speed_here(model, tmp_path), speed.speed_here(model, tmp_path)
    assert (first, second) == ((pytest.approx(3.0), False), (pytest.approx(3.0), True))
    assert len(probes) == 1
    for damaged in ("", "[]", '{"a": "b"}'):
        (tmp_path / speed.FILE).write_text(damaged, encoding="utf-8")
        assert not speed.speed_here(model, tmp_path)[1]
    (tmp_path / "file").write_text("", encoding="utf-8")
    assert speed.speed_here(model, tmp_path / "file")[0] == pytest.approx(3.0)


def test_a_probe_is_a_time_for_a_ray():
    found = speed.probe()
    # Between ten thousand and ten billion rays a second.
    assert 1e-10 < found < 1e-4
