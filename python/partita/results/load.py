"""Reading a stored result back."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError, MissingDependencyError, PartitaError
from ..files import MALFORMED, Allowance, get, get_folder, intact, intact_folder, place
from .account_check import check_account
from .certificate import Certificate
from .content import VERSION, restored
from .load_check import check
from .record import Record
from .result import Result
from .save import FOLDER, Format, format_of
from .sensor import StoredSensors
from .source import CHECKS, ENERGIES, OBSERVED, REACTIONS, StoredSource

FLAGS = ("determined_world", "determined_joint", "determined_drive", "determined_effort")
STORED = (*ENERGIES, *CHECKS, *OBSERVED, *REACTIONS, "joint_acceleration", *FLAGS)


def load_result(path: str | os.PathLike[str]) -> Result:
    """Load the result stored in `path`, in any format that `Result.save` writes; the ending determines the format.

    It is equal to the original, number for number: arrays, names, units, settings, joints, bodies, reactions, log,
    certificate, plots and page. It contains only what was computed; for other times, run the mechanism again. The
    checksum reveals a file that was changed or damaged, which is refused.

    Raises `MissingFileError`, `FileFormatError` if the file is not a stored result or has changed, and
    `MissingDependencyError` if its format needs a package that is not installed.

    >>> import os, tempfile
    >>> import partita as pt
    >>> run = pt.catalogue.load("four-bar").simulate(0.5)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     run.save(os.path.join(folder, "run.json")) and None
    ...     again = pt.load_result(os.path.join(folder, "run.json"))
    >>> bool((again.joint("A").force == run.joint("A").force).all())
    True
    """
    source = place(path)
    folder = source.suffix.lower() == FOLDER and source.is_dir()
    content = get_folder(source) if folder else get(source, "result_bytes")
    form = format_of(source, f"cannot read {str(source)!r}")
    form.check("reading")
    try:
        if form.name != "JSON":  # for text a syntax error says more than a wrong checksum
            _check_seal(source, content, form.name)
        size = sum(map(len, content.values())) if isinstance(content, dict) else len(content)
        header, values = _parsed(form, source, content, Allowance(source, size))
        _check_version(source, header.get("partita_result"))
        _check_seal(source, content, form.name)
        arrays = {str(name): restored(values[name], about) for name, about in header["arrays"].items()}
        check_account(header["account"])
        record = Record.from_account(header["account"], arrays)
        check(record, arrays)
        result = _restored(record, arrays)
        if "certificate" in header["account"]:
            result.__dict__["certificate"] = Certificate.from_account(header["account"]["certificate"])
        return result
    except json.JSONDecodeError as error:
        raise FileFormatError(
            f"{str(source)!r}, line {error.lineno}: not JSON ({error.msg})", path=str(source), line=error.lineno
        ) from error
    except (UnicodeDecodeError, UnicodeEncodeError) as error:
        raise _bad(source, "it is not text in UTF-8") from error
    except (FileFormatError, MissingDependencyError):
        raise
    except MALFORMED as error:
        raise _incomplete(source, form, error) from error


def _parsed(form: Format, source: Path, content: Any, room: Allowance) -> tuple[dict[str, Any], Any]:
    """Header and arrays of a file. Each parser raises errors of its own on what is malformed."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return form.read(source if isinstance(content, dict) else content, room)
    except (PartitaError, json.JSONDecodeError, UnicodeError):
        raise
    except Exception as error:
        raise _incomplete(source, form, error) from error


def _incomplete(source: Path, form: Format, error: Exception) -> FileFormatError:
    words = " ".join(str(error).split())
    return _bad(
        source, f"it is not a complete result in {form.name} ({type(error).__name__}: {words:.200}); simulate again"
    )


def _restored(record: Record, arrays: dict[str, NDArray[Any]]) -> Result:
    stored = None
    if "body_position" in arrays or record.description is not None:
        nt, summary = len(record.arrays["t"]), record.summary
        # files of earlier versions do not contain them
        unknown = {key: np.full(nt, np.nan) for key in CHECKS}
        unknown["joint_acceleration"] = np.full(_empty("joint_acceleration", nt, summary), np.nan)
        unknown["effort"] = record.arrays["multipliers"][:, int(summary.get("closing_rows", 0)) :]
        missing = {key: np.zeros(_empty(key, nt, summary)) for key in STORED if key not in (*arrays, *unknown)}
        stored = StoredSource({**unknown, **missing, **{key: arrays[key] for key in STORED if key in arrays}})
    sensors = StoredSensors(record.summary.get("sensors", ()), arrays, len(record.arrays["t"]))
    return Result(record, stored, sensors)


def _empty(key: str, nt: int, summary: Mapping[str, Any]) -> tuple[int, ...]:
    """Shape of an array that had no entries (a body without joints, joints without degrees of freedom, no outputs)."""
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


def _check_version(path: Path, version: Any) -> None:
    if version != VERSION:
        raise _bad(path, f"it has version {version} of the format, this program reads version {VERSION}")


def _check_seal(path: Path, content: bytes | dict[str, bytes], name: str) -> None:
    sound = intact_folder(content) if isinstance(content, dict) else intact(content)
    if sound is None:
        raise _bad(path, f"it is not a result in {name} as saved by Partita: it contains no checksum")
    if not sound:
        raise _bad(
            path,
            "its content is not what was written (the checksum does not agree): it was changed or damaged since; take "
            "another copy of it, or simulate again",
        )


def _bad(path: Path, why: str) -> FileFormatError:
    return FileFormatError(f"cannot read {str(path)!r}: {why}", path=str(path), line=None)
