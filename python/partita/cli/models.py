"""The mechanism of the argument FILE|NAME, from a file or from the catalogue."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import ArgumentError

if TYPE_CHECKING:
    from ..catalogue import Entry
    from ..mechanism import Mechanism
    from ..state import State


@dataclass(frozen=True)
class Opened:
    """A mechanism and, when it comes from the catalogue, its entry."""

    mechanism: Mechanism
    entry: Entry | None = None

    def initial(self, coordinates: str = "relative") -> State | None:
        """The published start of a catalogue entry; None for a file: as drawn, at rest."""
        if self.entry is None:
            return None
        start = self.entry.initial(self.mechanism)
        return start if coordinates == "relative" else self.mechanism.convert(start, coordinates)


READING = ("base", "loops", "inertia", "root", "serial_joints")
"""Arguments of `partita.load`."""


def open_as_asked(word: str, arguments: argparse.Namespace) -> Opened:
    """`open_model`, with what the command line says about reading files."""
    return open_model(word, **{key: value for key in READING if (value := getattr(arguments, key)) is not None})


def open_model(word: str, **reading: str) -> Opened:
    """The mechanism in the file `word`, or of that name in the catalogue.

    A file is meant when it exists or when the word has an ending or a folder in it. Errors: those of `partita.load` and
    of `partita.catalogue.entry`. `reading` are arguments of `partita.load`.
    """
    path = Path(word)
    if path.is_file() or path.suffix or len(path.parts) > 1:
        from ..mechanism import load

        return Opened(load(word, **reading))
    from .. import catalogue

    entry = catalogue.entry(word)
    return Opened(entry.mechanism(), entry)


def settings(pairs: list[tuple[str, list[float | str]]]) -> dict[str, Any]:
    """JOINT=VALUE as `assemble` takes them."""
    found: dict[str, Any] = {}
    for name, values in pairs:
        if name in found:
            raise ArgumentError(f"{name!r} is set twice; give it once", argument="target")
        found[name] = values if len(values) > 1 else values[0]
    return found


def start_of(
    opened: Opened,
    target: list[tuple[str, list[float | str]]],
    rate: list[tuple[str, list[float | str]]],
    coordinates: str = "relative",
) -> State | None:
    """The initial state: that of the catalogue, with the given targets and rates; None: as drawn, at rest."""
    targets, rates = settings(target), settings(rate)
    near = opened.initial(coordinates)
    if not targets and not rates:
        return near
    return opened.mechanism.assemble(targets, rates, near, coordinates=coordinates)


def length_of(opened: Opened, word: str, asked: float | None) -> float:
    """Duration of a run: as given, else that of the catalogue."""
    if asked is not None:
        return asked
    if opened.entry is None:
        raise ArgumentError(f"{word}: a model file specifies no duration; add --time 10", argument="time")
    return opened.entry.duration
