"""Names of the previous release, listed here and nowhere else.

Each still works in this release, raises a `DeprecationWarning` that says what to write instead, and goes with the next.
Results and certificates stored under the old names are read without a warning.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

ERRORS = {"DoubtfulResultWarning": "SuspectResultWarning"}
"""Classes of `partita.errors`."""
VERDICTS = {"holds": "valid", "doubtful": "suspect", "broken": "invalid"}
"""Values of `certificate.verdict` and of `result.status`."""
CERTIFICATE = {"misfit": "geometric_error"}
"""Fields of a `Certificate`."""
FINDING = {"broken": "invalid"}
"""Fields of a `Finding`."""
COUNTERS = {"exchanges": "switches"}
"""Keys of `result.counters`."""
OPTIONS = {"exchange": "switch_threshold"}
"""Options of `simulate` and `stepper`, and keys of `result.options`."""
REPORT = {
    "freedoms": "degrees_of_freedom",
    "cures": "remedies",
    "misfit": "geometric_error",
    "misfits": "geometric_errors",
}
"""Keys of `report().to_dict()`."""


def warn(old: str, new: str, stacklevel: int = 3) -> None:
    """Warn the caller of the caller that `old` is now `new`."""
    warnings.warn(f"{old} is deprecated; use {new}", DeprecationWarning, stacklevel=stacklevel)


def option(name: str, given: Any, value: Any, stacklevel: int = 4) -> Any:
    """The value of an option that may have been `given` by its old name."""
    if given is None:
        return value
    warn(f"{name}=", f"{OPTIONS[name]}=", stacklevel)
    return given


def renamed(plain: Mapping[str, Any], old: Mapping[str, str]) -> dict[str, Any]:
    """Plain data with old keys replaced, as it is read from a file."""
    return {old.get(key, key): value for key, value in plain.items()}


class RenamedKeys(dict[str, Any]):
    """A dictionary some keys of which had other names, under which they are still found."""

    def __init__(self, plain: Mapping[str, Any] | None = None, old: Mapping[str, str] | None = None) -> None:
        super().__init__(plain or {})
        self._old = dict(old or {})

    def _new(self, key: Any) -> Any:
        if dict.__contains__(self, key) or key not in self._old:
            return key
        warn(f'"{key}"', f'"{self._old[key]}"', stacklevel=4)
        return self._old[key]

    def __getitem__(self, key: Any) -> Any:
        return super().__getitem__(self._new(key))

    def __contains__(self, key: Any) -> bool:
        return super().__contains__(self._new(key))

    def get(self, key: Any, default: Any = None) -> Any:
        return super().get(self._new(key), default)

    def with_old(self) -> dict[str, Any]:
        """All keys, those of the previous release as well, for programs that read JSON."""
        return {**self, **{old: self[new] for old, new in self._old.items() if dict.__contains__(self, new)}}

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self), self._old)


class Verdict(str):
    """A verdict or a status, equal to its old word as well."""

    def __eq__(self, other: object) -> bool:
        if isinstance(other, str) and VERDICTS.get(other) == str(self):
            warn(f'"{other}"', f'"{self}"')
            return True
        return str.__eq__(self, other)

    def __ne__(self, other: object) -> bool:
        return not self == other

    __hash__ = str.__hash__
