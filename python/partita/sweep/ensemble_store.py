"""An ensemble on disk: coordinates and velocities as arrays of NumPy, and how each part of the members ended.

`ensemble.json` says whose members these are; `q.npy` and `v.npy` hold all of them, those not computed yet as zeros;
`part N.json` is written when the numbers of part N are on the disk, with their digest, so that a part is there wholly
or not at all; numbers that are not those written are refused.
`lock` is held by the process that writes.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._core import version
from ..errors import ArgumentError, FileFormatError
from ..files import BLANK, clear_drafts, get, intact, malformed, put, sealed, target
from ..files import place as path_of
from ..store_lock import LOCK, locked, unusable

FloatArray = NDArray[np.float64]
HEADER = "ensemble.json"
FORMAT = 2


def identity(spec: dict[str, Any], arrays: list[FloatArray], more: list[Any]) -> str | None:
    """SHA-256 of a description, of arrays and of plain values; None where the description calls Python functions."""
    if _calls_python(spec):
        return None
    sha = hashlib.sha256(json.dumps([spec, more], sort_keys=True).encode())
    for array in arrays:
        sha.update(f"{array.shape}".encode())
        sha.update(np.ascontiguousarray(array).tobytes())
    return sha.hexdigest()


def _calls_python(spec: Any) -> bool:
    if isinstance(spec, dict):
        return "function" in spec or any(map(_calls_python, spec.values()))
    return isinstance(spec, (list, tuple)) and any(map(_calls_python, spec))


def digest(arrays: list[FloatArray]) -> str:
    """SHA-256 of numbers."""
    sha = hashlib.sha256()
    for array in arrays:
        sha.update(np.ascontiguousarray(array, dtype=np.float64).tobytes())
    return sha.hexdigest()


class MemberStore:
    """The store of an ensemble under way."""

    def __init__(self, folder: Path, arrays: list[FloatArray]) -> None:
        self.folder, self.arrays = folder, arrays

    def _part(self, number: int) -> Path:
        return self.folder / f"part {number}.json"

    def known(self, number: int, rows: slice) -> dict[str, Any] | None:
        """How the members of a part ended, if it was computed before; its numbers are compared with their digest."""
        path = self._part(number)
        if not path.exists():
            return None
        content = get(path, "result_bytes")
        if not intact(content):
            raise _damaged(self.folder, path.name)
        with malformed(lambda error: _damaged(self.folder, path.name)):
            found: dict[str, Any] = json.loads(content)
            if found.pop("numbers", None) != digest([array[rows] for array in self.arrays]):
                raise _damaged(self.folder, f"the numbers of part {number} (q.npy, v.npy)")
            return _ended(found, rows.stop - rows.start)

    def keep(self, number: int, rows: slice, raw: dict[str, Any]) -> dict[str, Any]:
        """Put the numbers of a part on the disk, then how its members ended, which is returned."""
        try:
            for to, name in zip(self.arrays, ("q", "v"), strict=True):
                if isinstance(to, np.memmap):
                    # written, not mapped: what was written need not stay in memory
                    with (self.folder / f"{name}.npy").open("r+b") as file:
                        file.seek(to.offset + rows.start * to[0].nbytes)
                        file.write(np.ascontiguousarray(raw[name]).tobytes())
                        file.flush()
                        os.fsync(file.fileno())
        except OSError as error:
            raise unusable(self.folder, error) from error
        ended = {name: raw[name] for name in ("status", "messages", "steps", "refusal")}
        numbers = digest([raw[name] for name in ("q", "v")])
        written = {"checksum": BLANK, "numbers": numbers, **ended, "in_lanes": raw["in_lanes"].tolist()}
        put(self._part(number), sealed(json.dumps(written).encode()))
        return {**ended, "in_lanes": raw["in_lanes"]}


def _ended(found: dict[str, Any], count: int) -> dict[str, Any]:
    """How the members of a part ended; raises errors of Python where an entry is of another kind."""
    status, steps, refusal = found["status"], found["steps"], found["refusal"]
    in_lanes = np.array(found["in_lanes"], dtype=bool)
    messages = [(int(i), str(message)) for i, message in found["messages"]]
    fits = isinstance(status, list) and len(status) == count and in_lanes.shape == (count,)
    typed = type(steps) is int and isinstance(refusal, str | None) and all(isinstance(x, str) for x in status)
    if not (fits and typed and all(0 <= i < count for i, _ in messages)):
        raise ValueError("entries of another kind")
    return {"status": status, "messages": messages, "steps": steps, "refusal": refusal, "in_lanes": in_lanes}


def _damaged(folder: Path, name: str) -> FileFormatError:
    return FileFormatError(
        f"the store {str(folder)!r} is damaged: {name} is not what was written; start anew with another name",
        path=str(folder),
        line=None,
    )


@contextmanager
def opened(path: Any, shapes: list[tuple[int, int, int]], whose: Callable[[], str | None]) -> Iterator[MemberStore]:
    """The store at `path`, new or continued, locked for this process; `whose` tells which ensemble it is of."""
    folder = path_of(path, "store")
    if folder.exists() and not folder.is_dir():
        raise FileFormatError(f"store must be a folder, but {str(folder)!r} is a file", path=str(folder), line=None)
    if not folder.exists():
        target(folder, "a store ")
    header = {"ensemble": FORMAT, "checksum": BLANK, "partita": version(), "of": whose(), "shapes": shapes}
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise unusable(folder, error) from error
    with locked(folder):
        clear_drafts(folder)
        if (folder / HEADER).exists():
            _compare(folder, header)
        else:
            strange = sorted(x.name for x in folder.iterdir() if x.name not in (LOCK, "q.npy", "v.npy"))
            if strange:
                message = f"cannot write to {str(folder)!r}: it contains {strange[0]}; give the name of a new folder"
                raise FileFormatError(message, path=str(folder), line=None)
            _made(folder, shapes)
            put(folder / HEADER, sealed(json.dumps(header).encode()))
        try:
            arrays = [
                # only read: what is returned is the store; nothing cannot be mapped
                np.load(folder / name, mmap_mode=None if 0 in shape else "r")
                for name, shape in zip(("q.npy", "v.npy"), shapes, strict=True)
            ]
        except Exception as error:  # NumPy reads its header as Python
            raise _damaged(folder, "q.npy or v.npy") from error
        if [x.shape for x in arrays] != [tuple(x) for x in shapes] or any(x.dtype != np.float64 for x in arrays):
            raise _damaged(folder, "q.npy or v.npy")
        yield MemberStore(folder, arrays)


def _made(folder: Path, shapes: list[tuple[int, int, int]]) -> None:
    """Arrays of zeros, of which the system stores what is written."""
    try:
        for name, shape in zip(("q.npy", "v.npy"), shapes, strict=True):
            if 0 in shape:
                np.save(folder / name, np.zeros(shape))
            else:
                np.lib.format.open_memmap(folder / name, mode="w+", dtype=np.float64, shape=shape)
    except OSError as error:
        raise unusable(folder, error) from error


def _compare(folder: Path, here: dict[str, Any]) -> None:
    """Refuse to continue what is not the same ensemble."""
    content = get(folder / HEADER, "result_bytes")
    if not intact(content):
        raise _damaged(folder, HEADER)
    with malformed(lambda error: _damaged(folder, HEADER)):
        there = json.loads(content)
        there = {key: there[key] for key in here}
    if there["partita"] != here["partita"]:
        why = f"it was written by Partita {there['partita']}, this is {here['partita']}, whose last digits may differ"
    elif here["of"] is None:
        why = "the mechanism calls Python functions, which cannot be recognised"
    elif there["of"] != here["of"]:
        why = "the mechanism, the states, the parameters, the times or the tolerances differ"
    else:
        return
    raise ArgumentError(
        f"the store {str(folder)!r} belongs to another ensemble: {why}; give another store", argument="store"
    )
