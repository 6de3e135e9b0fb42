"""Classes of cases as the tables of docs/trust.md."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from inspect import cleandoc
from types import ModuleType

from .case import NO_SUCCESS, REFUSED, RIGHT, SUSPECT, Case


@dataclass(frozen=True)
class Class:
    """Cases of one kind, with a heading and an introduction."""

    room: str
    heading: str
    words: str
    cases: tuple[Case, ...]


def classes(rooms: Iterable[ModuleType]) -> tuple[Class, ...]:
    """One for each room."""
    return tuple(_class(room) for room in rooms)


def _class(room: ModuleType) -> Class:
    heading, _, words = cleandoc(room.__doc__ or "").partition("\n\n")
    return Class(room.__name__.rpartition(".")[2], heading, words, tuple(_of(room)))


def _of(room: ModuleType) -> Iterator[Case]:
    for name, value in vars(room).items():
        if isinstance(value, Case):
            yield value
        elif name == "CASES":
            yield from value


def tables(found: Iterable[Class]) -> str:
    """Headings, sentences and a table each, after a count of all."""
    found = tuple(found)
    kinds = Counter(case.kind for c in found for case in c.cases)
    counts = ", ".join(f"{kinds[kind]} {kind}" for kind in (RIGHT, REFUSED, NO_SUCCESS, SUSPECT))
    lines = [f"{sum(kinds.values())} cases: {counts}."]
    for c in found:
        lines += [
            "",
            f"## {c.heading}",
            "",
            c.words,
            "",
            "| case | outcome | compared with, or message |",
            "|---|---|---|",
        ]
        lines += [f"| {_cell(case.title)} | {case.kind} | {_cell(_words(case))} |" for case in c.cases]
    return "\n".join([*lines, ""])


def _words(case: Case) -> str:
    if case.kind == RIGHT:
        return case.words
    return f"`{case.error}`: {case.words}"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
