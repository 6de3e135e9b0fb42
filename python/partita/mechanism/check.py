"""`Mechanism.check`: what looks like a mistake, before any run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import notebook
from ..builder.gaps import far_from_drawn, size_of
from ..builder.remarks import remarks, unconnected
from ..builder.unlikely import light
from ..errors import AssemblyError, PartitaError, SingularityError
from ..io import Reading
from ..state import State
from .models import Modelled, layout_of
from .report import Report, report
from .solve import assemble


@dataclass(frozen=True)
class Check:
    """Findings on a mechanism; iterating yields the remarks, and `print` shows all of it in words.

    Attributes:
        closes: whether the loops of the drawing can be closed.
        why: why they cannot; None if they can.
        remarks: what looks like a mistake, a sentence each.
        report: as `m.report()`; None if the loops cannot be closed.
        reading: what became of the file that it was read from; None where it was drawn.
    """

    closes: bool
    why: str | None
    remarks: tuple[str, ...]
    report: Report | None = None
    reading: Reading | None = None

    def __iter__(self) -> Iterator[str]:
        return iter(self.remarks)

    def __len__(self) -> int:
        return len(self.remarks)

    def __bool__(self) -> bool:
        """Whether there is anything to look at."""
        return bool(self.remarks) or not self.closes

    def __str__(self) -> str:
        lines = [] if self.report is None else _counted(self.report.to_dict())
        if not self.closes:
            lines.append(f"does not close: {self.why}")
        return "\n".join([*lines, *(f"look at: {remark}" for remark in self.remarks)])

    def _repr_html_(self) -> str:
        """The text, in a notebook."""
        return notebook.lines(str(self))

    def to_dict(self) -> dict[str, Any]:
        """The findings as plain data, as `partita check --json` prints them."""
        return {
            "reading": None if self.reading is None else self.reading.to_dict(),
            "report": None if self.report is None else self.report.to_dict(),
            "closes": self.closes,
            "why": self.why,
            "remarks": list(self.remarks),
        }


def check(self: Modelled, state: State | None = None) -> Check:
    """Look for mistakes before any run: loops that do not close, points that seem to be given in the wrong axes, bodies
    that nothing holds, starts far from the drawing, contacts that begin deep, redundant constraints, data of unlikely
    size.

    `partita check FILE` prints the same. A run names points in the wrong axes and bodies that nothing holds among its
    notes, and logs them as warnings.

    Args:
        state: where to look; None: the drawing, assembled.

    Raises:
        DescriptionError: there is nothing to move, or the core finds the description inconsistent.

    >>> import partita as pt
    >>> m = pt.Mechanism("swing")
    >>> rod = m.add_rod("rod", start=(2, 0, 0), end=(3, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(2, 0, 0))
    >>> spring = m.add_spring("S", m.ground, (3, 1, 0), rod, (3, 0, 0), stiffness=100.0)
    >>> print(m.check())
    degrees of freedom: 1
    redundant constraints: 0 of 5
    look at: force "S": point2 (3, 0, 0) is in the axes of "rod", where it lies outside of the body; as a point of the \
world it would lie on it: if that is meant, give m.bodies["rod"].world((3, 0, 0)), else .at((3, 0, 0))
    """
    d = self._description
    own = (*remarks(d), *light(d), *(_moved(self) if state is None else ()))
    reading: Reading | None = getattr(self, "reading", None)
    try:
        found = report(self, state)
    except (AssemblyError, SingularityError) as error:
        return Check(False, error.message, own, None, reading)
    data = found.to_dict()
    alone = [f"{name} is connected by no joint" for name in unconnected(d)]  # which is said already
    others = [
        remark
        for remark in (*data["suspicious"], *data["notes"])
        if not any(remark.startswith(words) for words in alone)
    ]
    return Check(True, None, (*own, *others), found, reading)


MOVED = 0.5
"""A start farther from the drawing is probably not meant. Scale: fraction of the size of the drawing. Reason: half of
it is another position."""


def _moved(self: Modelled) -> list[str]:
    """Whether closing the loops and the values of drives take the start far from the drawing."""
    d = self._description
    if any(far_from_drawn(d)):  # which is said already
        return []
    try:
        model, _ = layout_of(self, "relative")
        start = assemble(self)
    except PartitaError:  # which is reported beside
        return []
    names = [body["name"] for body in model.summary["bodies"]]
    at = model.core.motion(np.array([start.t]), start.q[None], start.v[None]).bodies()
    position = np.asarray(at["body_position"]).reshape(-1, 3)
    rotation = np.asarray(at["body_rotation"]).reshape(-1, 3, 3)
    own = {name: (body, body.to_world(body.com)) for name, body in d.bodies.items()}
    if not own:
        return []
    spread = float(np.linalg.norm(np.ptp(np.array([com for _, com in own.values()]), axis=0)))
    wide = [np.sqrt(2.0 * np.trace(body.inertia) / body.mass) for body, _ in own.values() if body.mass > 0.0]
    size = max(size_of(d), spread, *wide)
    away = {
        name: float(np.linalg.norm(position[i] + rotation[i] @ own[name][0].com - own[name][1]))
        for i, name in enumerate(names)
        if name in own
    }
    farthest = max(away, key=lambda name: away[name])
    if not away[farthest] > MOVED * size:
        return []
    return [
        f'the start is far from the drawing: "{farthest}" begins {away[farthest]:.4g} m from where it is drawn, and '
        f"the drawing measures {size:.4g} m; draw the bodies where the motion starts, or check the values of the drives"
    ]


def _counted(report: dict[str, Any]) -> list[str]:
    """Degrees of freedom, redundancy and its remedies."""
    words = [f"degrees of freedom: {report['mobility']}"]
    if report["idle"]:
        words.append(f"  of which idle: {len(report['idle'])}")
    redundant = report["joint_rows"] - report["joint_rank"]
    words.append(f"redundant constraints: {redundant} of {report['joint_rows']}")
    if report["geometric_errors"]:
        words.append(f"geometric error: {report['geometric_error']:.2e} (radians, and fractions of the size)")
    if report["remedies"]:
        remedies = " and ".join(f"{x['is']} {x['joint']} by {x['by']}" for x in report["remedies"])
        words.append(f"  remedy: replace {remedies}; then nothing is redundant, and nothing else moves")
    return words
