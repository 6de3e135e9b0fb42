"""A recording of the core as plain data, and its replay over numbers of any kind."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

OPERANDS = {
    "input": 0, "constant": 0, "add": 2, "sub": 2, "mul": 2, "div": 2, "over_or_zero": 2, "neg": 1, "sqrt": 1,
    "power": 1, "sin": 1, "cos": 1, "atan2": 2, "hypot": 2, "abs": 1, "round": 1, "max": 2, "min": 2,
    "where_positive": 3, "reached": 1, "scale": 1, "interval": 1,
}  # fmt: skip
"""Operations by name, and how many operands each has. `over_or_zero` is x / y, 0 where y is 0; `where_positive` is y
where x > 0, else z; `reached` is 1 where x is at or above the constant, else -1; `round` rounds halves away from 0;
`interval` is a number of the interval of a table that x is in."""

CHOICES = {"where_positive": (1, 2), "max": (0, 1), "min": (0, 1), "over_or_zero": (0,)}
"""Operations that select, and which of their operands may be left unselected."""


class Entry(NamedTuple):
    """An entry of a tape: its number, its operation, the numbers of its operands, and the constant that belongs to it
    (of an input its number, of an interval the column of its table), and its table."""

    number: int
    operation: str
    operands: tuple[int, ...]
    constant: float
    table: int = 0


class Table(NamedTuple):
    """A table of cubics: where its intervals begin but the first (n - 1,), and of each its start and its coefficients
    (n, 5)."""

    breaks: NDArray[np.float64]
    numbers: NDArray[np.float64]


@dataclass(frozen=True)
class Tape:
    """Operations in an order in which operands come first."""

    operations: tuple[str, ...]
    codes: NDArray[np.uint8]
    operands: NDArray[np.uint32]
    constants: NDArray[np.float64]
    outputs: NDArray[np.uint32]
    spans: dict[str, tuple[int, int]]
    """First output and number of outputs of each part."""
    tables: tuple[Table, ...]

    @classmethod
    def of(cls, operations: Sequence[str], raw: Any) -> Tape:
        """From what the core returns."""
        codes, operands, constants, outputs, parts, tables = raw
        spans, first = dict[str, tuple[int, int]](), 0
        for name, count in parts:
            spans[name] = (first, count)
            first += count
        made = [Table(breaks[1 : len(rows)], np.column_stack([breaks[: len(rows)], rows])) for breaks, rows in tables]
        return cls(tuple(operations), codes, operands, constants, outputs, spans, tuple(made))

    def of_part(self, name: str) -> list[int]:
        """The entries of the outputs of a part."""
        first, count = self.spans[name]
        return [int(entry) for entry in self.outputs[first : first + count]]

    def needed(self, wanted: Sequence[int]) -> Iterator[Entry]:
        """The entries on which those wanted depend, in order."""
        asked = np.zeros(len(self.codes), dtype=bool)
        asked[list(wanted)] = True
        counts = [OPERANDS[name] for name in self.operations]
        for i in range(len(self.codes) - 1, -1, -1):
            if asked[i]:
                asked[self.operands[i, : counts[self.codes[i]]]] = True
        for i in np.flatnonzero(asked).tolist():
            name = self.operations[self.codes[i]]
            operands = tuple(self.operands[i, : OPERANDS[name]].tolist())
            if name == "interval":
                yield Entry(i, name, operands, float(self.operands[i, 2]), int(self.operands[i, 1]))
                continue
            constant = float(self.operands[i, 0]) if name == "input" else float(self.constants[i])
            yield Entry(i, name, operands, constant)

    def written(self) -> list[int]:
        """Operations of each output when its formula is written out, in which what is used twice stands twice."""
        sizes = dict[int, int]()
        for entry in self.needed([int(i) for i in self.outputs]):
            sizes[entry.number] = bool(entry.operands) + sum(sizes[i] for i in entry.operands)
        return [sizes[int(i)] for i in self.outputs]

    def column(self, entry: Entry) -> tuple[list[float], list[float]]:
        """Of an interval: where the intervals begin but the first, and the number of each; equal neighbours are one."""
        breaks, numbers = self.tables[entry.table]
        column = numbers[:, int(entry.constant)].tolist()
        kept = [i for i in range(1, len(column)) if column[i] != column[i - 1]]
        return [float(breaks[i - 1]) for i in kept], [column[0], *(column[i] for i in kept)]

    def replayed(
        self, wanted: Sequence[int], inputs: Sequence[Any], apply: Callable[[Entry, list[Any], bool], Any]
    ) -> list[Any]:
        """The entries wanted, by `apply(entry, operands, unselected)` for each operation, an interval of a table apart:
        of that the operands are followed by its `column`. Constants are floats.
        `unselected`: a later choice may leave the value aside, so that it may have no derivative there."""
        entries = list(self.needed(wanted))
        aside = unselected(entries)
        found = dict[int, Any]()
        for entry in entries:
            if entry.operation == "input":
                found[entry.number] = inputs[int(entry.constant)]
            elif entry.operation == "constant":
                found[entry.number] = entry.constant
            else:
                operands = [found[i] for i in entry.operands]
                if entry.operation == "interval":
                    operands += self.column(entry)
                found[entry.number] = apply(entry, operands, entry.number in aside)
        return [found[i] for i in wanted]


def unselected(entries: Sequence[Entry]) -> set[int]:
    """Entries that a choice may leave aside, those included from which they are computed."""
    found = set[int]()
    for entry in reversed(entries):
        found.update(entry.operands[i] for i in CHOICES.get(entry.operation, ()))
        if entry.number in found:
            found.update(entry.operands)
    return found
