"""JSON: the whole result in one readable file."""

from __future__ import annotations

import json
from typing import Any

from ..files import BLANK, sealed
from ..readable import Readable
from .record import plain
from .variables import variables

VERSION = 2


def as_json(result: Readable) -> bytes:
    """Account and arrays of `result`, sealed; numbers to full precision, NaN and infinities as null."""
    return sealed(json.dumps(document(result), ensure_ascii=False, separators=(",", ":")).encode("utf-8"))


def document(result: Readable) -> dict[str, Any]:
    """The file's content: `partita_result` (its version), `checksum`, account, `arrays` by name with axes and units."""
    arrays = {
        v.name: {
            "axes": list(v.axes),
            "unit": v.unit,
            "text": v.text,
            "shape": list(v.values.shape),
            "values": plain(v.values),
        }
        for v in variables(result)
    }
    return {"partita_result": VERSION, "checksum": BLANK, "account": result.record.account(), "arrays": arrays}
