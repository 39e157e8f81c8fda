"""`envlight check`: every fault is found and told in words; `envlight new` writes what passes."""

import json
import textwrap

import pytest
import typer

from experiments.cli.main import main
from experiments.cli.own_sampler import check, check_sampler, new
from experiments.run.sampler_spec import single_sampler
from samplers import EnvlightError
from samplers.conformance.advice import ADVICE
from samplers.conformance.suite import CHECKS

NEWLINE = "\n"
HEAD = """
from dataclasses import dataclass
import math
import numpy as np
from samplers import DirectionalLights, EnvironmentMap, LightSampler
from samplers.sphere import pixel_directions

UP = [[0.0, 1.0, 0.0]]

class Uniform:
    count = 16
    DENSITY = 1 / (4 * math.pi)
    def sample(self, u):
        z, phi = 2 * u[:, 0] - 1, 2 * math.pi * u[:, 1]
        r = np.sqrt(np.maximum(0, 1 - z * z))
        d = np.stack([r * np.cos(phi), z, r * np.sin(phi)], axis=1).astype(np.float32)
        return d, np.full(len(d), self.DENSITY, np.float32)
    def pdf(self, direction):
        return np.full(len(direction), self.DENSITY, np.float32)

@dataclass(frozen=True)
class Faulty(LightSampler):
    def _prepare(self, environment, count, rng):
"""


def status(*words) -> int:
    """The exit status of `envlight check`."""
    with pytest.raises(typer.Exit) as end:
        check(*words)
    return end.value.exit_code


@pytest.fixture
def findings(tmp_path):
    def findings(body: str, head: str = HEAD):
        path = tmp_path / "faulty.py"
        path.write_text(head + textwrap.indent(textwrap.dedent(body), " " * 8))
        return {f.check: f for f in check_sampler(single_sampler(f"{path}:Faulty"), {})}

    return findings


@pytest.mark.parametrize(
    ("body", "failing", "seen"),
    [
        ("return None", "lighting", "noise: it returned None, not DirectionalLights, Lay"),
        ("return UP, UP", "lighting", "it returned a tuple, not Dir"),
        ("return 1 // 0", "lighting",
         f"faulty.py: line {1 + HEAD.count(NEWLINE)}: ZeroDivisionError: "),
        ("raise SystemExit(0)", "lighting", "SystemExit: 0"),
        ("raise GeneratorExit('enough')", "lighting", "GeneratorExit: enough"),
        ("return DirectionalLights(UP, [[1, 1]], [0])", "lighting", "shape (1, 2), wanted (n, 3)"),
        ("return DirectionalLights(UP, [[np.nan] * 3], [0])", "lighting", "NaN or infinity"),
        ("return DirectionalLights([[0, 0, 0]], UP, [0])", "lighting", "not of unit length"),
        ("return DirectionalLights(UP, [[-1, 0, 0]], [0])", "lighting", "negative irradiance"),
        ("u = Uniform(); u.sample = lambda u: np.zeros((len(u), 3)); return u",
         "lighting", "sample returned a ndarray, not (direction, pdf)"),
        ("u = Uniform(); u.pdf = lambda d: np.zeros((len(d), 1), np.float32); return u",
         "lighting", "pdf has shape (257, 1), not (257,)"),
        ("u = Uniform(); z = np.zeros; u.sample = lambda u: (z((len(u), 3), np.float32), "
         "z(len(u), np.float32)); return u", "lighting", "a direction of length zero"),
        ("u = Uniform(); u.count = count; u.DENSITY *= 2; return u",
         "pdf-integral", "the integral is 2"),
        ("u = Uniform(); u.count = count; u.pdf = lambda d: np.full(len(d), 0.2, np.float32); "
         "return u", "pdf-of-samples", "densities disagree"),
        ("return DirectionalLights(UP, [environment.total_flux / 2], [0])", "energy", "flux off"),
        ("return DirectionalLights(UP, [environment.total_flux], [0])", "single-texel", "rad off"),
        ("return DirectionalLights(UP, [environment.total_flux], [0])", "irradiance", "is off by"),
        ("return DirectionalLights(UP * 2, [[1, 1, 1]] * 2, [0, 0])", "every-map-and-count", "2 l"),
        ("d = np.random.default_rng().normal(size=(1, 3)); d /= np.linalg.norm(d); "
         "return DirectionalLights(d, [environment.total_flux], [0])",
         "determinism", "two runs differ"),
    ],
)  # fmt: skip
def test_a_fault_is_found_and_told(findings, body, failing, seen):
    found = findings(body)[failing]
    assert (found.status, found.look) == ("failed", ADVICE[failing])
    assert seen in found.seen
    assert found.expected


@pytest.mark.parametrize(
    ("body", "said"), [("1 // 0", "faulty.py: line "), ("return UP", "sampler returned list")]
)
@pytest.mark.parametrize("command", ["inspect", "render"])
def test_a_fault_ends_a_command_in_a_sentence(tmp_path, monkeypatch, capfd, command, body, said):
    (tmp_path / "faulty.py").write_text(HEAD + " " * 8 + body)
    words = f"{command} overcast-moor --count 4 --output {tmp_path / 'out.png'} --sampler".split()
    monkeypatch.setattr("sys.argv", ["envlight", *words, f"{tmp_path / 'faulty.py'}:Faulty"])
    with pytest.raises(SystemExit, match="2"):
        main()
    assert said in capfd.readouterr().err


def test_a_class_that_is_not_decorated_is_told(findings):
    found = findings("return DirectionalLights.none()", HEAD.replace("@dataclass(frozen=True)", ""))
    assert "is not decorated with @dataclass(frozen=True)" in found["lighting"].seen


def test_what_builds_on_a_failed_check_is_left_out(findings):
    found = findings("return None")
    assert {f.status for name, f in found.items() if name != "lighting"} == {"left out"}


def test_every_check_has_advice_and_says_what_it_expects():
    assert set(ADVICE) == set(CHECKS)
    assert all(check.__doc__ for check in CHECKS.values())


def test_exit_status_and_text(capsys):
    assert status("uniform", [], False) == 0
    out = capsys.readouterr().out
    assert "allowed rotation (its cells are fixed to the frame" in out
    assert "ok      irradiance (fewer than asked for: 2 lights of 16 on smallest; " in out
    assert out.endswith("uniform: all 11 checks passed\n")


def test_what_is_allowed_must_fail(tmp_path, capsys):
    assert status("uniform", ["energy"], True) == 1
    found = {f["check"]: f for f in json.loads(capsys.readouterr().out)["checks"]}
    assert found["energy"]["seen"] == "it passed"
    with pytest.raises(EnvlightError, match="no check is called 'x'; there are lighting, "):
        check("uniform", ["x"], False)


def test_a_new_sampler_passes_every_check(tmp_path, capsys):
    new("quite_new", tmp_path)
    path = tmp_path / "quite_new.py"
    assert f"envlight check {path}:QuiteNew" in capsys.readouterr().out
    assert status(f"{path}:QuiteNew", [], False) == 0
    assert "quite-new: all 11 checks passed" in capsys.readouterr().out
    assert single_sampler(f"{path}:QuiteNew[spread=0.5]").sampler.spread == 0.5


def test_a_new_sampler_overwrites_nothing(tmp_path):
    new("quite_new", tmp_path)
    (tmp_path / "quite_new.py").write_text("mine")
    with pytest.raises(EnvlightError, match=r"quite_new.py: it exists; remove it or take"):
        new("quite_new", tmp_path)
    assert (tmp_path / "quite_new.py").read_text() == "mine"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        *((name, "in lower case with underscores") for name in
          ("My", "a-b", "../a", "a b", "class", "", "1a", "a__b", "é")),
        ("median_cut", "a sampler is called 'median-cut' already"),
        ("random", "a module of Python is called so"),
    ],
)  # fmt: skip
def test_names_that_cannot_be_are_refused(tmp_path, name, said):
    with pytest.raises(EnvlightError, match=said):
        new(name, tmp_path)
    assert list(tmp_path.iterdir()) == []
