"""Report of a writer on a mechanism: all differences and losses in the file."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from pathlib import Path

from .. import notebook
from ..errors import FileFormatError, LossyFileWarning

_SHOWN = 3
"""Remarks in a warning or an error; the report contains all of them."""


@dataclass
class Writing:
    """Report on a mechanism that was written to a file; `print(m.save("robot.urdf"))`.

    Attributes:
        path: the file that was asked for.
        kind: its format, such as "URDF".
        files: all files that were written.
        changed: what is said otherwise there, and means the same.
        dropped: what the format cannot carry: without it the file is of another mechanism.
    """

    path: Path
    kind: str
    files: list[Path] = field(default_factory=list)
    changed: list[str] = field(default_factory=list)
    dropped: list[str] = field(default_factory=list)

    def _repr_html_(self) -> str:
        """The text, in a notebook."""
        return notebook.lines(str(self))

    def __str__(self) -> str:
        parts = [f"{self.kind} {', '.join(map(str, self.files))}"]
        for title, remarks in (("changed", self.changed), ("dropped", self.dropped)):
            if remarks:
                parts += [f"  {title}:", *(f"    {remark}" for remark in remarks)]
        return "\n".join(parts)

    def to_dict(self) -> dict[str, object]:
        """All of it, ready for JSON.

        >>> from pathlib import Path
        >>> from partita.io.writing import Writing
        >>> Writing(Path("a.urdf"), "URDF", dropped=["spring s"]).to_dict()["dropped"]
        ['spring s']
        """
        return {
            "path": str(self.path),
            "kind": self.kind,
            "files": [str(file) for file in self.files],
            "changed": list(self.changed),
            "dropped": list(self.dropped),
        }

    def judge(self, strict: bool) -> None:
        """Before anything is written, refuse losses or warn about them."""
        if not self.dropped:
            return
        shown = "; ".join(self.dropped[:_SHOWN])
        more = f"; and {len(self.dropped) - _SHOWN} more" if len(self.dropped) > _SHOWN else ""
        if strict:
            raise FileFormatError(
                f'"{self.path}": {self.kind} cannot represent: {shown}{more}. Save as .toml, which can, or '
                "without strict",
                path=str(self.path),
                line=None,
            )
        warnings.warn(
            f'"{self.path}" holds another mechanism: {self.kind} cannot represent {shown}{more}. What save returns '
            "lists all of it; strict=True refuses, .toml can represent all",
            LossyFileWarning,
            stacklevel=5,
        )
