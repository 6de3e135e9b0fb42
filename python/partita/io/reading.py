"""Report of a reader on a file: everything that was changed or dropped, with its line."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Remark:
    """A remark on a position in a file; `line` counts from 1, None for the whole file."""

    line: int | None
    text: str

    def __str__(self) -> str:
        return self.text if self.line is None else f"line {self.line}: {self.text}"


@dataclass
class Reading:
    """What became of a model file; `print(m.reading)`.

    Attributes:
        path: the file.
        kind: its format, such as "URDF".
        used: what was read, counted in words.
        changed: what stands in the model otherwise than in the file.
        dropped: what the model does not have.
        shapes: how its bodies look, where the file says so; `run.to_html(path, shapes=m.reading.shapes)` draws them.
    """

    path: Path
    kind: str
    used: list[Remark] = field(default_factory=list)
    changed: list[Remark] = field(default_factory=list)
    dropped: list[Remark] = field(default_factory=list)
    shapes: dict[str, list[dict[str, Any]]] = field(default_factory=dict)

    def __str__(self) -> str:
        parts = [f"{self.kind} {self.path}"]
        for title, remarks in (("used", self.used), ("changed", self.changed), ("dropped", self.dropped)):
            if remarks:
                parts += [f"  {title}:", *(f"    {remark}" for remark in remarks)]
        return "\n".join(parts)

    def to_dict(self) -> dict[str, object]:
        """All of it, ready for JSON.

        >>> from pathlib import Path
        >>> Reading(Path("a.urdf"), "URDF", used=[Remark(None, "1 link")]).to_dict()["used"]
        [{'line': None, 'text': '1 link'}]
        """

        def plain(remarks: list[Remark]) -> list[dict[str, object]]:
            return [{"line": remark.line, "text": remark.text} for remark in remarks]

        return {
            "path": str(self.path),
            "kind": self.kind,
            "used": plain(self.used),
            "changed": plain(self.changed),
            "dropped": plain(self.dropped),
            "shapes": self.shapes,
        }
