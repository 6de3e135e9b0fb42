"""One writer to a store at a time: a lock that the system releases when its process ends, however it ends."""

from __future__ import annotations

import os
import platform
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import FileFormatError

LOCK = "lock"
"""Name of the file that is held."""

_OPEN: set[str] = set()
_GUARD = threading.Lock()


def unusable(folder: Path, error: OSError) -> FileFormatError:
    """The error of a store that the system refuses."""
    why = error.strerror or str(error)
    return FileFormatError(f"cannot use the store {str(folder)!r}: {why}", path=str(folder), line=None)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a store; `FileFormatError` where another process or this one holds it.

    The lock of the system is held by processes; within this one a list of the open stores does its part.
    """
    key = os.path.realpath(folder)
    with _GUARD:
        if key in _OPEN:
            raise _taken(folder, "this process")
        _OPEN.add(key)
    try:
        try:
            stream = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT, 0o644)
        except OSError as error:
            raise unusable(folder, error) from error
        try:
            _hold(stream, folder)
            yield
        finally:
            os.close(stream)
    finally:
        with _GUARD:
            _OPEN.discard(key)


def _hold(stream: int, folder: Path) -> None:
    try:
        if os.name == "nt":
            import msvcrt

            msvcrt.locking(stream, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
        else:
            import fcntl

            # held by the process, not by its children: workers that outlive it hold nothing
            fcntl.lockf(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        owner = os.pread(stream, 200, 0).decode("utf-8", "replace").strip() if hasattr(os, "pread") else ""
        raise _taken(folder, owner or "another process") from error
    os.ftruncate(stream, 0)
    os.write(stream, f"process {os.getpid()} on {platform.node()}".encode())


def _taken(folder: Path, owner: str) -> FileFormatError:
    return FileFormatError(
        f"{owner} is writing to the store {str(folder)!r}; wait for it, end it, or give another store",
        path=str(folder),
        line=None,
    )
