"""The room of places has one door, and what the door says about adding a place is true."""

import ast
import re
import textwrap
from pathlib import Path

import numpy as np

from experiments.maps import places
from experiments.maps.places import catalogue, rooms

ROOT = Path(__file__).parents[4]
ROOM = "experiments.maps.places"
ALLOWED = (Path("experiments/maps/places"), Path("tests/experiments/maps/places"))


def imported(file: Path) -> set[str]:
    """Absolute names of modules, or members of modules, that a file imports anywhere."""
    text = file.read_text(encoding="utf-8")
    if "places" not in text:
        return set()
    found: set[str] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def test_nothing_outside_imports_from_inside():
    door = {f"{ROOM}.{name}" for name in places.__all__}
    files = [
        file
        for package in ("samplers", "renderer", "metrics", "experiments", "tests", "examples")
        for file in (ROOT / package).rglob("*.py")
        if not any(file.is_relative_to(ROOT / allowed) for allowed in ALLOWED)
    ]
    assert len(files) > 100
    inside = {
        (str(file.relative_to(ROOT)), name)
        for file in files
        for name in imported(file)
        if name.startswith(f"{ROOM}.") and name not in door
    }
    assert not inside


def test_the_example_of_the_first_page_adds_a_map(monkeypatch):
    monkeypatch.setattr(catalogue, "_entries", dict(catalogue._entries))
    (example,) = re.findall(r"\n(    @embedded_map.*?)\n\n", places.__doc__, re.DOTALL)
    # Without an edit it works in the module that it names.
    exec(textwrap.dedent(example), vars(rooms) | {"__name__": "example"})
    assert set(places.names()) == set(catalogue._entries)
    assert places.kind("cell") == "interior"
    radiance = places.make("cell", 32).radiance
    assert radiance.min() > 0.0
    # The lamp's disc: 40 times a black body's colour, over the share of a texel that it covers.
    assert radiance.max() > 10.0 * np.median(radiance)


def test_the_first_page_names_every_module():
    modules = {file.stem for file in Path(places.__file__).parent.glob("*.py")}
    modules -= {"__init__", "catalogue"}
    words = set(re.findall(r"[a-z_]+", places.__doc__))
    assert modules <= words
