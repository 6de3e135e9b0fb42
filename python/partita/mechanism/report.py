"""`Mechanism.report`: what the core found about a mechanism, in words."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from .. import options as run_options
from ..state import State
from .models import Modelled, layout_of
from .solve import _fitting, assemble

_COMPONENTS = ("fx", "fy", "fz", "mx", "my", "mz")


def report(self: Modelled, state: State | None = None, *, coordinates: str = "relative") -> str:
    """Describe the mechanism in words: mobility, redundancy, coordinates and their measure, reactions.

    Args:
        state: where to look; None: the drawing, assembled.
        coordinates: as in `compile`.

    Raises:
        AssemblyError: the loops of the drawing do not close. ArgumentError: the state belongs to another
            model.

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> "1 degree of freedom" in m.report()
    True
    """
    model, _ = layout_of(self, run_options.one_of("coordinates", coordinates, run_options.COORDINATES))
    where = state if state is not None else assemble(self, coordinates=coordinates)
    _fitting("state", where, model)
    found = json.loads(model.core.report(where.t, where.q))
    notes = [*found["notes"], *(note for note in model.notes if note not in found["notes"])]
    parts = [
        _title(self, model.summary, where),
        _mobility(found),
        _redundancy(found),
        _structure(found),
        _coordinates(found),
        _reactions(found),
        _section("Notes", [f"- {note}" for note in notes]) if notes else "",
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _title(mechanism: Modelled, summary: dict[str, Any], state: State) -> str:
    title = f'Mechanism "{mechanism.name}"'
    bodies, joints = len(summary["bodies"]), len(summary["joints"])
    kind = "planar (all motion parallel to one plane)" if summary["planar"] else "spatial"
    text = f"{_count(bodies, 'body', 'bodies')}, {_count(joints, 'joint')}; {kind}. Position at t = {state.t:g} s."
    return f"{title}\n{'=' * len(title)}\n{text}"


def _mobility(found: dict[str, Any]) -> str:
    rows, rank = found["joint_rows"], found["joint_rank"]
    lines = [
        f"The mechanism has {_count(found['mobility'], 'degree')} of freedom in this position.",
        f"Its joints impose {_count(rows, 'condition')} on the velocities of the bodies, of which {rank} "
        "are independent" + (f"; {rows - rank} say what others say already." if rows > rank else "."),
    ]
    if found["mobility"] == 0:
        lines.append("It cannot move: it is a structure, or all its freedom is prescribed by drives.")
    return _section("Mobility", lines)


def _redundancy(found: dict[str, Any]) -> str:
    redundant = found["redundant"]
    if not redundant:
        return ""
    rows = [(item["row"], item["joint"], item["why"]) for item in redundant]
    what = _count(len(rows), "closing condition was", "closing conditions were")
    lead = f"{what} recognised as redundant and left out:"
    return _section("Redundant conditions", [lead, *_table(("row", "joint", "why"), rows)])


def _structure(found: dict[str, Any]) -> str:
    tree = [(item["joint"], item["kind"], item["parent"], item["child"], "tree") for item in found["tree"]]
    cuts = [
        (item["joint"], item["kind"], item["parent"], item["child"], "closes a loop")
        for item in map(_cut, found["cuts"])
    ]
    lead = "Joints of the spanning tree carry the coordinates; " + (
        f"{_count(len(cuts), 'joint closes a loop', 'joints close loops')}." if cuts else "no joint closes a loop."
    )
    return _section("Joints", [lead, *_table(("joint", "kind", "parent", "child", "role"), tree + cuts)])


def _cut(item: Any) -> dict[str, Any]:
    """A cut joint with all columns, whether the core names it or describes it."""
    blank = {"joint": "", "kind": "", "parent": "", "child": ""}
    return {**blank, "joint": item} if isinstance(item, str) else {**blank, **item}


def _coordinates(found: dict[str, Any]) -> str:
    rows = [
        (
            item["name"],
            f"{item['rho']:.4f}",
            "independent" if item["independent"] else "follows",
            f"{item['scale']:.3g}",
        )
        for item in found["coordinates"]
    ]
    lines = [
        "The measure rho says how mobile a coordinate is with the loops closed, relative to the loops "
        "opened: 1 = they do",
        "not hinder it, 0 = locked. It has no units. The most mobile ones are chosen as independent.",
        *_table(("coordinate", "rho", "role", "scale"), rows),
    ]
    if found.get("sigma") is not None:
        sigma, sqrt_mu = found["sigma"], found["sqrt_mu"]
        lines.append(f"Quality of this choice: sigma = {sigma:.3g}, sqrt(mu) = {sqrt_mu:.3g} (1 is best, 0 singular).")
    return _section("Coordinates", lines)


def _reactions(found: dict[str, Any]) -> str:
    rows = [(item["joint"], *("yes" if known else "no" for known in item["determined"])) for item in found["reactions"]]
    if not rows:
        return ""
    undetermined = sum(item == "no" for row in rows for item in row[1:])
    verdict = ["All components of all reactions are determined."]
    if undetermined:
        verdict = [
            f"{_count(undetermined, 'component is', 'components are')} not determined: rigid bodies alone cannot say",
            "how redundant joints share the load, and numbers given for them are one possibility among many.",
        ]
    lines = ["Components along the joint axes:", *_table(("joint", *_COMPONENTS), rows), *verdict]
    return _section("Reactions", lines)


def _section(title: str, lines: Sequence[str]) -> str:
    return "\n".join([title, "-" * len(title), *lines])


def _count(number: int, one: str, many: str | None = None) -> str:
    """'1 joint', '2 joints'."""
    return f"{number} {one if number == 1 else many or one + 's'}"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Left-aligned columns with two spaces before and between them."""
    table = [list(map(str, head)), *(list(map(str, row)) for row in rows)]
    widths = [max(len(row[column]) for row in table) for column in range(len(head))]
    return [
        "  " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in table
    ]
