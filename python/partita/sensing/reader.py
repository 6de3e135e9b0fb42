"""Reads sensors by name, expressions and functions of others among them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..errors import ArgumentError, EvaluationError
from ..naming import index_of
from ..numeric import floats, shown
from .quantities import FORMS, Array, Signals
from .records import SensorRecord


class Reader:
    """Reads sensors by name, and stores the readings."""

    def __init__(self, sensors: Mapping[str, SensorRecord], signals: Signals) -> None:
        self._sensors, self._signals = sensors, signals
        self._known: dict[str, Array] = {}

    def read(self, name: str) -> Array:
        """The values of a sensor; `UnknownNameError` with the nearest names."""
        if name not in self._known:
            names = list(self._sensors)
            record = self._sensors[names[index_of(name, names, "sensor")]]
            self._known[name] = self._value(record)
        return self._known[name]

    def _value(self, record: SensorRecord) -> Array:
        data, of = record.data, record.data["of"]
        if of == "expression":
            return self._expression(record, data["expression"])
        if of == "function":
            return self._called(record, [self.read(name) for name in data["sensors"]])
        return np.asarray(FORMS[of](self._signals, data))

    def _expression(self, record: SensorRecord, tree: Any) -> Array:
        if isinstance(tree, str):
            return self.read(tree)
        if not isinstance(tree, list | tuple):
            return np.asarray(float(tree))
        word = tree[0]
        if word == "component":
            values, i = self._expression(record, tree[1]), int(tree[2])
            if values.ndim <= np.ndim(self._signals.t) or not i < values.shape[-1]:
                raise ArgumentError(
                    f'sensor "{record.name}": there is no component {i} of values of shape '
                    f"{values.shape[np.ndim(self._signals.t) :]}",
                    argument="name",
                )
            return values[..., i]
        parts = [self._expression(record, part) for part in tree[1:]]
        if word == "norm":
            return np.asarray(
                np.sqrt(np.sum(parts[0] ** 2, axis=-1)) if self._is_vector(parts[0]) else np.abs(parts[0])
            )
        if word == "dot":
            if not all(map(self._is_vector, parts)) or parts[0].shape != parts[1].shape:
                raise ArgumentError(f'sensor "{record.name}": dot takes two vectors of one length', argument="name")
            return np.asarray(np.sum(parts[0] * parts[1], axis=-1))
        rank = max(part.ndim for part in parts)
        fitted = [p[..., None] if 0 < p.ndim < rank and p.ndim == np.ndim(self._signals.t) else p for p in parts]
        try:
            return _folded(word, fitted)
        except ValueError as error:
            shapes = " and ".join(str(part.shape[np.ndim(self._signals.t) :]) for part in parts)
            raise ArgumentError(
                f'sensor "{record.name}": a {word} of values of the shapes {shapes} is not defined', argument="name"
            ) from error

    def _is_vector(self, values: Array) -> bool:
        return values.ndim == np.ndim(self._signals.t) + 1

    def _called(self, record: SensorRecord, values: list[Array]) -> Array:
        function, t = record.function, np.asarray(self._signals.t)
        if function is None:
            raise ArgumentError(
                f'sensor "{record.name}" is a function, which only the run that it was made for can evaluate',
                argument="name",
            )
        if t.ndim == 0:
            return _numbers(record, float(t), function(float(t), *(plain(value) for value in values)))
        rows = [
            _numbers(record, float(t[i]), function(float(t[i]), *(plain(value[i]) for value in values)))
            for i in range(len(t))
        ]
        if any(row.shape != rows[0].shape for row in rows):
            raise EvaluationError(
                f'sensor "{record.name}": its function returns a varying number of values', t=float(t[0]),
                where=record.name,
            )  # fmt: skip
        return np.array(rows) if rows else np.zeros(0)


def plain(value: Array) -> Any:
    return float(value) if value.ndim == 0 else value


def _numbers(record: SensorRecord, t: float, value: Any) -> Array:
    try:
        found = floats(value)
    except TypeError as error:
        raise EvaluationError(
            f'sensor "{record.name}" at t = {t:g} s: its function must return numbers, not {shown(value)}', t=t,
            where=record.name,
        ) from error  # fmt: skip
    if not np.all(np.isfinite(found)):
        raise EvaluationError(
            f'sensor "{record.name}" at t = {t:g} s: its function returned {shown(value)}', t=t, where=record.name
        )
    return found


def _folded(word: str, parts: list[Array]) -> Array:
    found = parts[0]
    for part in parts[1:]:
        if word == "quotient":
            with np.errstate(divide="ignore", invalid="ignore"):
                found = found / part
        else:
            found = found + part if word == "sum" else found * part
    return np.asarray(found)
