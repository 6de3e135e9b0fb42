"""A mechanism as a model file to start from: every table and key is explained where it first occurs."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..builder import Builder
from ..builder.records import BodyRecord, Description, Solid
from ..shapes import Plate
from . import schema
from .toml_writer import document

SLENDER = 12.0
"""Length of a link over its width."""
FLAT = 4.0
"""Width of a link over its thickness."""
DIGITS = 4
"""Significant digits of the sizes of plates, which stand for rods."""
WIDEST = 110
"""Columns of a line with its comment."""
PLAIN = ("partita", "type")
"""Keys that need no words."""
HEAD = re.compile(r"\[\[?(\w+)\]?\]")
KEY = re.compile(r"(\w+) = ")


def commented(mechanism: Builder, head: Sequence[str]) -> str:
    """The text of a model file; `head` are the comments at its beginning. Raises as `document`."""
    lines = [f"# {line}".rstrip() for line in head]
    return "\n".join([*lines, "", *_explained(document(mechanism).splitlines()), ""])


def with_plates(mechanism: Builder) -> Builder:
    """The mechanism with plates in place of slender rods: of the same mass and axes, as wide as a twelfth of their
    length, with holes for pins at both ends. Rods without mass stay."""
    d = mechanism._description
    drawn = Builder(d.name, (0.0, 0.0, 0.0), d.drawing_tolerance)
    changed: Description = d.copy()
    for name, record in d.bodies.items():
        if record.rod is not None and record.mass > 0.0:
            changed.bodies[name] = _plate(record, record.rod[2])
    drawn._description = changed
    return drawn


def _plate(record: BodyRecord, length: float) -> BodyRecord:
    half = _rounded(length / SLENDER / 2.0, 2)
    end = _rounded(length, DIGITS)
    long = _rounded(end + half, DIGITS)
    outline = [(-half, -half), (long, -half), (long, half), (-half, half)]
    radius = _rounded(half / 2.0, DIGITS)
    shape = Plate(outline, _rounded(2.0 * half / FLAT, DIGITS), [((0.0, 0.0), radius), ((end, 0.0), radius)])
    inertia = (record.mass / shape.volume) * shape.inertia
    return replace(record, rod=None, inertia=inertia, com=shape.centroid, solid=Solid(shape, "mass", record.mass))


def _rounded(x: float, digits: int) -> float:
    return float(f"{x:.{digits}g}")


def _explained(lines: Sequence[str]) -> Iterator[str]:
    """The lines of a document with comments: before the first table of a kind, and behind keys that are new."""
    known, seen = schema.load()["properties"], set[str]()
    keys: Mapping[str, Any] = {}
    for i, line in enumerate(lines):
        if found := HEAD.fullmatch(line):
            rule = known[found[1]]
            about, keys = [rule["description"]], rule.get("items", rule).get("properties", {})
            if "oneOf" in rule.get("items", {}):
                kind = next(x.partition('"')[2].rstrip('"') for x in lines[i:] if x.startswith("type = "))
                form = schema.load()["$defs"][kind]
                about, keys = [*about, f"{kind}: {form['description']}"], form["properties"]
            yield from (f"# {words}" for words in about if words not in seen)
            seen.update(about)
        elif found := KEY.match(line):
            words = "" if found[1] in PLAIN else keys.get(found[1], {}).get("description", "")
            yield _with_comment(line, words) if words and words not in seen else line
            seen.add(words)
            continue
        yield line


def _with_comment(line: str, about: str) -> str:
    """Behind the line, or before it where that is too wide or the value goes on below."""
    beside = f"{line}  # {about}"
    return beside if len(beside) <= WIDEST and not line.endswith("[") else f"# {about}\n{line}"
