"""Reads the parameters of OpenSCENARIO files, with those that a variation sets."""

import math
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from itertools import product
from pathlib import Path

_WORDS = {name: getattr(math, name) for name in ("pi", "sin", "cos", "acos", "atan", "sqrt", "pow")}


@dataclass(frozen=True)
class File:
    """The parameters that a base file declares, and the sets of values of a variation of it."""

    declared: dict[str, str]
    sets: list[dict[str, str]]

    def cases(self) -> list[dict[str, object]]:
        """All parameters of every case, worked out."""
        return [_worked_out({**self.declared, **one}) for one in self.sets]


def variation(path: Path) -> File:
    """A variation and the base file that it names."""
    root = ElementTree.parse(path).getroot()
    base = (path.parent / root.find(".//ScenarioFile").get("filepath")).resolve()
    axes = []
    for one in root.iter():
        if one.tag == "DeterministicSingleParameterDistribution":
            name = one.get("parameterName")
            axes.append([{name: value} for value in _values(one)])
        if one.tag == "DeterministicMultiParameterDistribution":
            axes.append(
                [
                    {each.get("parameterRef"): each.get("value") for each in values}
                    for values in one.iter("ParameterValueSet")
                ]
            )
    sets = [{k: v for one in chosen for k, v in one.items()} for chosen in product(*axes)]
    return File(declared(base), sets)


def declared(path: Path) -> dict[str, str]:
    """The parameters that a file declares, as they are written."""
    found = ElementTree.parse(path).getroot().iterfind("./ParameterDeclarations/*")
    return {one.get("name"): one.get("value") for one in found}


def limits(path: Path, name: str) -> tuple[float, float]:
    """The least and the most that a parameter may be."""
    (one,) = (
        each
        for each in ElementTree.parse(path).getroot().iter("ParameterDeclaration")
        if each.get("name") == name
    )
    bounds = {each.get("rule"): float(each.get("value")) for each in one.iter("ValueConstraint")}
    return bounds["greaterOrEqual"], bounds["lessOrEqual"]


def sizes(path: Path) -> dict[str, tuple[float, float, float]]:
    """Length, width and height of every entry of a catalogue."""
    found = {}
    for entry in ElementTree.parse(path).getroot().find("Catalog"):
        box = entry.find(".//Dimensions")
        found[entry.get("name")] = tuple(
            float(box.get(side)) for side in ("length", "width", "height")
        )
    return found


def _values(axis: ElementTree.Element) -> list[str]:
    steps = axis.find("DistributionRange")
    if steps is None:
        return [element.get("value") for element in axis.iter("Element")]
    step = float(steps.get("stepWidth"))
    span = steps.find("Range")
    low, high = float(span.get("lowerLimit")), float(span.get("upperLimit"))
    return [repr(low + n * step) for n in range(round((high - low) / step) + 1)]


def _worked_out(texts: dict[str, str]) -> dict[str, object]:
    known: dict[str, object] = {}

    def value(name: str) -> object:
        if name not in known:
            known[name] = _number(texts[name], value)
        return known[name]

    return {name: value(name) for name in texts}


def _number(text: str, value) -> object:
    if text.startswith("${"):
        formula = re.sub(r"\$(\w+)", lambda found: f"({value(found[1])!r})", text[2:-1])
        assert re.fullmatch(r"[\w\s.+*/(),'-]*", formula), formula
        return eval(formula, {"__builtins__": {}}, _WORDS)  # arithmetic alone, checked above
    try:
        return float(text)
    except ValueError:
        return text
