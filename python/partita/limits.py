"""Limits of what is read and kept: sizes, counts and depths, all in one table.

A file above a limit is refused by a `FileFormatError` that contains the number found, the limit and its name. A run
that would keep more than `step_bytes` forgets steps, and a note says so. Raise a limit for some calls by `raised`, or
for a whole process by the environment variable PARTITA_LIMITS, read when Partita is imported, as in
PARTITA_LIMITS="elements=2000000, model_bytes=500000000".

>>> import partita as pt
>>> pt.limits.TABLE["elements"].value
200000
>>> with pt.limits.raised(elements=2_000_000):
...     pt.limits.limit("elements")
2000000
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache

from .errors import ArgumentError, FileFormatError

__all__ = ["TABLE", "Limit", "limit", "raised"]

VARIABLE = "PARTITA_LIMITS"

# Looked up once: without the variable that takes a tenth of the time of a short run, and each run has a limit.
_PROCESS = os.environ.get(VARIABLE, "")


@dataclass(frozen=True)
class Limit:
    """A limit: its name, its default value, the unit of what it counts, and what it applies to."""

    name: str
    value: int
    unit: str
    of: str


_MIB = 2**20
TABLE: Mapping[str, Limit] = {
    x.name: x
    for x in (
        Limit("model_bytes", 32 * _MIB, "bytes", "a model file, and each file that it includes"),
        Limit("layer_bytes", 64 * _MIB, "bytes", "a layer of a USD stage, which may contain meshes"),
        Limit("sidecar_bytes", _MIB, "bytes", "a YAML file that lists loops of a robot"),
        Limit("mesh_bytes", 128 * _MIB, "bytes", "a mesh file"),
        Limit("result_bytes", 2048 * _MIB, "bytes", "a stored result, and the header of a store"),
        Limit("unpacked_factor", 10, "times the file", "numbers in a stored result, besides `unpacked_bytes`"),
        Limit("unpacked_bytes", 200_000_000, "bytes", "numbers in a stored result, besides `unpacked_factor`"),
        Limit("elements", 200_000, "elements", "an XML file, after includes and repetitions"),
        Limit("bodies", 3000, "bodies", "a robot's file, after repetitions"),
        Limit("prims", 20_000, "prims", "a USD stage as composed"),
        Limit("texts", 1_000_000, "texts and comments", "a text layer of USD"),
        Limit("composed", 50_000, "nodes", "prims of USD, each counted once for every arc by which it is composed"),
        Limit("attributes", 1000, "attributes", "an XML element"),
        Limit("marks", 400_000, "marks", "ends of lines, brackets, commas, = and # of a TOML file"),
        Limit("depth", 512, "levels", "nested XML elements, prims or values of USD"),
        Limit("list_depth", 32, "levels", "nested lists of a YAML file"),
        Limit("files", 1000, "files", "the layers of a USD stage"),
        Limit("includes", 64, "files", "files that an MJCF model includes"),
        # a hundred and fifty thousand steps of a four-bar; a hundred such runs fit into the memory of a computer
        Limit("step_bytes", 64 * _MIB, "bytes", "the steps that a run keeps for `run.state(t)`, in memory"),
        # more are a function that oscillates about zero; a state is kept for each
        Limit("events", 100_000, "events", "what a run with `events` reports"),
        # a thousand revolutions; what takes longer has most likely been given a wrong period
        Limit("cycle_steps", 1_000_000, "steps", "a run over a cycle that `cycle` looks for"),
        Limit(
            "generated", 10_000_000, "numbers", "what counts in an MJCF file ask for: height fields, keys, user data"
        ),
    )
}
"""All limits by their names."""

_RAISED: ContextVar[Mapping[str, int] | None] = ContextVar("partita_limits", default=None)


@contextmanager
def raised(**limits: int) -> Iterator[None]:
    """Other limits for the calls inside: larger ones for large files that one trusts, or smaller ones.

    Args:
        limits: values by the names in `TABLE`.

    Raises:
        ArgumentError: there is no limit of a name, or a value is not a positive integer.

    >>> import os, tempfile
    >>> import partita as pt
    >>> with tempfile.TemporaryDirectory() as folder, pt.limits.raised(model_bytes=100):
    ...     path = os.path.join(folder, "four-bar.toml")
    ...     pt.catalogue.load("four-bar").save(path) and None
    ...     try:
    ...         pt.load(path)
    ...     except pt.errors.FileFormatError:
    ...         print("refused")
    refused
    """
    before = _RAISED.get() or {}
    token = _RAISED.set({**before, **{name: _checked(name, value) for name, value in limits.items()}})
    try:
        yield
    finally:
        _RAISED.reset(token)


def limit(name: str) -> int:
    """The limit of this name that applies here."""
    own = _RAISED.get()
    if own is not None and name in own:
        return own[name]
    return _of_process(_PROCESS).get(name, TABLE[name].value)


def exceeded(name: str, found: int, what: str = "") -> str | None:
    """The sentence that refuses `found`, or None where the limit allows it; `what` is what was counted."""
    most = limit(name)
    if found <= most:
        return None
    return f"{found} {what or TABLE[name].unit}, more than the limit of {most}; {advice(name, found)}"


def advice(name: str, found: int) -> str:
    """How to raise a limit."""
    return f"partita.limits.raised({name}={found}) allows as many"


def refuse_above(name: str, found: int, path: str, what: str = "", subject: str = "") -> None:
    """Raise `FileFormatError` where the limit does not allow `found`."""
    if (words := exceeded(name, found, what)) is not None:
        raise FileFormatError(f'"{path}": {subject or "it"} has {words}', path=path, line=None)


def _checked(name: str, value: object) -> int:
    if name not in TABLE:
        raise ArgumentError(f"there is no limit {name!r}; there are {', '.join(TABLE)}", argument=name)
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise ArgumentError(f"the limit {name} is {value!r:.40}; it must be a positive integer", argument=name)
    return value


@cache
def _of_process(text: str) -> Mapping[str, int]:
    """The limits in the environment variable."""
    found = {}
    for item in filter(str.strip, text.split(",")):
        name, _, value = item.partition("=")
        digits = value.strip().replace("_", "")
        usable = digits.isascii() and digits.isdigit() and len(digits) < 19
        found[name.strip()] = _checked(name.strip(), int(digits) if usable else value.strip())
    return found
