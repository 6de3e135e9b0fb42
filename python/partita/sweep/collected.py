"""What the members of a sweep returned, and the labelled dataset of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from .members import FAILED, SAMPLE, Members

if TYPE_CHECKING:
    import xarray

Answer = dict[str, Any] | str
"""The arrays that a member returned, or the reason why it failed."""
NOT_COMPUTED = "not computed"


def answer_of(model: Callable[..., Any], arguments: Mapping[str, Any]) -> Answer:
    """Call the model."""
    try:
        returned = model(**arguments)
        returned = returned if isinstance(returned, Mapping) else {"value": returned}
        return {str(name): np.array(value) for name, value in returned.items()}
    except Exception as error:
        return reason(error)


def reason(error: BaseException) -> str:
    """An error as the reason of a failure."""
    return f"{type(error).__name__}: {error}"


def dataset(members: Members, answers: Mapping[int, Answer], elsewhere: str = NOT_COMPUTED) -> xarray.Dataset:
    """The dataset of all members. It depends on the answers alone, not on the order in which they came."""
    import xarray

    found, failed, kinds = _fitting(members, answers)
    sizes = tuple(members.sizes.values())
    variables: dict[str, Any] = {}
    whole = len(found) == members.count
    for name, kind in kinds.items():
        shape = next(answer[name].shape for answer in found.values() if name in answer)
        if not (whole and all(name in answer for answer in found.values())) and kind.kind in "biu":
            kind = np.dtype(float)  # which has NaN
        values = np.full((members.count, *shape), _blank(kind), dtype=kind)
        for member, answer in found.items():
            if name in answer:
                values[member] = answer[name]
        axes = tuple(f"{name}_axis{i}" for i in range(len(shape)))
        variables[name] = ((*members.sizes, *axes), values.reshape(sizes + shape))
    reasons = np.full(members.count, elsewhere, dtype=object)
    reasons[list(found)] = ""
    for member, why in failed.items():
        reasons[member] = why
    variables[FAILED] = (tuple(members.sizes), reasons.astype(str).reshape(sizes))
    return xarray.Dataset(variables, coords=members.coordinates())


def _fitting(
    members: Members, answers: Mapping[int, Answer]
) -> tuple[dict[int, dict[str, Any]], dict[int, str], dict[str, np.dtype[Any]]]:
    """Answers in the order of the members, failures, and the type of each variable.

    An answer that does not fit into one dataset with those of the members before it is a failure.
    """
    found: dict[int, dict[str, Any]] = {}
    failed: dict[int, str] = {}
    shapes: dict[str, tuple[int, ...]] = {}
    kinds: dict[str, np.dtype[Any]] = {}
    reserved = {FAILED, SAMPLE, *members.values}
    for member in sorted(answers):
        answer = answers[member]
        if isinstance(answer, str):
            failed[member] = answer
            continue
        wider: dict[str, np.dtype[Any]] = {}
        for name, value in answer.items():
            known = shapes.get(name, value.shape)
            if name in reserved:
                failed[member] = f"the model returns {name!r}, which the dataset uses for something else: rename it"
            elif known != value.shape:
                failed[member] = (
                    f"{name} has the shape {value.shape}, elsewhere {known}; it must be the same throughout"
                )
            else:
                try:
                    wider[name] = np.result_type(kinds.get(name, value.dtype), value.dtype)
                except TypeError:
                    failed[member] = (
                        f"{name} has the type {value.dtype}, elsewhere {kinds[name]}, which have none in common"
                    )
        if member not in failed:
            found[member] = answer
            kinds |= wider
            for name, value in answer.items():
                shapes.setdefault(name, value.shape)
    return found, failed, kinds


def _blank(kind: np.dtype[Any]) -> Any:
    """What stands where nothing is known."""
    if kind.kind in "fc":
        return np.nan
    if kind.kind in "mM":
        return np.array("NaT", kind)
    return None if kind.kind == "O" else np.zeros((), kind)[()]
