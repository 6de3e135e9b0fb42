"""The content of a file of a result in any format: a description in words and numbers, and labelled arrays."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..files import Allowance
from ..result_view import ResultView
from .record import exact, read_exact
from .variables import Axis, Variable, axes, variables

VERSION = 3
"""Of the files."""

TYPES = {"number": np.dtype("f8"), "integer": np.dtype("i8"), "flag": np.dtype("?")}
"""Possible types of an array."""


@dataclass(frozen=True)
class Content:
    """Description, arrays and the labels along their axes."""

    account: dict[str, Any]
    variables: tuple[Variable, ...]
    axes: dict[str, Axis]

    def header(self, **more: Any) -> dict[str, Any]:
        """Everything but the values, as plain data: version, description, arrays, axes; and `more` near the
        beginning."""
        return {
            "partita_result": VERSION,
            **more,
            "account": self.account,
            "arrays": {v.name: described(v) for v in self.variables},
            "axes": {a.name: {"labels": list(a.labels), "units": list(a.units)} for a in self.axes.values()},
        }

    def text(self, **more: Any) -> str:
        """The header as JSON in ASCII, which every container can hold."""
        return json.dumps(self.header(**more), separators=(",", ":"))


def header_within(room: Allowance, text: str) -> dict[str, Any]:
    """The description in a file, whose arrays have room."""
    found = read_header(text)
    for about in found["arrays"].values():
        shape = [int(size) for size in about["shape"]]
        if min(shape, default=0) < 0:
            raise ValueError(f"an array has the shape {shape}")
        room.take(math.prod(shape) * TYPES[about["type"]].itemsize)
    return found


def content_of(result: ResultView) -> Content:
    """Everything to be stored of `result`, which is computed here if necessary."""
    found = tuple(_typed(v) for v in variables(result))
    used = {name for v in found for name in v.axes}
    certificate = exact(vars(result.certificate))  # first: it may find what ends the success of the run
    reported = {**result.record.account(), "certificate": certificate}
    return Content(reported, found, {name: axis for name, axis in axes(result).items() if name in used})


def described(variable: Variable) -> dict[str, Any]:
    """An array without its values."""
    kind = next(word for word, kind in TYPES.items() if kind == variable.values.dtype)
    return {
        "axes": list(variable.axes),
        "unit": variable.unit,
        "text": variable.text,
        "type": kind,
        "shape": list(variable.values.shape),
    }


def read_header(text: str) -> dict[str, Any]:
    """The inverse of `Content.text`; raises `ValueError` where it is no header."""
    header = read_exact(text)
    if not isinstance(header, dict) or "partita_result" not in header:
        raise ValueError("it is not a stored result: it contains no record of a run")
    return header


def restored(values: Any, about: Mapping[str, Any]) -> NDArray[Any]:
    """An array of the type and shape given in the header; `values` may have lost both in the container."""
    kind = TYPES[about["type"]]
    shape = tuple(int(size) for size in about["shape"])
    found = np.asarray(values)
    if len(shape) != len(about["axes"]):
        raise ValueError(f"an array has the shape {shape} along {len(about['axes'])} axes")
    if found.size != int(np.prod(shape, dtype=object)):
        raise ValueError(f"an array has {found.size} entries instead of {shape}")
    return np.ascontiguousarray(found.reshape(shape).astype(kind, copy=False))


def _typed(variable: Variable) -> Variable:
    kind = {"b": "flag", "i": "integer", "u": "integer"}.get(variable.values.dtype.kind, "number")
    values = np.ascontiguousarray(variable.values.astype(TYPES[kind], copy=False))
    return Variable(variable.name, values, variable.axes, variable.unit, variable.text)
