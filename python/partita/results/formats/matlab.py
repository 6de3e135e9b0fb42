"""MAT (version 5): for MATLAB and Octave."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...files import BLANK, Allowance, sealed
from ..content import Content, header_within
from ..record import read_exact
from .matlab_elements import unpacked

HEAD = 116
"""Bytes at the beginning that are free for a text; the format wants no zeros among the first four."""
SHIFTED = "independent"
"""Indices, which count from 1 in MATLAB."""


def write(content: Content) -> bytes:
    """Arrays under their own names, time along the first axis; cells of names in the structure `names`.

    `units` and `about` tell the unit and the meaning of each array, `partita` holds the account. `independent` counts
    from 1, as MATLAB does. The seal stands in the text at the beginning.
    """
    from scipy import io  # slow to import, and few write files

    found, account = content.variables, read_exact(content.account)
    stored: dict[str, Any] = {v.name: v.values + 1 if v.name == SHIFTED else v.values for v in found}
    labelled = [axis for axis in content.axes.values() if axis.labels]
    stored["names"] = {axis.name: _cell(axis.labels) for axis in labelled}
    stored["column_units"] = {axis.name: _cell(axis.units) for axis in labelled if any(axis.units)}
    stored["units"] = {v.name: v.unit for v in found}
    stored["about"] = {v.name: v.text for v in found}
    stored["run"] = {
        "title": str(account["summary"].get("name") or "system"),
        "status": account["status"],
        "message": account["message"],
        "counters": {key: float(value) for key, value in account["counters"].items()},
    }
    stored["partita"] = content.text()
    file = BytesIO()
    io.savemat(file, stored, long_field_names=True, oned_as="column", do_compression=True)
    text = f"MATLAB 5.0 MAT-file, Partita, {BLANK}".encode().ljust(HEAD)
    return sealed(text + file.getvalue()[HEAD:])


def read(content: bytes, room: Allowance) -> tuple[dict[str, Any], Mapping[str, Any]]:
    """Header and arrays."""
    from scipy import io

    plain = unpacked(content, room)
    found = io.loadmat(BytesIO(plain))
    account = str(found["partita"].item())
    room.text(account.encode())
    header = header_within(room, account)
    arrays = {name: found[name] for name in header["arrays"]}
    if SHIFTED in arrays:
        arrays[SHIFTED] = arrays[SHIFTED] - 1
    return header, arrays


def _cell(words: tuple[str, ...]) -> NDArray[np.object_]:
    cell = np.empty(len(words), dtype=object)
    cell[:] = words
    return cell
