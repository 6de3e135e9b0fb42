"""JSON: the whole result in one readable file."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from ...files import BLANK, Allowance, sealed
from ..content import TYPES, Content, read_header
from ..record import plain

INFINITE = {np.inf: "Infinity", -np.inf: "-Infinity"}


def write(content: Content) -> bytes:
    """Description and arrays, sealed; numbers to full precision, null for NaN, "Infinity" and "-Infinity" in words."""
    return sealed(json.dumps(document(content), ensure_ascii=False, separators=(",", ":")).encode("utf-8"))


def document(content: Content) -> dict[str, Any]:
    """The header, with `values` beside each array's description."""
    header = content.header(checksum=BLANK)
    for variable in content.variables:
        header["arrays"][variable.name]["values"] = plain(variable.values, INFINITE.get)
    return header


def read(content: bytes, room: Allowance) -> tuple[dict[str, Any], dict[str, Any]]:
    """Header and arrays. Raises `json.JSONDecodeError`, `UnicodeDecodeError` or errors from malformed data."""
    room.text(content)
    header = read_header(content.decode("utf-8"))
    arrays = header.get("arrays")
    if not isinstance(arrays, dict):
        return header, {}
    return header, {name: _values(about) for name, about in arrays.items()}


def _values(about: dict[str, Any]) -> Any:
    values, kind = about["values"], about["type"]
    return np.array(values, dtype=float if kind == "number" else TYPES[kind])
