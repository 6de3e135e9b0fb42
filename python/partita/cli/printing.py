"""Findings of a command as JSON on stdout: the form for other programs."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np


def print_json(found: Any) -> None:
    """Print `found`; NaN and infinity, which JSON does not have, become null."""
    print(json.dumps(plain(found), indent=2, ensure_ascii=False, allow_nan=False))


def plain(value: Any) -> Any:
    """Lists, dicts, numbers and texts alone."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return plain({field.name: getattr(value, field.name) for field in dataclasses.fields(value)})
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
