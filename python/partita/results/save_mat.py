"""MAT (version 5): for MATLAB and Octave."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..readable import Readable
from .variables import axes, variables


def as_mat(result: Readable) -> bytes:
    """Arrays under their own names, time along the first axis; cells of names in the structure `names`.

    `units` and `about` tell the unit and the meaning of each array. `independent` counts from 1, as
    MATLAB does.
    """
    from scipy import io  # slow to import, and few write files

    found = variables(result)
    content: dict[str, Any] = {v.name: v.values + 1 if v.name == "independent" else v.values for v in found}
    used = {name for v in found for name in v.axes}
    labelled = [axis for axis in axes(result).values() if axis.name in used]
    content["names"] = {axis.name: _cell(axis.labels) for axis in labelled}
    content["column_units"] = {axis.name: _cell(axis.units) for axis in labelled if any(axis.units)}
    content["units"] = {v.name: v.unit for v in found}
    content["about"] = {v.name: v.text for v in found}
    content["run"] = {
        "title": result.title,
        "status": result.status,
        "message": result.message,
        "counters": {key: float(value) for key, value in result.counters.items()},
    }
    file = BytesIO()
    io.savemat(file, content, long_field_names=True, oned_as="column", do_compression=True)
    return file.getvalue()


def _cell(words: tuple[str, ...]) -> NDArray[np.object_]:
    cell = np.empty(len(words), dtype=object)
    cell[:] = words
    return cell
