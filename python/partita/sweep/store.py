"""A sweep on disk: a folder to which results are appended as they come, and which is read while it grows.

`sweep.json` says whose results these are: model, parameters, versions. `members.log` holds them: frames of a head with
a checksum and the bytes of one member, only ever appended. What a crash leaves at its end is incomplete and is cut off;
a damaged frame with intact ones behind it is not the work of a crash, and is refused. `lock` is held by the process
that writes; the system releases it when that process ends, however it ends.
"""

from __future__ import annotations

import json
import os
import platform
import shutil
import struct
import tempfile
import time
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._core import version
from ..errors import ArgumentError, FileFormatError, MissingFileError
from ..extras import extra
from ..files import BLANK, Allowance, get, intact, malformed, place, put, sealed, target
from ..numeric import shown
from ..store_lock import LOCK, locked, unusable
from .collected import KINDS, Answer, Storable
from .identity import digest_of, name_of
from .members import Members, is_plain

if TYPE_CHECKING:
    import xarray

HEADER, LOG = "sweep.json", "members.log"
FORMAT = 1
ZARR = ".zarr"
_OTHERS = frozenset({".nc", ".h5", ".hdf5", ".json", ".csv", ".parquet", ".mat", ".toml", ".pkl", ".npz"})
"""Endings of files that a user would expect to be of their format."""
_SYNC = 5.0
"""Results that are older are forced onto the disk. Scale: s. Reason: what a power failure may cost; other crashes
cost nothing."""

_MARK = b"\x89PMr"
_HEAD = struct.Struct("<4scQIQI")
"""Mark, kind, member, number of the layout, length of the body, checksum of all of it."""
_LAYOUT, _VALUES, _FAILURE = b"L", b"V", b"F"


_PER_MEMBER = 100
"""Bytes of memory of a member in the dataset, at least."""


class Log:
    """Frames of answers. Layouts are the names, types and shapes of values, numbered as they were met."""

    def __init__(self) -> None:
        self.answers: dict[int, Storable] = {}
        self.layouts: dict[str, int] = {}
        self.end = 0

    def read(self, content: bytes, path: Path, count: int) -> None:
        """Take in a whole log."""
        layouts: list[str] = []
        while (frame := _frame(content, self.end)) is not None:
            kind, member, layout, start, length = frame
            body = content[start : start + length]
            if kind == _LAYOUT:
                layouts.append(body.decode())
                self.layouts[layouts[-1]] = layout
            elif member >= count or (kind == _VALUES and layout >= len(layouts)):
                raise _damaged(path, f"member {member} at byte {self.end} is not of this sweep")
            else:
                self.answers[member] = body.decode() if kind == _FAILURE else (layouts[layout], body)
            self.end = start + length
        later = content.find(_MARK, self.end + 1)
        while later >= 0:
            if _frame(content, later) is not None:
                raise _damaged(path, f"bytes {self.end} to {later} are not what was written")
            later = content.find(_MARK, later + 1)

    def frames(self, member: int, answer: Storable) -> bytes:
        """An answer as bytes."""
        if isinstance(answer, str):
            return _packed(_FAILURE, member, 0, answer.encode("utf-8", "replace"))
        layout, body = answer
        head = b""
        if layout not in self.layouts:
            head = _packed(_LAYOUT, 0, len(self.layouts), layout.encode())
            self.layouts[layout] = len(self.layouts)
        return head + _packed(_VALUES, member, self.layouts[layout], body)


def _packed(kind: bytes, member: int, layout: int, body: bytes) -> bytes:
    check = zlib.crc32(body, zlib.crc32(_HEAD.pack(_MARK, kind, member, layout, len(body), 0)))
    return _HEAD.pack(_MARK, kind, member, layout, len(body), check) + body


def _frame(content: bytes, at: int) -> tuple[bytes, int, int, int, int] | None:
    """Kind, member, layout, first byte and length of the body of the frame there; None where there is no intact one."""
    if at + _HEAD.size > len(content):
        return None
    mark, kind, member, layout, length, check = _HEAD.unpack_from(content, at)
    body = at + _HEAD.size
    if mark != _MARK or body + length > len(content):
        return None
    head = zlib.crc32(_HEAD.pack(mark, kind, member, layout, length, 0))
    if zlib.crc32(memoryview(content)[body : body + length], head) != check:
        return None
    return kind, member, layout, body, length


def _not_understood(folder: Path, error: Exception) -> FileFormatError:
    return _damaged(folder, f"its content is not that of a sweep ({type(error).__name__}: {error!s:.100})")


def _damaged(path: Path, what: str) -> FileFormatError:
    return FileFormatError(
        f"the store {str(path)!r} is damaged: {what}; take a copy of it from before, or start anew with another name",
        path=str(path),
        line=None,
    )


class Store:
    """The store of a sweep under way: what is known already, and where to put what comes."""

    def __init__(self, path: Path, log: Log, stream: int) -> None:
        self.path, self.log, self._stream = path, log, stream
        self._synced = time.monotonic()

    @property
    def answers(self) -> dict[int, Storable]:
        """What was computed before."""
        return self.log.answers

    def put(self, answers: Mapping[int, Storable]) -> None:
        """Append answers."""
        content = memoryview(b"".join(self.log.frames(member, answer) for member, answer in answers.items()))
        try:
            while content:
                content = content[os.write(self._stream, content) :]
            if time.monotonic() - self._synced > _SYNC:
                os.fsync(self._stream)
                self._synced = time.monotonic()
        except OSError as error:
            raise FileFormatError(
                f"cannot write to the store {str(self.path)!r}: {error.strerror}; it has all members before. Free "
                "space, and run the sweep again to continue",
                path=str(self.path),
                line=None,
            ) from error

    def publish(self, found: xarray.Dataset) -> None:
        """Put the dataset into a store whose name ends in .zarr, for programs that read Zarr."""
        if self.path.suffix.lower() != ZARR:
            return
        with tempfile.TemporaryDirectory(dir=self.path) as draft:
            found.to_zarr(Path(draft, "draft"), mode="w", zarr_format=2, consolidated=True)
            for new in Path(draft, "draft").iterdir():
                here = self.path / new.name
                if here.is_dir():
                    shutil.rmtree(here)
                os.replace(new, here)


def storable(answer: Answer) -> Storable:
    """The answer, or why a store cannot hold it."""
    if isinstance(answer, dict):
        name, value = next(item for item in answer.items() if item[1].dtype.kind not in KINDS)
        return f"{name} is of type {value.dtype}, which a store cannot hold; return numbers or texts"
    return answer


def load_sweep(path: Any) -> xarray.Dataset:
    """Load what a sweep has stored so far, also while it goes on.

    Args:
        path: the `store` of `partita.sweep`.

    Returns:
        The dataset that `partita.sweep` returns; in `failed`, "not computed" stands for members that have not returned.

    Raises:
        MissingFileError: there is no store. FileFormatError: it is damaged, or of a later version of Partita.
    """
    from .collected import dataset

    extra("xarray", "xarray", "loading a sweep")
    folder = place(path)
    header = _header(folder)
    with malformed(lambda error: _not_understood(folder, error)):
        members, log = _members(folder, header), Log()
        content = get(folder / LOG, "result_bytes")
        Allowance(folder, len(content)).take(_PER_MEMBER * members.count, "its members")
        log.read(content, folder, members.count)
        return dataset(members, log.answers)


@contextmanager
def opened(path: Any, model: Callable[..., Any], members: Members) -> Iterator[Store]:
    """The store at `path`, new or continued, locked for this process."""
    folder = _folder(path)
    header = _described(model, members)
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise unusable(folder, error) from error
    with locked(folder):
        log = Log()
        if (folder / HEADER).exists():
            with malformed(lambda error: _not_understood(folder, error)):
                _compare(folder, _header(folder), header)
                log.read(get(folder / LOG, "result_bytes"), folder, members.count)
        else:
            _check_empty(folder)
            _touch(folder / LOG)
            put(folder / HEADER, sealed(json.dumps(header, indent=1).encode()))
        try:
            stream = os.open(folder / LOG, os.O_WRONLY | getattr(os, "O_BINARY", 0))
        except OSError as error:
            raise unusable(folder, error) from error
        try:
            os.ftruncate(stream, log.end)  # what a crash left incomplete
            os.lseek(stream, log.end, os.SEEK_SET)
            yield Store(folder, log, stream)
        finally:
            with suppress(OSError):
                os.fsync(stream)
            os.close(stream)


def _folder(path: Any) -> Path:
    folder = place(path)
    ending = folder.suffix.lower()
    if ending in _OTHERS:
        raise ArgumentError(
            f"store is a folder of Partita's own, not a file of the kind {ending}: name it {folder.stem!r}, or "
            f"{folder.stem + ZARR!r} to find the dataset there as Zarr",
            argument="store",
        )
    if folder.exists() and not folder.is_dir():
        raise FileFormatError(f"store must be a folder, but {str(folder)!r} is a file", path=str(folder), line=None)
    if not folder.exists():
        target(folder, "a store ")
    if ending == ZARR:
        extra("zarr", "zarr", f"a store named {folder.name}")
    return folder


def _touch(path: Path) -> None:
    try:
        path.touch()
    except OSError as error:
        raise unusable(path.parent, error) from error


def _check_empty(folder: Path) -> None:
    """A log without a header is what a crash left before its first result."""
    strange = sorted(
        p.name for p in folder.iterdir() if p.name not in (LOCK, LOG) and not p.name.startswith(f".{HEADER}.")
    )
    if strange or ((folder / LOG).exists() and (folder / LOG).stat().st_size):
        raise FileFormatError(
            f"the folder {str(folder)!r} is not the store of a sweep: it contains {strange[0] if strange else LOG} but "
            f"no {HEADER}; give a new name",
            path=str(folder),
            line=None,
        )


def _described(model: Callable[..., Any], members: Members) -> dict[str, Any]:
    """The header of a store."""
    for name, values in members.values.items():
        for value in values:
            if not is_plain(value) and value is not None:
                raise ArgumentError(
                    f"parameter {name!r} is {shown(value)}, which a store cannot hold; give a number or a text from "
                    "which the model makes it",
                    argument="parameters",
                )
    return {
        "sweep": FORMAT,
        "checksum": BLANK,
        "partita": version(),
        "python": ".".join(platform.python_version_tuple()[:2]),
        "model": {"name": name_of(model), "digest": digest_of(model)},
        "grid": members.is_grid,
        "parameters": {name: [_written(value) for value in values] for name, values in members.values.items()},
    }


def _written(value: Any) -> Any:
    """A value for JSON, which knows neither complex numbers nor infinity."""
    if isinstance(value, complex):
        return {"complex": [repr(value.real), repr(value.imag)]}
    if isinstance(value, float) and not np.isfinite(value):
        return {"float": repr(value)}
    return value


def _read(value: Any) -> Any:
    if isinstance(value, dict):
        return float(value["float"]) if "float" in value else complex(*(float(part) for part in value["complex"]))
    return value


def _header(folder: Path) -> dict[str, Any]:
    if folder.is_dir() and not (folder / HEADER).exists():
        raise MissingFileError(f"{str(folder)!r} is not the store of a sweep: it has no {HEADER}", path=str(folder))
    if not folder.exists():
        raise MissingFileError(
            f"there is no store {str(folder)!r}; the working folder is {Path.cwd()}", path=str(folder)
        )
    content = get(folder / HEADER, "result_bytes")
    if not intact(content):
        raise _damaged(folder, f"{HEADER} is not what was written")
    with malformed(lambda error: _not_understood(folder, error)):
        header: dict[str, Any] = json.loads(content)
        later = header["sweep"] > FORMAT
    if later:
        raise FileFormatError(
            f"the store {str(folder)!r} was written by Partita {header['partita']}, this is {version()}; update it",
            path=str(folder),
            line=None,
        )
    return header


def _members(folder: Path, header: dict[str, Any]) -> Members:
    values = {name: [_read(value) for value in column] for name, column in header["parameters"].items()}
    return Members(values, is_grid=header["grid"])


def _compare(folder: Path, there: dict[str, Any], here: dict[str, Any]) -> None:
    """Refuse to continue what is not the same sweep."""
    if why := _difference(there, here):
        raise ArgumentError(
            f"the store {str(folder)!r} belongs to another sweep: {why}; give another store, or load what it has with "
            "load_sweep",
            argument="store",
        )


def _difference(there: dict[str, Any], here: dict[str, Any]) -> str | None:
    for what, name in (("partita", "Partita"), ("python", "Python")):
        if there[what] != here[what]:
            return f"it was written by {name} {there[what]}, this is {here[what]}, whose last digits may differ"
    if there["model"] != here["model"]:
        old, new = there["model"]["name"], here["model"]["name"]
        if there["model"]["digest"] != here["model"]["digest"]:
            return (
                f"its model is {old}, not {new}" if old != new else f"the code or the constants of {new} have changed"
            )
    if there["grid"] != here["grid"]:
        return f"it has {'a grid' if there['grid'] else 'samples'}, not {'a grid' if here['grid'] else 'samples'}"
    old, new = there["parameters"], here["parameters"]
    if list(old) != list(new):
        return f"its parameters are {', '.join(old)}, not {', '.join(new)}"
    for name, values in new.items():
        if len(old[name]) != len(values):
            return f"it has {len(old[name])} values of {name!r}, not {len(values)}"
        for i, (a, b) in enumerate(zip(old[name], values, strict=True)):
            if a != b or type(a) is not type(b):
                return f"value {i} of {name!r} is {a!r} there, {b!r} here"
    return None
