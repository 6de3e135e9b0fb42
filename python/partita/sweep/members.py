"""Members of a sweep: the points of a grid, or a list of samples, with their parameters."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import ArgumentError
from ..numeric import shown

SAMPLE = "sample"
"""Dimension of a dataset of samples."""
FAILED = "failed"
"""Variable with the reasons of failures."""


@dataclass(frozen=True)
class Members:
    """The parameters by name: the values along each axis of a grid, or those of each sample."""

    values: Mapping[str, list[Any]]
    is_grid: bool

    @property
    def sizes(self) -> dict[str, int]:
        """Dimensions of the dataset with their lengths."""
        if self.is_grid:
            return {name: len(values) for name, values in self.values.items()}
        return {SAMPLE: len(next(iter(self.values.values())))}

    @property
    def count(self) -> int:
        """Number of members."""
        return math.prod(self.sizes.values())

    def arguments(self, member: int) -> dict[str, Any]:
        """Parameters of a member; the last axis of a grid runs fastest."""
        if not self.is_grid:
            return {name: values[member] for name, values in self.values.items()}
        found = {}
        for name, values in reversed(list(self.values.items())):
            member, i = divmod(member, len(values))
            found[name] = values[i]
        return {name: found[name] for name in self.values}

    def coordinates(self) -> dict[str, Any]:
        """Coordinates of the dataset."""
        labels = {name: _labels(values) for name, values in self.values.items()}
        if self.is_grid:
            return labels
        return {SAMPLE: np.arange(self.count), **{name: (SAMPLE, column) for name, column in labels.items()}}


def is_plain(value: Any) -> bool:
    """Whether it is a number, a text or a truth value, which can be a label and be written as such."""
    return isinstance(value, (bool, int, float, complex, str))


def _labels(values: list[Any]) -> Any:
    """One label for each value: itself, or the text that shows it."""
    return values if all(map(is_plain, values)) else [shown(value) for value in values]


def members_of(parameters: Any) -> Members:
    """The members that a user asks for; raises `ArgumentError`."""
    if isinstance(parameters, Mapping) and parameters:
        return Members(_grid(parameters), is_grid=True)
    if isinstance(parameters, Sequence) and not isinstance(parameters, (str, bytes)) and len(parameters):
        return Members(_samples(parameters), is_grid=False)
    raise _bad(
        "parameters must be a dict of lists for a grid, such as {'length': [0.5, 1.0]}, or a list of samples, such as "
        f"[{{'length': 0.5}}, {{'length': 1.0}}], not {shown(parameters)}"
    )


def _grid(parameters: Mapping[Any, Any]) -> dict[str, list[Any]]:
    grid: dict[str, list[Any]] = {}
    for name, values in parameters.items():
        _check_name(name)
        try:
            column = [] if isinstance(values, (str, bytes)) else [_as_plain(value) for value in values]
        except TypeError:
            column = []
        if not column:
            raise _bad(f"parameters[{name!r}] must be a list of values, not {shown(values)}")
        for i, value in enumerate(column):
            _check_value(value, f"parameters[{name!r}][{i}]")
        if pair := _repetition(column):
            raise _bad(
                f"parameters[{name!r}] has {shown(column[pair[0]])} twice, at {pair[0]} and {pair[1]}: remove one"
            )
        grid[name] = column
    return grid


def _samples(parameters: Sequence[Any]) -> dict[str, list[Any]]:
    first = parameters[0]
    for i, sample in enumerate(parameters):
        if not isinstance(sample, Mapping) or not sample:
            raise _bad(f"sample {i} must be a dict such as {{'length': 0.5}}, not {shown(sample)}")
        if sample.keys() != first.keys():
            raise _bad(
                f"sample {i} has the parameters {_listed(sample)}, but sample 0 has {_listed(first)}; all samples need "
                "the same ones"
            )
    for name in first:
        _check_name(name)
    columns = {name: [_as_plain(sample[name]) for sample in parameters] for name in first}
    for name, column in columns.items():
        for i, value in enumerate(column):
            _check_value(value, f"parameter {name!r} of sample {i}")
    if pair := _repetition(list(zip(*columns.values(), strict=True))):
        raise _bad(f"samples {pair[0]} and {pair[1]} are equal ({shown(dict(parameters[pair[0]]))}): remove one")
    return columns


def _bad(message: str) -> ArgumentError:
    return ArgumentError(message, argument="parameters")


def _listed(names: Iterable[Any]) -> str:
    return ", ".join(str(name) for name in names)


def _check_name(name: Any) -> None:
    if not isinstance(name, str) or not name.isidentifier() or name in (FAILED, SAMPLE):
        reserved = " (the dataset uses it)" if name in (FAILED, SAMPLE) else ""
        raise _bad(f"the parameter {name!r} is not a valid name of an argument{reserved}")


def _check_value(value: Any, where: str) -> None:
    if isinstance(value, (float, complex)) and value != value:
        raise _bad(f"{where} is NaN; leave it out")


def _as_plain(value: Any) -> Any:
    """NumPy's numbers as Python's."""
    return value.item() if isinstance(value, np.generic) else value


def _repetition(values: list[Any]) -> tuple[int, int] | None:
    """Positions of the first two values that are equal; values without a hash are not compared."""
    seen: dict[Any, int] = {}
    for i, value in enumerate(values):
        try:
            before = seen.setdefault(value, i)
        except TypeError:
            continue
        if before != i:
            return before, i
    return None


def check_signature(model: Callable[..., Any], members: Members) -> None:
    """Whether the model takes these parameters, where Python knows what it takes."""
    try:
        signature = inspect.signature(model)
    except (TypeError, ValueError):
        return
    try:
        signature.bind(**dict.fromkeys(members.values))
    except TypeError as error:
        raise _bad(
            f"model cannot be called with the parameters {_listed(members.values)}: {error}; its parameters are "
            f"{_listed(signature.parameters) or 'none'}"
        ) from error
