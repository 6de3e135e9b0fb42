"""What the members of a sweep returned, and the labelled dataset of it."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from .members import FAILED, SAMPLE, Members

if TYPE_CHECKING:
    import xarray

Packed = tuple[str, bytes]
"""The layout of arrays, and their bytes."""
Storable = Packed | str
"""What a store can hold of an answer."""
Answer = Storable | dict[str, Any]
"""The arrays that a member returned, packed if they are their bytes; or the reason why it failed."""
NOT_COMPUTED = "not computed"
_PLAIN = frozenset((float, int, bool, complex, str))
"""Types of values that cannot change."""
KINDS = "biufcSUmM"
"""Kinds of NumPy's types whose arrays are their bytes."""


class Plain(dict[Any, Any]):
    """Values that a member returned and that cannot change any more; `packed` makes an answer of them at any time."""


def answer_of(model: Callable[..., Any], arguments: Mapping[str, Any]) -> Answer:
    """Call the model."""
    return packed(call(model, arguments))


def call(model: Callable[..., Any], arguments: Mapping[str, Any]) -> Answer | Plain:
    """Call the model. Numbers are not packed yet: all those of a batch together cost a fraction of one after each
    member, whose work has displaced what packs from the caches of the processor."""
    try:
        returned = model(**arguments)
        is_dict = type(returned) is dict or isinstance(returned, Mapping)
        values: Mapping[Any, Any] = returned if is_dict else {"value": returned}
        if _PLAIN.issuperset(map(type, values.values())):
            return Plain(values)
    except Exception as error:
        return reason(error)
    return _answer(values)


def packed(answer: Answer | Plain) -> Answer:
    """What a call left, as an answer."""
    return _answer(answer) if isinstance(answer, Plain) else answer


def _answer(returned: Mapping[Any, Any]) -> Answer:
    try:
        arrays = {str(name): np.asarray(value) for name, value in returned.items()}
        if all(value.dtype.kind in KINDS for value in arrays.values()):
            layout = _layout(tuple((name, value.dtype, value.shape) for name, value in arrays.items()))
            return layout, b"".join([value.tobytes() for value in arrays.values()])
        return {name: value.copy() for name, value in arrays.items()}
    except Exception as error:
        return reason(error)


@lru_cache(maxsize=256)
def _layout(key: tuple[tuple[str, np.dtype[Any], tuple[int, ...]], ...]) -> str:
    """Names, types and shapes as a text, the same object for all answers of a batch."""
    return json.dumps([[name, kind.str, shape] for name, kind, shape in key])


def unpacked(layout: str, bodies: list[bytes]) -> dict[str, Any]:
    """The arrays of several answers with one layout, stacked."""
    fields = [(name, (f"{i}", kind, tuple(shape))) for i, (name, kind, shape) in enumerate(json.loads(layout))]
    kind = np.dtype([field for _, field in fields])
    rows = np.frombuffer(b"".join(bodies), kind) if kind.itemsize else np.zeros(len(bodies), kind)
    return {name: rows[field[0]] for name, field in fields}


def reason(error: BaseException) -> str:
    """An error as the reason of a failure."""
    return f"{type(error).__name__}: {error}"


def dataset(members: Members, answers: Mapping[int, Answer], elsewhere: str = NOT_COMPUTED) -> xarray.Dataset:
    """The dataset of all members. It depends on the answers alone, not on the order in which they came."""
    import xarray

    groups, failed, kinds = _fitting(members, answers)
    sizes = tuple(members.sizes.values())
    known = np.concatenate([np.zeros(0, int), *(indices for indices, _ in groups)])
    variables: dict[str, Any] = {}
    for name, kind in kinds.items():
        having = [(indices, arrays[name]) for indices, arrays in groups if name in arrays]
        shape = having[0][1].shape[1:]
        if sum(len(indices) for indices, _ in having) < members.count and kind.kind in "biu":
            kind = np.dtype(float)  # which has NaN
        values = np.full((members.count, *shape), _blank(kind), dtype=kind)
        for indices, rows in having:
            values[indices] = rows
        axes = tuple(f"{name}_axis{i}" for i in range(len(shape)))
        variables[name] = ((*members.sizes, *axes), values.reshape(sizes + shape))
    reasons = np.full(members.count, elsewhere, dtype=object)
    reasons[known] = ""
    for member, why in failed.items():
        reasons[member] = why
    variables[FAILED] = (tuple(members.sizes), reasons.astype(str).reshape(sizes))
    return xarray.Dataset(variables, coords=members.coordinates())


Group = tuple[Any, dict[str, Any]]
"""Members, and their arrays, stacked."""


def _fitting(
    members: Members, answers: Mapping[int, Answer]
) -> tuple[list[Group], dict[int, str], dict[str, np.dtype[Any]]]:
    """Answers, failures, and the type of each variable.

    Answers that do not fit into one dataset with those of members before them are failures.
    """
    failed = {member: answer for member, answer in answers.items() if isinstance(answer, str)}
    found: list[Group] = []
    shapes: dict[str, tuple[int, ...]] = {}
    kinds: dict[str, np.dtype[Any]] = {}
    reserved = {FAILED, SAMPLE, *members.values}
    for indices, arrays in _grouped(answers):
        why = ""
        wider: dict[str, np.dtype[Any]] = {}
        for name, rows in arrays.items():
            known = shapes.get(name, rows.shape[1:])
            if name in reserved:
                why = f"the model returns {name!r}, which the dataset uses for something else: rename it"
            elif known != rows.shape[1:]:
                why = f"{name} has the shape {rows.shape[1:]}, elsewhere {known}; it must be the same throughout"
            else:
                try:
                    wider[name] = np.result_type(kinds.get(name, rows.dtype), rows.dtype)
                except TypeError:
                    why = f"{name} has the type {rows.dtype}, elsewhere {kinds[name]}, which have none in common"
        if why:
            failed |= dict.fromkeys(indices.tolist(), why)
        else:
            found.append((indices, arrays))
            kinds |= wider
            for name, rows in arrays.items():
                shapes.setdefault(name, rows.shape[1:])
    return found, failed, kinds


def _grouped(answers: Mapping[int, Answer]) -> list[Group]:
    """Answers of one layout together, in the order of their first members."""
    packed: dict[str, list[int]] = {}
    groups: list[Group] = []
    for member, answer in sorted(answers.items()):
        if isinstance(answer, tuple):
            packed.setdefault(answer[0], []).append(member)
        elif not isinstance(answer, str):
            groups.append((np.array([member]), {name: value[None] for name, value in answer.items()}))
    for layout, indices in packed.items():
        groups.append((np.array(indices), unpacked(layout, [answers[index][1] for index in indices])))  # type: ignore[index,misc]
    return sorted(groups, key=lambda group: int(group[0][0]))


def _blank(kind: np.dtype[Any]) -> Any:
    """What stands where nothing is known."""
    if kind.kind in "fc":
        return np.nan
    if kind.kind in "mM":
        return np.array("NaT", kind)
    return None if kind.kind == "O" else np.zeros((), kind)[()]
