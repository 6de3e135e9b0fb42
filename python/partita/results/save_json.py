"""JSON: the whole result in one readable file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ..readable import Readable
from .record import plain
from .variables import variables

VERSION = 1


def write_json(result: Readable, path: Path) -> None:
    """Account and arrays of `result`; numbers to full precision, NaN and infinities as null."""
    path.write_text(json.dumps(document(result), ensure_ascii=False, separators=(",", ":")), encoding="utf-8")


def document(result: Readable) -> dict[str, Any]:
    """The file's content: `partita_result` (its version), the account, `arrays` by name with axes and units."""
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
    return {"partita_result": VERSION, "account": result.record.account(), "arrays": arrays}
