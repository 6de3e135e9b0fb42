"""Files that are written completely or not at all, and whose changes are detected.

A sealed file holds the SHA-256 of itself: of its bytes with zeros in the place of the digits.
"""

from __future__ import annotations

import glob
import hashlib
import os
import re
import secrets
import shutil
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from . import limits
from .errors import ArgumentError, FileFormatError, MissingFileError, PartitaError

BLANK = "sha256:" + 64 * "0"
"""Occurs once in the content of a file to be sealed, before all names given by the user."""

_ATTEMPTS = 20
"""To put a folder where others put theirs at the same time."""

_LOOKS = 3
"""At a folder, before it is treated as another program's."""

_ABANDONED = 3600.0
"""Age [s] of a draft that nobody writes any more."""

_SMALL = 1 << 24
"""Bytes of a file in which a seal of a folder may stand."""

_MARK = re.compile(rb"sha256:([0-9a-f]{64})")


def place(path: Any, argument: str = "path") -> Path:
    """`path` as a path that can be read; raises `ArgumentError`, which names the argument, or `FileFormatError`."""
    try:
        given = os.fspath(path)
    except TypeError:
        given = None
    if not isinstance(given, str) or not given or "\0" in given:
        raise ArgumentError(f"{argument} must be the name of a file, not {path!r}", argument=argument)
    where = Path(given)
    try:
        where.is_file()
    except (OSError, ValueError) as error:
        raise FileFormatError(f"cannot use {given!r}: {_why(error)}", path=given, line=None) from error
    return where


def target(path: Any, what: str = "", folder: str | None = None) -> Path:
    """`path` as one where a file can be put: `MissingFileError` when its folder does not exist, `FileFormatError` when
    it is itself a folder, unless one sealed by `put_folder` whose name ends in `folder`. `what` is what shall be
    written there."""
    where = place(path)
    if where.is_dir() and not (where.suffix.lower() == folder and _is_ours(where)):
        raise FileFormatError(
            f"cannot write {what}to {str(where)!r}: it is a folder; give the name of a file", path=str(where), line=None
        )
    if not where.parent.is_dir():
        raise MissingFileError(
            f"cannot write {what}to {str(where)!r}: the folder {str(where.parent)!r} does not exist; make it first",
            path=str(where.parent),
        )
    return where


def get(path: Path, limit: str) -> bytes:
    """All of a file; `MissingFileError` where there is none, `FileFormatError` where it cannot be read, or is larger
    than the limit of this name in bytes: it is compared before anything is read."""
    if not path.is_file():
        what = "this is a folder" if path.is_dir() else "there is no such file"
        raise MissingFileError(f"cannot read {str(path)!r}: {what}; the working folder is {Path.cwd()}", path=str(path))
    most = limits.limit(limit)
    try:
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            content = b"" if size > most else file.read(size + 1)
            content += file.read(most + 1 - size) if len(content) > size else b""  # it grows
    except OSError as error:
        raise FileFormatError(f"cannot read {str(path)!r}: {_why(error)}", path=str(path), line=None) from error
    limits.refuse_above(limit, max(size, len(content)), str(path))
    return content


MALFORMED = (
    KeyError, IndexError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError, MemoryError, EOFError,
    OSError, struct.error,
)  # fmt: skip
"""Errors of using what a malformed file contains."""


@contextmanager
def malformed(refusal: Callable[[Exception], FileFormatError]) -> Iterator[None]:
    """Where the content of a file is used that is intact, but of which nobody knows who wrote it: errors of Python are
    the refusal that is made of them."""
    try:
        yield
    except PartitaError:  # may be one of those too
        raise
    except MALFORMED as error:
        raise refusal(error) from error


_PER_LIST, _PER_ENTRY = 88, 32
"""Bytes of memory of a list or an object in Python, and of an entry."""


class Allowance:
    """Memory that a stored result may take, by the size of its file."""

    def __init__(self, path: Path, size: int) -> None:
        self.path, self.size, self.taken = path, size, 0
        self.most = limits.limit("unpacked_factor") * size + limits.limit("unpacked_bytes")

    def take(self, count: int, what: str = "its arrays") -> None:
        """Refuse the file where `count` bytes more are too many: before they are allocated."""
        self.taken += count
        if self.taken > self.most:
            words = (
                f"{what} take {self.taken} bytes, more than the {self.most} that a file of {self.size} bytes may take"
            )
            raise FileFormatError(
                f"cannot read {str(self.path)!r}: {words}; {limits.advice('unpacked_bytes', self.taken)}",
                path=str(self.path),
                line=None,
            )

    def text(self, content: bytes) -> None:
        """Refuse JSON whose lists and objects have no room."""
        opens = content.count(b"[") + content.count(b"{")
        self.take(_PER_LIST * opens + _PER_ENTRY * content.count(b",") + 3 * len(content), "its entries")


_OTHERS = (
    (b"\x1f\x8b", "it is compressed by gzip: unpack it first"),
    (b"PK\x03\x04", "it is a zip archive: unpack it first"),
    (b"BZh", "it is compressed by bzip2: unpack it first"),
    (b"\xfd7zXZ", "it is compressed by xz: unpack it first"),
    (b"version https://git-lfs", "it is a Git LFS pointer, not the file itself; git lfs pull fetches the file"),
)


def other(content: bytes) -> str | None:
    """The kind of a file that is not a model file, judged by its first bytes."""
    return next((words for begin, words in _OTHERS if content.startswith(begin)), None)


def put(path: Path, content: bytes) -> Path:
    """Write `content` beside `path` first and move it there when it is safely stored: a half-written file is never
    visible, and where it cannot be written (no space, no permission) an older file is unchanged. Raises
    `FileFormatError`."""
    draft = _beside(path, "part")
    try:
        try:
            with draft.open("wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            os.replace(draft, path)
        finally:
            draft.unlink(missing_ok=True)
        clear_drafts(path.parent, glob.escape(path.name), _ABANDONED)
    except (OSError, ValueError) as error:
        raise FileFormatError(
            f"cannot write {str(path)!r} ({len(content)} bytes): {_why(error)}; the previous content is unchanged. "
            f"Free space, or give another path",
            path=str(path),
            line=None,
        ) from error
    return path


def clear_drafts(folder: Path, name: str = "*", older_than: float = 0.0) -> None:
    """Remove what killed processes left of files that they were writing: of all names or one, older than this [s]."""
    for draft in folder.glob(f".{name}.*.part"):
        with suppress(OSError):
            if draft.is_file() and time.time() - draft.stat().st_mtime >= older_than:
                draft.unlink()


def _beside(path: Path, ending: str) -> Path:
    """A temporary name next to `path` that no other thread, process or machine uses."""
    return path.with_name(f".{path.name}.{secrets.token_hex(8)}.{ending}")


def put_folder(path: Path, files: dict[str, bytes]) -> Path:
    """The same for a folder of files, sealed together: it is written beside `path` and takes its place as a whole, by
    renaming the older one away and the new one there. Where that fails, the older one is put back."""
    draft, older = _beside(path, "part"), _beside(path, "old")
    seal = b"sha256:" + _digest(_joined(files))
    try:
        try:
            for name, content in files.items():
                file = draft / name
                file.parent.mkdir(parents=True, exist_ok=True)
                with file.open("wb") as stream:
                    stream.write(content.replace(BLANK.encode(), seal))
                    stream.flush()
                    os.fsync(stream.fileno())
            for attempt in range(_ATTEMPTS):
                try:
                    with suppress(FileNotFoundError):
                        os.replace(path, older)
                    os.replace(draft, path)
                    break
                except OSError:
                    # another writer may have put its folder there meanwhile, which is then replaced
                    if older.exists() and not path.exists():
                        os.replace(older, path)
                    if attempt + 1 == _ATTEMPTS or not path.exists():
                        raise
                    shutil.rmtree(older, ignore_errors=True)
        finally:
            for left in (draft, older):
                if left.is_file():
                    left.unlink()
                shutil.rmtree(left, ignore_errors=True)
    except (OSError, ValueError) as error:
        raise FileFormatError(
            f"cannot write {str(path)!r}: {_why(error)}; the previous content is unchanged. Free space, or give "
            f"another path",
            path=str(path),
            line=None,
        ) from error
    return path


def get_folder(path: Path) -> dict[str, bytes]:
    """All files of a folder by their names in it; `FileFormatError` where one cannot be read, or all are larger
    together than a stored result may be."""
    try:
        files = [p for p in sorted(path.rglob("*")) if p.is_file()]
        limits.refuse_above("result_bytes", sum(p.stat().st_size for p in files), str(path))
        return {p.relative_to(path).as_posix(): p.read_bytes() for p in files}
    except OSError as error:
        raise FileFormatError(f"cannot read {str(path)!r}: {_why(error)}", path=str(path), line=None) from error


def intact_folder(files: dict[str, bytes]) -> bool | None:
    """Whether a sealed folder has exactly the files that were written, unchanged; None if there is no seal."""
    mark = next((found for content in files.values() if (found := _MARK.search(content))), None)
    if mark is None:
        return None
    blank = {name: content.replace(mark[0], BLANK.encode()) for name, content in files.items()}
    return _digest(_joined(blank)) == mark[1]


def _joined(files: dict[str, bytes]) -> bytes:
    """Names, lengths and contents in one, so that no two folders give the same bytes."""
    parts = (f"{name}\0{len(files[name])}\0".encode() + files[name] for name in sorted(files))
    return b"".join(parts)


def _is_ours(folder: Path) -> bool:
    """Whether a folder is a sealed one, so that replacing it destroys nothing else."""

    def small() -> Iterator[Path]:
        return (p for p in folder.rglob("*") if p.is_file() and p.stat().st_size < _SMALL)

    for _ in range(_LOOKS):
        with suppress(FileNotFoundError):  # another writer replaces it while it is read
            if any(_MARK.search(p.read_bytes()) for p in small()):
                return True
    return False


def _why(error: Exception) -> str:
    return error.strerror if isinstance(error, OSError) and error.strerror else str(error)


def sealed(content: bytes) -> bytes:
    """`content` with its digest instead of the first `BLANK`."""
    return content.replace(BLANK.encode(), b"sha256:" + _digest(content), 1)


def intact(content: bytes) -> bool | None:
    """Whether a sealed file is as it was written; None where no seal is found."""
    mark = _MARK.search(content)
    if mark is None:
        return None
    first, last = mark.span()
    return _digest(content[:first] + BLANK.encode() + content[last:]) == mark[1]


def _digest(content: bytes) -> bytes:
    return hashlib.sha256(content).hexdigest().encode()
