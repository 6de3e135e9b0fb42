"""Report of a reader on a file: everything that was changed or dropped, with its line, the same remarks together."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .. import notebook

KINDS = {
    "motion": "dropped or replaced, and the motion differs",
    "bounds": "dropped, which acts at limits, in contacts or when driven",
    "unknown": "not known",
    "other": "dropped, and the motion is the same",
    "looks": "not drawn",
    "changed": "changed",
    "used": "used",
}
"""Kinds of remarks, those that change the motion first, with their titles in a report."""
_WIDTH = 72
"""Characters of a name that a report shows."""
_NAMED = 4
"""Names that a report shows of remarks of one text; `RemarkGroup.names` has all."""


@dataclass(frozen=True)
class Remark:
    """A remark on a position in a file."""

    line: int | None
    """Counts from 1; None for the whole file."""
    text: str
    """What became of it."""
    name: str = ""
    """The element that is meant, where `text` holds for several."""
    kind: str = ""
    """What it means for the motion: a word of `RemarkGroup.kind`."""

    def __str__(self) -> str:
        shown = f"{self.name}: {self.text}" if self.name else self.text
        return shown if self.line is None else f"line {self.line}: {shown}"


@dataclass(frozen=True)
class RemarkGroup:
    """Remarks of one kind and text.

    Attributes:
        kind: what they mean for the motion: "motion" (dropped or replaced, it acts), "bounds" (dropped, it acts at
            limits, in contacts or when driven), "unknown" (not known to the format), "other" (dropped, the motion is
            the same), "looks" (not drawn), "changed" (said otherwise, and means the same), "used".
        text: what they say.
        names: elements of the file that they are about.
        lines: the lines of these, None for the whole file.
    """

    kind: str
    text: str
    names: tuple[str, ...]
    lines: tuple[int | None, ...]

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.lines)

    def __str__(self) -> str:
        named = list(dict.fromkeys(name for name in self.names if name))
        short = [name if len(name) <= _WIDTH else f"{name[: _WIDTH - 3]}..." for name in named[:_NAMED]]
        shown = ", ".join(short) + (f" and {len(named) - _NAMED} more" if len(named) > _NAMED else "")
        line = next((line for line in self.lines if line is not None), None)
        times = f"{self.count} times, from " if self.count > 1 and line is not None else ""
        where = "" if line is None else f"{times}line {line}: "
        return where + (f"{shown}: {self.text}" if shown else self.text)

    def to_dict(self) -> dict[str, object]:
        """All of it, ready for JSON."""
        plain = {"kind": self.kind, "text": self.text, "count": self.count}
        return {**plain, "names": list(self.names), "lines": list(self.lines)}


@dataclass
class Reading:
    """What became of a model file; `print(m.reading)`.

    Attributes:
        path: the file.
        kind: its format, such as "URDF".
        used: what was read, counted in words.
        changed: what stands in the model otherwise than in the file.
        dropped: what the model does not have.
        stands: why nothing moves where nothing does, with what to do; "" where the file does not say so.
        shapes: how its bodies look, where the file says so; pages draw them so unless they are given others.
    """

    path: Path
    kind: str
    used: list[Remark] = field(default_factory=list)
    changed: list[Remark] = field(default_factory=list)
    dropped: list[Remark] = field(default_factory=list)
    shapes: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    stands: str = ""

    @property
    def remarks(self) -> tuple[RemarkGroup, ...]:
        """All remarks, equal ones together, those that change the motion first.

        >>> from pathlib import Path
        >>> from partita.io.reading import Reading, Remark
        >>> reading = Reading(Path("a.urdf"), "URDF", used=[Remark(None, "1 link")])
        >>> reading.dropped += [Remark(3, "does not act", "friction of A"), Remark(9, "does not act", "friction of B")]
        >>> for remarks in reading.remarks:
        ...     print(remarks.kind, remarks.count, remarks)
        motion 2 2 times, from line 3: friction of A, friction of B: does not act
        used 1 1 link
        """
        groups: dict[tuple[str, str], list[Remark]] = {}
        for kind, remarks in (("motion", self.dropped), ("changed", self.changed), ("used", self.used)):
            for remark in dict.fromkeys(remarks):
                groups.setdefault((remark.kind or kind, remark.text), []).append(remark)
        found = [
            RemarkGroup(kind, text, tuple(x.name for x in group), tuple(x.line for x in group))
            for (kind, text), group in groups.items()
        ]
        return tuple(sorted(found, key=lambda group: list(KINDS).index(group.kind)))

    def _repr_html_(self) -> str:
        """The text, in a notebook."""
        return notebook.lines(str(self))

    def __str__(self) -> str:
        parts, title = [f"{self.kind} {self.path}"], ""
        for group in self.remarks:
            if KINDS[group.kind] != title:
                title = KINDS[group.kind]
                parts.append(f"  {title}:")
            parts.append(f"    {group}")
        return "\n".join(parts)

    def to_dict(self) -> dict[str, object]:
        """All of it, ready for JSON; of meshes without a file the numbers of points and triangles.

        >>> from pathlib import Path
        >>> from partita.io.reading import Reading, Remark
        >>> Reading(Path("a.urdf"), "URDF", used=[Remark(None, "1 link")]).to_dict()["remarks"]
        [{'kind': 'used', 'text': '1 link', 'count': 1, 'names': [''], 'lines': [None]}]
        """
        return {
            "path": str(self.path),
            "kind": self.kind,
            "remarks": [group.to_dict() for group in self.remarks],
            "shapes": {name: [_plain(shape) for shape in shapes] for name, shapes in self.shapes.items()},
        }


def _plain(shape: dict[str, Any]) -> dict[str, Any]:
    """Of a mesh that is given itself the numbers of its points and triangles."""
    return {word: len(value) if word in ("points", "faces") else value for word, value in shape.items()}
