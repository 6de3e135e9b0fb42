"""The study: each file of a folder is loaded, assembled and, if asked, compared."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import partita as pt

from .loops import Compared, compare
from .others import OTHERS, Incomparable, difference

SUFFIXES = (".urdf", ".sdf", ".mjcf", ".xml")
MEASURED = ("motion", "unknown")
"""Kinds of remarks after which the mechanism may move otherwise than in the file."""
EQUAL = 1e-9
"""Accelerations are equal to this, in parts of the largest: matrices of robots have conditions of up to 1e6."""


@dataclass(frozen=True)
class Row:
    """What became of a file: loaded or why not; how far from another program, or why it was not compared."""

    path: Path
    refused: str = ""
    mobility: int | None = None
    closure: float = 0.0
    open: str = ""
    remarks: int = 0
    moving: int = 0
    repaired: bool = False
    apart: float | None = None
    incomparable: str = ""
    loops: Compared | None = None

    @property
    def disagrees(self) -> bool:
        """Another program has other accelerations, and nothing was said that explains it. With loops the
        exact solutions of the equations of both count: a program may solve its own with some error."""
        apart = self.apart if self.loops is None else self.loops.exact
        return apart is not None and apart > EQUAL and not self.moving and not self.repaired

    def __str__(self) -> str:
        name = f"{self.path.parent.name}/{self.path.name}"
        if self.refused:
            return f"{name:<50} refused: {self.refused}"
        if self.mobility is None:
            return f"{name:<50} {self.open}"
        text = f"{self.mobility:4} dof  closure {self.closure:.0e}  remarks {self.remarks} ({self.moving} of motion)"
        text += "  repaired" if self.repaired else ""
        if self.apart is not None:
            shown = f"{self.apart:.0e}" if self.loops is None else str(self.loops)
            text += f"  accelerations {shown}" + ("  DISAGREES" if self.disagrees else "")
        return f"{name:<50} {text}" + (f"  not compared: {self.incomparable:.60}" if self.incomparable else "")


def row(path: Path, root: Path | None = None, against: str | None = None) -> Row:
    """Load a file and look at it."""
    try:
        m = pt.load(path, root=root)
    except pt.errors.PartitaError as error:
        return Row(path, refused=error.message)
    assert m.reading is not None
    remarks = m.reading.remarks
    counts = {
        "remarks": len(remarks),
        "moving": sum(group.kind in MEASURED for group in remarks),
        "repaired": any("principal values" in group.text for group in remarks),
    }
    try:
        compiled, state = m.compile(), m.assemble()
    except pt.errors.PartitaError as error:
        return Row(path, open=error.message, **counts)  # type: ignore[arg-type]
    closure = float(state.assembly["residual"]) if state.assembly is not None else 0.0
    apart, why, closed = None, "", None
    if against is not None and path.suffix in OTHERS[against][0]:
        try:
            if against == "pinocchio" and compiled.mobility != len(compiled.velocity_names):
                closed = compare(m, path)
                apart = closed.apart
            else:
                apart = difference(m, path, against)
        except (Incomparable, pt.errors.PartitaError) as error:
            why = " ".join(str(error).split())
    return Row(path, "", compiled.mobility, closure, "", apart=apart, incomparable=why, loops=closed, **counts)  # type: ignore[arg-type]


def files(folder: Path) -> Iterator[Path]:
    """Robots' files in a folder and below; XML of other kinds is left out."""
    for path in sorted(folder.rglob("*")):
        xml = path.suffix == ".xml"
        if path.suffix in SUFFIXES and path.is_file() and not (xml and b"<mujoco" not in path.read_bytes()):
            yield path


def main(arguments: Sequence[str]) -> int:
    """Print a row for each file and a summary."""
    parser = argparse.ArgumentParser(prog="python -m robots", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--root", type=Path, help="folder within which the files that models name may lie")
    parser.add_argument("--against", choices=tuple(OTHERS), help="program to compare accelerations of trees with")
    asked = parser.parse_args(arguments)
    rows = []
    for path in files(asked.folder):
        rows.append(row(path, asked.root, asked.against))
        print(rows[-1], flush=True)
    loaded = [x for x in rows if not x.refused]
    compared = [x for x in rows if x.apart is not None]
    print(
        f"{len(rows)} files: {len(loaded)} loaded, {sum(x.mobility is not None for x in loaded)} of them move, "
        f"{len(rows) - len(loaded)} refused; {len(compared)} compared, {sum(x.disagrees for x in rows)} disagree"
    )
    return int(any(x.disagrees for x in rows))
