"""What an MJCF file asks for in all, counted before MuJoCo allocates it; and whether what it compiled is finite."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..builder.checks import LARGEST
from ..limits import exceeded
from ..tolerance import EQUAL_IN_SIX_DIGITS
from .xmltree import Element, refuse

_ASKED: dict[str, tuple[tuple[str, ...], int]] = {
    "hfield": (("nrow", "ncol"), 1),
    "numeric": (("size",), 1),
    "composite": (("count",), 64),
    "flexcomp": (("count",), 64),
    "mesh": (("params",), 1),
}
"""Attributes whose product counts what an element generates, and how many numbers each takes; those of textures count
for nothing, since none is made."""
_TABLES = ("nkey", "nuserdata")
"""Attributes of <size> that count tables for the whole model; those that begin with nuser_ count numbers of each
element."""
_HISTORY = ("nsample",)
_UNBOUNDED = ("range", "limit")
"""Ends of names of bounds, which may be infinite."""


def check(root: Element) -> None:
    """Refuse a file by the elements it has after repetitions, and by the numbers that it asks MuJoCo for."""
    elements = bodies = 0
    asked = 0.0
    per_element, tables = 1.0, 0.0
    waiting = [(root, 1)]
    while waiting:
        element, times = waiting.pop()
        elements += times
        bodies += times if element.tag == "body" else 0
        if (words := exceeded("elements", elements, "elements after repetitions")) is not None:
            element.fail(f"makes the model too large: it has {words}")
        if (words := exceeded("bodies", bodies, "bodies after repetitions")) is not None:
            element.fail(f"makes the model too large: it has {words}")
        keys, size = _ASKED.get(element.tag, ((), 0))
        own = math.prod(x for key in keys for x in _counts(element, key)) * size if keys else 0.0
        own += sum(x for key in _HISTORY for x in _counts(element, key))
        asked += own * times
        if element.tag == "size":
            tables += sum(x for key in _TABLES for x in _counts(element, key))
            per_element += sum(
                x for key in element.attributes if key.startswith("nuser_") for x in _counts(element, key)
            )
        if (words := exceeded("generated", _whole(asked), "numbers by its counts")) is not None:
            element.fail(f"asks for {words}")
        inside = times
        if element.tag == "replicate":
            inside *= max(_whole(next(_counts(element, "count"), 1.0)), 1)
        waiting += [(child, inside) for child in element.children]
    total = asked + tables * elements + per_element * elements
    if (words := exceeded("generated", _whole(total), "numbers by the counts in <size>")) is not None:
        root.fail(f"asks for {words}")


_COUNTED = 1e18
"""Larger counts are refused wherever they stand. Scale: 1. Reason: whole numbers of eight bytes."""


def _whole(x: float) -> int:
    return int(min(x, _COUNTED))


def _counts(element: Element, key: str) -> Iterator[float]:
    """The positive numbers of an attribute, as far as they are numbers."""
    for word in element.get(key).split()[:8]:
        try:
            found = float(word)
        except ValueError:
            continue
        if found > 0.0:
            yield min(found, _COUNTED)


def check_numbers(element: Element, names: tuple[str, ...]) -> None:
    """Refuse attributes with numbers that are not finite, or beyond the range of products. MuJoCo writes of NaN to its
    own log and continues."""
    for key, value in element.attributes.items():
        if key in names:
            continue
        for word in value.split():
            if word[-1] not in "0123456789.fFnNyY":  # of inf, infinity and nan
                continue
            try:
                found = abs(float(word))
            except ValueError:
                break  # a text, as a whole
            if math.isnan(found) or (found == math.inf and not key.endswith(_UNBOUNDED)):
                element.fail(f'has "{key}" "{value:.40}"; it takes finite numbers')
            if found > LARGEST and not key.endswith(_UNBOUNDED):
                element.fail(
                    f'has "{key}" "{value:.40}"; magnitudes above {LARGEST:g} are not supported: use other units'
                )


_NUMBERS: dict[str, tuple[str, ...]] = {
    "body": ("body_mass", "body_inertia", "body_ipos", "body_pos", "body_quat", "body_iquat", "body_gravcomp"),
    "joint": ("jnt_axis", "jnt_pos", "jnt_stiffness"),
    "site": ("site_pos", "site_quat"),
    "equality": ("eq_data",),
    "actuator": ("actuator_gear", "actuator_armature", "actuator_damping"),
    "tendon": ("tendon_stiffness", "tendon_damping", "tendon_lengthspring"),
    "degree of freedom": ("dof_damping", "dof_armature", "dof_frictionloss"),
}
_LENGTHS = {"body_quat": 1.0, "body_iquat": 1.0, "site_quat": 1.0, "jnt_axis": 1.0}


def check_compiled(mujoco: Any, model: Any, path: Path) -> None:
    """Refuse what MuJoCo made of numbers whose products left the range, or of directions without a length."""
    kinds = mujoco.mjtObj
    of = {"body": kinds.mjOBJ_BODY, "joint": kinds.mjOBJ_JOINT, "site": kinds.mjOBJ_SITE}
    of |= {"equality": kinds.mjOBJ_EQUALITY, "actuator": kinds.mjOBJ_ACTUATOR, "tendon": kinds.mjOBJ_TENDON}
    for what, fields in _NUMBERS.items():
        for key in fields:
            found = np.asarray(getattr(model, key, ()), dtype=float)
            if found.size == 0:
                continue
            rows = found.reshape(len(found), -1)
            bad = ~(np.abs(rows) <= LARGEST).all(axis=1)
            if key in _LENGTHS:
                bad |= np.abs((rows**2).sum(axis=1) - _LENGTHS[key]) > EQUAL_IN_SIX_DIGITS
            if bad.any():
                i = int(np.argmax(bad))
                name = (mujoco.mj_id2name(model, of[what], i) if what in of else None) or f"{i}"
                shown = " ".join(f"{x:g}" for x in rows[i][:10])
                words = f"{key} as MuJoCo compiled it is {shown}, which is not finite, too large, or no direction"
                refuse(path, None, f'{what} "{name:.40}": {words}; check lengths, masses and directions')
