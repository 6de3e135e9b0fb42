"""`Mechanism.report`: the findings of the core on a mechanism, in words."""

from __future__ import annotations

import copy
import json
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from .. import notebook
from .. import options as run_options
from ..builder.compiled import CompiledModel
from ..builder.records import LoadRecord
from ..errors import EvaluationError, OpenReactionError, SingularityError
from ..state import State
from .models import Modelled, layout_of
from .solve import _fitting, assemble

_COMPONENTS = ("fx", "fy", "fz", "mx", "my", "mz")
_FOLLOWS = ("coefficient", "static_coefficient", "radius", "length", "collar")
_LINES = 12
"""Lines of a table before the rest is counted: the report of a chain of forty loops is a page, not a book."""
_WIDTH = 118


@dataclass(frozen=True)
class _Section:
    """A title, paragraphs, and a table with a note below it."""

    title: str
    paragraphs: Sequence[str] = ()
    head: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    below: Sequence[str] = ()
    listed: bool = False


class Report(str):
    """The report on a mechanism in one position. It is its own text; `markdown` has the same with headings and tables,
    `to_dict()` the numbers and names.

    >>> import partita as pt
    >>> report = pt.catalogue.load("four-bar").report()
    >>> report.to_dict()["gruebler"], report.to_dict()["mobility"]
    (-2, 1)
    >>> "| joint |" in report.markdown
    True
    """

    _found: dict[str, Any]
    _sections: tuple[_Section, ...]

    @property
    def text(self) -> str:
        """The text alone, for printing."""
        return str(self)

    @property
    def markdown(self) -> str:
        """The same as Markdown."""
        return "\n\n".join(_markdown(section, i == 0) for i, section in enumerate(self._sections)) + "\n"

    def _repr_html_(self) -> str:
        """The text, in a notebook."""
        return notebook.lines(self)

    def to_dict(self) -> dict[str, Any]:
        """The findings as plain data: numbers, names and sentences, complete where the text gives a count."""
        return copy.deepcopy(self._found)

    def __reduce__(self) -> tuple[Callable[..., Report], tuple[dict[str, Any], tuple[_Section, ...]]]:
        return _reported, (self._found, self._sections)


def _reported(found: dict[str, Any], sections: tuple[_Section, ...]) -> Report:
    made = Report("\n\n".join(_text(section, i == 0) for i, section in enumerate(sections)) + "\n")
    made._found, made._sections = found, sections
    return made


def report(self: Modelled, state: State | None = None, *, coordinates: str = "relative") -> Report:
    """Describe the mechanism in words: what moves and how freely, redundancy and its remedies, coordinates and their
    measure, reactions, data that look like mistakes. At a singular position it lists the branches that meet, with a
    guess for each.

    Args:
        state: where to look; None: the drawing, assembled.
        coordinates: as in `compile`.

    Returns:
        A text, to be printed, which has `.markdown` and `.to_dict()` besides.

    Raises:
        AssemblyError: the loops of the drawing do not close. ArgumentError: the state belongs to another
            model. SingularityError: the position is singular and the rank of the joints there is not clear.

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> "1 degree of freedom" in m.report()
    True
    """
    model, layout = layout_of(self, run_options.one_of("coordinates", coordinates, run_options.COORDINATES))
    try:
        where = state if state is not None else assemble(self, coordinates=coordinates)
    except SingularityError:
        # of drives at a dead centre no velocities are known; the drawing itself is examined, if it closes
        where = State(0.0, *model.core.initial(), layout=layout)
    _fitting("state", where, model)
    open_frictions, model, where = _open_frictions(self, where, model)
    found: dict[str, Any] = json.loads(model.core.report(where.t, where.q))
    # notes of the compilation are explained in full where the position is singular
    new = [
        note for note in model.notes if note not in found["notes"] and not (found["singular"] and "singular" in note)
    ]
    found["notes"] = [*found["notes"], *new]
    found = {"name": self.name, "t": where.t, "drives": list(self.drives), **found}
    found["open_frictions"] = open_frictions
    sections = [
        _title(found, model.summary),
        _singular(found),
        _mobility(found, len(model.summary["bodies"]))
        if not found["singular"] or found["singular"]["described"]
        else None,
        _Section("Redundancy", [found["redundancy"]]) if found["redundancy"] else None,
        _structure(found),
        _coordinates(found),
        _reactions(found),
        _frictions(found),
        _Section("Suspicious data", found["suspicious"], listed=True) if found["suspicious"] else None,
        _Section("Notes", found["notes"], listed=True) if found["notes"] else None,
    ]
    return _reported(found, tuple(section for section in sections if section is not None))


def _title(found: dict[str, Any], summary: dict[str, Any]) -> _Section:
    bodies, joints = len(summary["bodies"]), len(summary["joints"])
    kind = "planar (all motion parallel to one plane)" if found["planar"] else "spatial"
    text = f"{_count(bodies, 'body', 'bodies')}, {_count(joints, 'joint')}; {kind}. Position at t = {found['t']:g} s."
    return _Section(f'Mechanism "{found["name"]}"', [text])


def _singular(found: dict[str, Any]) -> _Section | None:
    """The branches out of a singular position."""
    singular = found["singular"]
    if not singular:
        return None
    lines = [f"The mechanism is at a singular position: {singular['words']}."]
    if singular["described"]:
        lines.append("What follows describes the mechanism next to this position, on the first branch.")
    return _Section("Singular position", lines)


def _mobility(found: dict[str, Any], bodies: int) -> _Section:
    rows, rank, general, here = found["joint_rows"], found["joint_rank"], found["degrees_of_freedom"], found["mobility"]
    driven, redundant = general - here, rows - rank
    first = f"The mechanism has {_degrees(general)}"
    if driven:
        prescribed = "all prescribed" if not here else f"{driven} of them prescribed"
        first += f", {prescribed} by {_named(found['drives'])}"
        first += ": it moves as driven." if not here else f"; {here} to integrate."
    else:
        first += "." if general else ": it is a structure and cannot move."
    lines = [first]
    idle = found["idle"]
    if idle:
        spins = [_spin(item["bodies"], _named(item["joints"])) for item in idle]
        more = general - len(idle)
        lines.append(
            f"{_degrees(len(idle), 'Of these ')} idle: {_named(spins)}, which moves nothing else{_held(idle)}; "
            f"{_degrees(more)} {'remains' if more == 1 else 'remain'} for all other motion."
        )
    count = f"Gruebler's count is 6 x {bodies} - {rows} = {found['gruebler']}"
    if redundant:
        lines.append(
            f"{count}. The true number is larger by {_count(redundant, 'redundant constraint')} of the joints, which "
            f"the count assumes to be independent."
        )
    else:
        lines.append(f"{count}, which is the true number: all {rows} constraints of the joints are independent.")
    if found["prescribed"]:
        lines.append(f"Prescribed by the drives as well: {_named(found['prescribed'])}.")
    if found["locked"]:
        lines.append(f"Locked by the loops in any position: {_named(found['locked'])}.")
    if found["dead"]:
        lines.append(
            f"Dead position of {_named(found['dead'])}: its rate vanishes here although it moves nearby, so it cannot "
            f"drive the mechanism from this position."
        )
    return _Section("Mobility", lines)


def _spin(bodies: list[str], between: str) -> str:
    """One idle spin: of a body, or of several as one."""
    if len(bodies) == 1:
        return f"{bodies[0]} spins about its own line between {between}"
    return f"{_named(bodies)} spin as one about the line between {between}"


def _held(idle: list[dict[str, Any]]) -> str:
    """Which of the idle spins are held."""
    held = [body for item in idle if item["held"] for body in item["bodies"]]
    if not held:
        return ""
    if len(held) == len(idle):
        which = "it is" if len(idle) == 1 else "all are"
    else:
        which = f"{_named(held)} {'is' if len(held) == 1 else 'are'}"
    return f" ({which} held, without inertia about that line)"


def _structure(found: dict[str, Any]) -> _Section:
    tree = [(item["joint"], item["kind"], item["parent"], item["child"], "tree") for item in found["tree"]]
    cuts = [
        (item["joint"], item["kind"], item["parent"], item["child"], "closes a loop")
        for item in map(_cut, found["cuts"])
    ]
    lead = "Joints of the spanning tree carry the coordinates; " + (
        f"{_count(len(cuts), 'joint closes a loop', 'joints close loops')}." if cuts else "no joint closes a loop."
    )
    return _Section("Joints", [lead], ("joint", "kind", "parent", "child", "role"), tree + cuts)


def _cut(item: Any) -> dict[str, Any]:
    """A cut joint with all columns, whether the core names it or describes it."""
    blank = {"joint": "", "kind": "", "parent": "", "child": ""}
    return {**blank, "joint": item} if isinstance(item, str) else {**blank, **item}


def _coordinates(found: dict[str, Any]) -> _Section | None:
    rows = [
        (
            item["name"],
            f"{item['rho']:.4f}",
            "independent" if item["independent"] else "follows",
            f"{item['scale']:.3g}",
        )
        for item in found["coordinates"]
    ]
    if not rows:
        return None
    lead = (
        "The measure rho is the mobility of a coordinate with the loops closed, relative to that with the loops cut "
        "open: 1 = not restricted, 0 = locked. It is dimensionless. The most mobile coordinates are chosen as "
        "independent."
    )
    below = []
    if found["sigma"] is not None:
        sigma, sqrt_mu = found["sigma"], found["sqrt_mu"]
        below.append(f"Quality of this choice: sigma = {sigma:.3g}, sqrt(mu) = {sqrt_mu:.3g} (1 is best, 0 singular).")
    return _Section("Coordinates", [lead], ("coordinate", "rho", "role", "scale"), rows, below)


def _reactions(found: dict[str, Any]) -> _Section | None:
    rows = [(item["joint"], *("yes" if known else "no" for known in item["determined"])) for item in found["reactions"]]
    if not rows:
        return None
    undetermined = sum(item == "no" for row in rows for item in row[1:])
    if not undetermined:
        return _Section("Reactions", ["All components of all reactions are determined."])
    verdict = (
        f"{_count(undetermined, 'component is', 'components are')} not determined: for rigid bodies the distribution "
        f"of load over redundant joints is indeterminate. The values given for them are one solution of many, "
        f"selected by least squares over all joints, or by the compliances given."
    )
    return _Section("Reactions", ["Components along the joint axes:"], ("joint", *_COMPONENTS), rows, [verdict])


def _open_frictions(
    m: Modelled, where: State, model: CompiledModel
) -> tuple[list[dict[str, str]], CompiledModel, State]:
    """Frictions whose magnitude depends on a reaction that is not determined here, and the model and state in which
    they have given magnitudes instead. They are found by requesting a run, whose refusal names one at a time."""
    follow: dict[str, LoadRecord] = {
        name: record
        for name, record in m._description.forces.items()
        if isinstance(record, LoadRecord)
        and record.kind == "friction"
        and record.arguments.get("coefficient") is not None
    }
    found: list[dict[str, str]] = []
    given = Modelled(m.name, (0.0, 0.0, 0.0), m.drawing_tolerance)
    given._description = m._description.copy()
    for _ in follow:
        try:
            model.core.forces(where.t, where.q, where.v)
        except OpenReactionError as error:
            name = error.where
            found.append({"friction": name, "joint": error.joint})
            given_magnitude = {"stick_velocity": follow[name].arguments["stick_velocity"], "dynamic": 1.0}
            given.forces[name].change(**given_magnitude, **dict.fromkeys(_FOLLOWS), preload=0.0)
            other, layout = layout_of(given, model.coordinates)
            where = State(where.t, *other.core.transferred(model.core, where.q, where.v), layout=layout)
            model = other
        except EvaluationError:
            break  # for another reason, which a run reports
        else:
            break
    return found, model, where


def _frictions(found: dict[str, Any]) -> _Section | None:
    open_ = found["open_frictions"]
    if not open_:
        return None
    each = _named([f'"{item["friction"]}" (of joint {item["joint"]})' for item in open_])
    one = len(open_) == 1
    return _Section(
        "Friction",
        [
            f"The magnitude of {each} depends on {'a reaction' if one else 'reactions'} not determined here: "
            f"{'it has' if one else 'they have'} no unique value, and a run would be refused. Replace joints so that "
            "nothing is redundant (see Redundancy), or give the friction magnitude itself (dynamic=) instead of the "
            "coefficient."
        ],
    )


def _text(section: _Section, first: bool) -> str:
    lines = [section.title, ("=" if first else "-") * len(section.title)]
    for paragraph in section.paragraphs:
        bullet = ("- ", "  ") if section.listed else ("", "")
        lines += textwrap.wrap(paragraph, _WIDTH, initial_indent=bullet[0], subsequent_indent=bullet[1]) or [""]
    if section.rows:
        lines += _table(section.head, section.rows)
    for paragraph in section.below:
        lines += textwrap.wrap(paragraph, _WIDTH)
    return "\n".join(lines)


def _markdown(section: _Section, first: bool) -> str:
    parts = [f"{'#' if first else '##'} {_escaped(section.title)}"]
    paragraphs = [_escaped(paragraph) for paragraph in section.paragraphs]
    parts += ["\n".join(f"- {line}" for line in paragraphs)] if section.listed else paragraphs
    if section.rows:
        shown, rest = _shortened(section.rows)
        table = [section.head, ["---"] * len(section.head), *shown]
        parts.append("\n".join("| " + " | ".join(_escaped(cell) for cell in row) + " |" for row in table))
        parts += [rest] if rest else []
    parts += [_escaped(line) for line in section.below]
    return "\n\n".join(parts)


def _escaped(text: str) -> str:
    for sign in "\\`*_|<>[]#":
        text = text.replace(sign, f"\\{sign}")
    return text


def _shortened(rows: Sequence[Sequence[str]]) -> tuple[Sequence[Sequence[str]], str]:
    """The first rows, and a note on the rest."""
    if len(rows) <= _LINES:
        return rows, ""
    return rows[: _LINES - 1], f"and {len(rows) - _LINES + 1} more; to_dict() has all"


def _degrees(number: int, before: str = "") -> str:
    """'1 degree of freedom', '2 degrees of freedom'."""
    verb = "" if not before else " is" if number == 1 else " are"
    return f"{before}{_count(number, 'degree')} of freedom{verb}"


def _named(names: Sequence[str]) -> str:
    """'A, B and C'; of many the first."""
    if len(names) > 8:
        return f"{', '.join(names[:8])} and {len(names) - 8} more"
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]])) if names else "nothing"


def _count(number: int, one: str, many: str | None = None) -> str:
    """'1 joint', '2 joints'."""
    return f"{number} {one if number == 1 else many or one + 's'}"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Left-aligned columns with two spaces before and between them; of many rows the first."""
    shown, rest = _shortened(rows)
    table = [list(map(str, head)), *(list(map(str, row)) for row in shown)]
    widths = [max(len(row[column]) for row in table) for column in range(len(head))]
    lines = [
        "  " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in table
    ]
    return [*lines, f"  {rest}"] if rest else lines
