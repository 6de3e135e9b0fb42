"""A scene without entries that its page can restore: in large mechanisms these would be as large as the motion."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

WHOLE = 1e9
"""Whole numbers below this are written without a point. Scale: 1. Reason: as many digits as others have."""
DIGITS = 9
"""Of lengths in a description; the motion itself is kept in single precision."""


def slim(scene: Mapping[str, Any]) -> dict[str, Any]:
    """The scene with fewer entries; `filled` in data.js is its inverse.

    Joints lose absent properties, curves default ones, numbers invisible digits.
    """
    bodies = [_short({**body}) for body in scene["bodies"]]
    joints = [_short({key: x for key, x in joint.items() if x not in (None, [False, False])})
              for joint in scene["joints"]]  # fmt: skip
    return {**scene, "bodies": bodies, "joints": joints, "curves": [_curve(curve) for curve in scene["curves"]]}


def _curve(curve: Mapping[str, Any]) -> dict[str, Any]:
    if curve["size"]:  # a joint's force or moment: the label determines all other entries
        return {"load": curve["columns"][0] // 3, "of": curve["table"]}
    usual = {"labels": [""], "size": False, "open": False}
    return {key: x for key, x in curve.items() if key not in usual or x != usual[key]}


def _short(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _short(x) for key, x in value.items()}
    if isinstance(value, list | tuple):
        return [_short(x) for x in value]
    if isinstance(value, float):
        short = float(f"{value:.{DIGITS}g}")
        return int(short) if short.is_integer() and abs(short) < WHOLE else short
    return value
