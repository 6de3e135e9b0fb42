"""Reading a stored result back."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import netcdf_file

from ..errors import FileFormatError, MissingFileError
from .record import Record
from .result import Result
from .save_json import VERSION
from .source import ENERGIES, OBSERVED, REACTIONS, StoredSource

STORED = (*ENERGIES, *OBSERVED, *REACTIONS, "determined_world", "determined_joint")


def load(path: str | os.PathLike[str]) -> Result:
    """The result stored in `path` (`.json` or `.nc`, written by `Result.save`).

    It reads as the original did: arrays, joints, bodies, reactions, log, certificate, plots and page.
    Only what was computed then is there; for other times, run the mechanism again. Raises
    `MissingFileError`, or `FileFormatError` when the file is not a stored result.

    >>> load("run.json").joint("A").force                              # doctest: +SKIP
    """
    source = Path(path)
    if not source.is_file():
        raise MissingFileError(f"there is no file {str(source)!r}", path=str(source))
    readers = {".json": _read_json, ".nc": _read_netcdf}
    reader = readers.get(source.suffix.lower())
    if reader is None:
        raise _bad(source, f"results are read from .json and .nc, not from {source.suffix!r}; save in one of these")
    account, arrays = reader(source)
    try:
        return _restored(account, arrays)
    except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
        raise _bad(source, f"it is not a complete result ({type(error).__name__}: {error})") from error


def _restored(account: Mapping[str, Any], arrays: dict[str, NDArray[Any]]) -> Result:
    record = Record.from_account(account, arrays)
    stored = None
    if "body_position" in arrays or account.get("spec") is not None:
        nt, summary = len(record.arrays["t"]), record.summary
        stored = StoredSource({key: arrays.get(key, np.zeros(_empty(key, nt, summary))) for key in STORED})
    return Result(record, stored)


def _empty(key: str, nt: int, summary: Mapping[str, Any]) -> tuple[int, ...]:
    """Shape of an array that had no entries (a body without joints, joints without freedoms, no outputs)."""
    nb, nj = len(summary.get("bodies", ())), len(summary.get("joints", ()))
    if key.startswith("body"):
        return (nt, nb, 3, 3) if key == "body_rotation" else (nt, nb, 3)
    if key in ("joint_position", "joint_velocity", "drive"):
        return (nt, sum(joint["q" if key == "joint_position" else "v"][1] for joint in summary.get("joints", ())))
    if key.startswith("determined"):
        return (nt, nj, 6)
    if key in ("residual", *ENERGIES):
        return (nt,)
    return (nt, nj, 3, 3) if key == "joint_rotation" else (nt, nj, 3)


def _read_json(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except json.JSONDecodeError as error:
        raise FileFormatError(
            f"{str(path)!r}, line {error.lineno}: not JSON ({error.msg})", path=str(path), line=error.lineno
        ) from error
    except UnicodeDecodeError as error:
        raise _bad(path, "it is not text in UTF-8") from error
    if not isinstance(document, dict) or "partita_result" not in document:
        raise _bad(path, "it is not a stored result (no key 'partita_result'); save one with result.save")
    _check_version(path, document["partita_result"])
    try:
        arrays = {key: _array(item) for key, item in document["arrays"].items()}
        return document["account"], arrays
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise _bad(path, f"its arrays cannot be read ({type(error).__name__}: {error})") from error


def _array(item: Mapping[str, Any]) -> NDArray[Any]:
    """An array of the file; null stands for NaN."""
    return np.array(item["values"], dtype=float).reshape(item["shape"])


def _read_netcdf(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    try:
        with netcdf_file(str(path), "r", mmap=False) as file:
            text = getattr(file, "partita_account", None)
            if text is None:
                raise _bad(path, "it is NetCDF, but not a stored result of partita")
            _check_version(path, int(getattr(file, "partita_result", 0)))
            account = json.loads(bytes(text).decode("utf-8"))
            arrays = {
                name: _native(stored.data)
                for name, stored in file.variables.items()
                if not name.endswith(("_name", "_unit"))
            }
    except (TypeError, ValueError, KeyError, IndexError, EOFError) as error:
        if isinstance(error, FileFormatError):
            raise
        raise _bad(path, f"it is not NetCDF in the classic format ({error})") from error
    return account, arrays


def _native(values: NDArray[Any]) -> NDArray[Any]:
    """In the byte order of this machine: the file is big-endian."""
    return np.array(values, dtype=values.dtype.newbyteorder("="))


def _check_version(path: Path, version: Any) -> None:
    if version != VERSION:
        raise _bad(path, f"it has version {version} of the format, this program reads version {VERSION}")


def _bad(path: Path, why: str) -> FileFormatError:
    return FileFormatError(f"cannot read {str(path)!r}: {why}", path=str(path), line=None)
