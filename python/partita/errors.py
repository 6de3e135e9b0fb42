"""Errors: messages with names, numbers and a next step.

Every error that Partita raises on purpose derives from `PartitaError` and carries its numbers as attributes, so that a
program can react to them without parsing the message. The compiled core raises the same classes.

>>> import partita as pt
>>> try:
...     pt.Mechanism("m").add_rod("bar", start=(0, 0, 0), end=(1, 0, 0), mass=-1.0)
... except pt.errors.DescriptionError as error:
...     print(error.name)
bar
"""

from __future__ import annotations

import re
from typing import Any

__all__ = [
    "ArgumentError",
    "AssemblyError",
    "ChangedFileWarning",
    "ContradictionError",
    "DerivativeError",
    "DescriptionError",
    "SuspectResultWarning",
    "EvaluationError",
    "FileFormatError",
    "IntegrationError",
    "Interrupted",
    "LossyFileWarning",
    "MissingDependencyError",
    "MissingFileError",
    "OpenReactionError",
    "PartitaError",
    "SingularityError",
    "UnknownAttributeError",
    "UnknownNameError",
]


_LONG_WORD, _LONG = 500, 4000
"""Letters of a word, and of a message. What a file contains may be of any length."""
_WORD = re.compile(r"\S+")


def shortened(message: str) -> str:
    """A message without the middle of what is too long in it."""
    if len(message) <= _LONG_WORD:
        return message
    message = _WORD.sub(lambda word: _middle_out(word[0], _LONG_WORD), message)
    return _middle_out(message, _LONG)


def _middle_out(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most // 2]} ... {text[-most // 4 :]}"


class PartitaError(Exception):
    """Base of all errors of Partita.

    Attributes:
        message: the sentence.
        fields: the numbers and names in it; each one is an attribute of the error as well.
    """

    message: str
    fields: dict[str, Any]

    def __init__(self, message: str, **fields: Any) -> None:
        message = shortened(message)
        super().__init__(message)
        self.message = message
        self.fields = fields
        for name, value in fields.items():
            setattr(self, name, value)

    def __str__(self) -> str:
        return self.message

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuild, (type(self), self.message, self.fields)


def _rebuild(kind: type[PartitaError], message: str, fields: dict[str, Any]) -> PartitaError:
    """Construct the error in another process: `pickle` alone would lose the keyword arguments."""
    return kind(message, **fields)


class SuspectResultWarning(UserWarning):
    """A result with findings that the tolerances and the round-off of its run do not explain; its certificate lists
    them."""


class DescriptionError(PartitaError, ValueError):
    """The description of a mechanism or a system is wrong.

    Fields: `element` ("body", "joint", "force", "drive" or "mechanism") and its `name`.
    """

    element: str
    name: str


class ArgumentError(PartitaError, ValueError):
    """An argument of a call is wrong. Field: `argument`, its name."""

    argument: str


class UnknownNameError(PartitaError, KeyError):
    """No element has this name. Fields: `name` as given, `known` names."""

    name: str
    known: list[str]


class UnknownAttributeError(UnknownNameError, AttributeError):  # type: ignore[misc]  # both have a `name`
    """An element has no attribute of this name. Fields: `name` as given, `known` names."""


class FileFormatError(PartitaError, ValueError):
    """A file cannot be read or written. Fields: `path`, and `line` (from 1) where it is known, else None."""

    path: str
    line: int | None


class MissingFileError(PartitaError, FileNotFoundError):
    """There is no such file. Field: `path`."""

    path: str


class AssemblyError(PartitaError, RuntimeError):
    """The loops do not close. Fields: largest `residual`, `iterations` done, `loops` that are open."""

    residual: float
    iterations: int
    loops: str


class ContradictionError(PartitaError, RuntimeError):
    """Redundant constraints contradict each other: no motion satisfies all of them. Fields: time `t` [s] at which it
    was detected, the `gap` there, `who` is violated and `whom` it contradicts."""

    t: float
    gap: float
    who: str
    whom: str


class SingularityError(PartitaError, RuntimeError):
    """The equations lose rank where they must not. Fields: time `t` [s] and `quality` of the best partition."""

    t: float
    quality: float


class EvaluationError(PartitaError, RuntimeError):
    """A function or a table gave no usable value, or a friction and the reaction that it follows have no consistent
    values. Fields: time `t` [s] and `where`, the element concerned."""

    t: float
    where: str


class OpenReactionError(EvaluationError):
    """A friction depends on a reaction that is indeterminate for rigid bodies, so it has no unique value. Fields:
    time `t` [s], `where`, the friction, and its `joint`."""

    joint: str


class DerivativeError(PartitaError, ValueError):
    """A derivative of a user-defined system belongs to another function.

    Fields: name of the `function`, `row` and (of a Jacobian) `column` of the entry, the number `given`, the number
    `found` by differences, time `t` [s].
    """

    function: str
    row: int
    column: int | None = None
    given: float
    found: float
    t: float


class IntegrationError(PartitaError, RuntimeError):
    """The integration in time cannot continue. Field: time `t` [s] reached."""

    t: float


class Interrupted(KeyboardInterrupt):
    """Ctrl-C ended a run, a sweep or a comparison; nothing that was computed is lost.

    It is a `KeyboardInterrupt`, not a `PartitaError`, so that a loop of runs stops even where it catches errors. Field:
    `result`, what was computed: a `Result` with the outputs reached, a `Comparison` with the rows so far, the dataset
    of a sweep. At the interactive prompt, if it was not caught, it is `sys.last_value.result`.
    """

    message: str
    result: Any

    def __init__(self, message: str, result: Any = None) -> None:
        super().__init__(message)
        self.message, self.result = message, result

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.message, self.result)


class MissingDependencyError(PartitaError, ImportError):
    """An optional package is not installed. Field: `package`."""

    package: str


class ChangedFileWarning(UserWarning):
    """A model file was changed after it was saved; its present content was read."""


class LossyFileWarning(UserWarning):
    """A mechanism was written in a format that cannot represent all of it; the warning lists what is missing."""
