"""Scenes of Mitsuba 3 and 0.6 in XML (mitsuba.readthedocs.io), for `written_scene.py`.

Read are `sensor` (the first), `bsdf`, `shape` and `emitter`, with `default` and `ref`.
"""

import math
import re
import xml.etree.ElementTree as xml
from pathlib import Path
from typing import Any

import numpy as np

from renderer.modelling.shape import Matrix, affine, look_at, rotation

SETTINGS = ("default", "integrator", "bsdf", "texture", "sensor")
"""At the top of a file: settings of rendering, or what is read where it is named."""

Named = dict[str | xml.Element | None, Any]
"""Elements by their names, and what has been made of elements."""


def content(path: Path) -> dict[str, Any]:
    """What a file says; ParseError, LookupError, TypeError or ValueError of other files."""
    root = xml.fromstring(path.read_bytes())
    given = {one.attrib["name"]: one.attrib["value"] for one in root.iter("default")}
    for element in root.iter():
        for key, value in element.items():
            element.set(key, re.sub(r"\$(\w+)", lambda found: given[found[1]], value))
    named: Named = {one.get("id"): one for one in root.iter() if one.tag != "ref"}
    found: dict[str, Any] = {"shapes": [], "lights": []}
    for element in root:
        if element.tag in ("shape", "emitter"):
            kind = "shapes" if element.tag == "shape" else "lights"
            found[kind].append(_entry(element, named))
        elif element.tag == "sensor" and "sensor" not in found:
            found["sensor"] = _entry(element, named)
        elif element.tag not in SETTINGS:
            raise ValueError(f"<{element.tag}> is not read; take it out")
    return found


def _entry(element: xml.Element, named: Named) -> dict[str, Any]:
    """A plugin as a dictionary, as Mitsuba's `load_dict` has it; names as those of version 3."""
    result: dict[str, Any] = {"type": element.get("type", ""), "id": element.get("id", "")}
    if element.tag == "emitter":  # of which only this is told
        return result | {x.get("name", ""): x.get("value") for x in element.findall("string")}
    for one in element:
        target = named[one.attrib["id"]] if one.tag == "ref" else one
        name = re.sub("(?<=[a-z])([A-Z]+)", r"_\1", one.get("name") or target.tag).lower()
        if target not in named:  # once, as elements may refer to others again and again
            named[target] = _value(target, named)
        result[name] = named[target]
        given = [step.get("up") for step in one if step.tag.lower() == "lookat"]
        if given:
            result["up"] = _numbers(given[-1] or "0, 1, 0")
    return result


def _value(one: xml.Element, named: Named) -> Any:
    text = one.get("value", "")
    match one.tag:
        case "float" | "integer":
            return float(text)
        case "boolean":
            return text.lower() == "true"
        case "string":
            return text
        case "rgb" | "spectrum" | "point" | "vector":
            return _triple(one, 0.0)
        case "transform":
            return _matrix(one)
    return _entry(one, named)


def _numbers(text: str) -> list[float]:
    return [float(number) for number in re.split(r"[\s,]+", text.strip())]


def _triple(one: xml.Element, default: float) -> list[float]:
    """Three numbers: `value`, where one stands for all, or x, y and z."""
    if "value" not in one.attrib:
        return [float(one.get(axis, default)) for axis in "xyz"]
    values = _numbers(one.attrib["value"])
    return values * 3 if len(values) == 1 else values


def _matrix(transform: xml.Element) -> Matrix:
    """The product of a transform's steps; the first of them is applied first."""
    result = np.eye(4)
    for one in transform:
        match one.tag.lower():
            case "translate":
                step = affine(offset=_triple(one, 0.0))
            case "scale":
                step = affine(np.diag(_triple(one, 1.0)))
            case "rotate":
                step = affine(rotation(float(one.attrib["angle"]), _triple(one, 0.0)))
            case "lookat":
                step = look_at(
                    *(_numbers(one.get(k, "0, 1, 0")) for k in ("origin", "target", "up"))
                )
            case "matrix":
                values = np.array(_numbers(one.attrib["value"]))
                side = math.isqrt(len(values))
                step = np.eye(4)
                step[:side, :side] = values.reshape(side, side)
            case other:
                raise ValueError(f"<{other}> in a transform")
        result = step @ result
    return result
