"""Reading a stored result back."""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError
from ..files import get, intact, place
from .load_check import check
from .record import Record
from .result import Result
from .save_json import VERSION
from .sensor import StoredSensors
from .source import CHECKS, ENERGIES, OBSERVED, REACTIONS, StoredSource

UNREADABLE = (
    KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError, RecursionError, MemoryError, EOFError,
    OSError, struct.error,
)  # fmt: skip
"""What reading raises where the content is not as it should be."""

FLAGS = ("determined_world", "determined_joint", "determined_drive", "determined_effort")
STORED = (*ENERGIES, *CHECKS, *OBSERVED, *REACTIONS, "joint_acceleration", *FLAGS)


def load(path: str | os.PathLike[str]) -> Result:
    """The result stored in `path` (`.json` or `.nc`, written by `Result.save`).

    It reads as the original did: arrays, joints, bodies, reactions, log, certificate, plots and page.
    Only what was computed then is there; for other times, run the mechanism again. Raises
    `MissingFileError`, or `FileFormatError` when the file is not a stored result.

    >>> load("run.json").joint("A").force                              # doctest: +SKIP
    """
    source = place(path)
    readers = {".json": _read_json, ".nc": _read_netcdf}
    content = get(source)
    reader = readers.get(source.suffix.lower())
    if reader is None:
        raise _bad(source, f"results are read from .json and .nc, not from {source.suffix!r}; save in one of these")
    account, arrays = reader(source, content)
    try:
        record = Record.from_account(account, arrays)
        check(record, arrays)
        return _restored(record, arrays)
    except UNREADABLE as error:
        raise _bad(source, f"it is not a complete result ({type(error).__name__}: {error}); simulate again") from error


def _restored(record: Record, arrays: dict[str, NDArray[Any]]) -> Result:
    stored = None
    if "body_position" in arrays or record.description is not None:
        nt, summary = len(record.arrays["t"]), record.summary
        # files of before do not hold them
        unknown = {key: np.full(nt, np.nan) for key in CHECKS}
        unknown["joint_acceleration"] = np.full(_empty("joint_acceleration", nt, summary), np.nan)
        unknown["effort"] = record.arrays["multipliers"][:, int(summary.get("closing_rows", 0)) :]
        missing = {key: np.zeros(_empty(key, nt, summary)) for key in STORED if key not in (*arrays, *unknown)}
        stored = StoredSource({**unknown, **missing, **{key: arrays[key] for key in STORED if key in arrays}})
    sensors = StoredSensors(record.summary.get("sensors", ()), arrays, len(record.arrays["t"]))
    return Result(record, stored, sensors)


def _empty(key: str, nt: int, summary: Mapping[str, Any]) -> tuple[int, ...]:
    """Shape of an array that had no entries (a body without joints, joints without freedoms, no outputs)."""
    nb, nj = len(summary.get("bodies", ())), len(summary.get("joints", ()))
    if key.startswith("body"):
        return (nt, nb, 3, 3) if key == "body_rotation" else (nt, nb, 3)
    if key == "residuals":
        return (nt, nb)
    if key == "determined_effort":
        return (nt, int(summary.get("rows", 0)) - int(summary.get("closing_rows", 0)))
    if key in ("joint_position", "joint_velocity", "joint_acceleration", "drive", "determined_drive"):
        return (nt, sum(joint["q" if key == "joint_position" else "v"][1] for joint in summary.get("joints", ())))
    if key.startswith("determined"):
        return (nt, nj, 6)
    if key in ("residual", *ENERGIES):
        return (nt,)
    return (nt, nj, 3, 3) if key == "joint_rotation" else (nt, nj, 3)


def _read_json(path: Path, content: bytes) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    try:
        document = json.loads(content.decode("utf-8"))
    except json.JSONDecodeError as error:
        raise FileFormatError(
            f"{str(path)!r}, line {error.lineno}: not JSON ({error.msg})", path=str(path), line=error.lineno
        ) from error
    except UnicodeDecodeError as error:
        raise _bad(path, "it is not text in UTF-8") from error
    except (ValueError, RecursionError) as error:
        raise _bad(path, f"it is not JSON ({error})") from error
    if not isinstance(document, dict) or "partita_result" not in document:
        raise _bad(path, "it is not a stored result (no key 'partita_result'); save one with result.save")
    _check_version(path, document["partita_result"])
    _check_seal(path, content)
    try:
        arrays = {str(key): _array(item) for key, item in document["arrays"].items()}
        return document["account"], arrays
    except UNREADABLE as error:
        raise _bad(path, f"its arrays cannot be read ({type(error).__name__}: {error})") from error


def _array(item: Mapping[str, Any]) -> NDArray[Any]:
    """An array of the file; null stands for NaN."""
    return np.array(item["values"], dtype=float).reshape(item["shape"])


def _read_netcdf(path: Path, content: bytes) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    from scipy import io  # slow to import, and few read files

    if not content.startswith(b"CDF"):
        raise _bad(path, "it is not NetCDF in the classic format")
    if b"partita_result" not in content:
        raise _bad(path, "it is NetCDF, but not a stored result of partita, or a damaged one")
    # before it is taken apart: sizes in a damaged file may ask for all memory there is
    if intact(content) is not None:
        _check_seal(path, content)
    try:
        with io.netcdf_file(BytesIO(content), "r", mmap=False) as file:
            _check_version(path, int(getattr(file, "partita_result", 0)))
            _check_seal(path, content)
            account = json.loads(bytes(file.partita_account).decode("utf-8"))
            arrays = {
                name: _native(stored.data)
                for name, stored in file.variables.items()
                if not name.endswith(("_name", "_unit"))
            }
    except FileFormatError:
        raise
    except UNREADABLE as error:
        raise _bad(path, f"it is not NetCDF in the classic format ({type(error).__name__}: {error})") from error
    return account, arrays


def _native(values: NDArray[Any]) -> NDArray[Any]:
    """In the byte order of this machine: the file is big-endian."""
    return np.array(values, dtype=values.dtype.newbyteorder("="))


def _check_version(path: Path, version: Any) -> None:
    if version != VERSION:
        raise _bad(path, f"it has version {version} of the format, this program reads version {VERSION}")


def _check_seal(path: Path, content: bytes) -> None:
    if not intact(content):
        raise _bad(
            path,
            "its content is not what was written (the checksum does not agree): it was changed or damaged since; take "
            "another copy of it, or simulate again",
        )


def _bad(path: Path, why: str) -> FileFormatError:
    return FileFormatError(f"cannot read {str(path)!r}: {why}", path=str(path), line=None)
