"""The table of the writers: what becomes of each element of a mechanism in each format. Writers walk a mechanism by it.

A writer says of itself what it writes otherwise, or in part; what the table drops, leaves out or refuses is said here.
What the table does not have is dropped with a remark. The page docs/formats.md is written from the same table.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from ..builder.calls import kind_of
from ..builder.checks import Element
from ..builder.declaration import LOADS
from ..builder.records import DRAWING_TOLERANCE, CouplingRecord, Description, JointRecord
from .writing import Writing

WRITTEN = "written"
"""As it is, with all digits."""
CHANGED = "changed"
"""Said otherwise, and means the same: a remark."""
PARTLY = "partly"
"""As it is, or said otherwise, where the format can; else dropped: a remark."""
DROPPED = "dropped"
"""The file is of another mechanism: a remark says what it does without."""
OMITTED = "left out"
"""The file lacks it, and moves the same: a remark."""
REFUSED = "refused"
"""A mechanism that has it is not written."""
RULES = (WRITTEN, CHANGED, PARTLY, DROPPED, OMITTED, REFUSED)
FORMATS = ("URDF", "MJCF", "USD", "TOML")


@dataclass(frozen=True)
class Fate:
    """What becomes of an element: the rule, and how it is written or what is lost."""

    rule: str
    effect: str = ""

    def __str__(self) -> str:
        return f"{self.rule}: {self.effect}" if self.effect else self.rule


_AS_IS = Fate(WRITTEN)
_CHAIN = Fate(CHANGED, "slides and hinges through massless links, which the reader merges")
_PYTHON = "it is a Python function, which a file cannot contain"
_GIVEN = Fate(PARTLY, "numbers and tables; Python functions are refused")
_RATIO = "of two joint coordinates in a fixed ratio; others dropped"
_FREE = Fate(DROPPED, "what it holds together moves freely")
_SIDE = Fate(CHANGED, "in the sidecar, which other programs do not read")
_LOCKED = Fate(PARTLY, "`PhysicsJoint` with locked directions; two rotations beside slides are dropped")
_LOOSE = Fate(PARTLY, "its motions no longer depend on each other")
_HINGES = Fate(PARTLY, "a mimic joint of PhysX, of two hinges; others dropped")
_NONE = Fate(DROPPED, "nothing pulls its points together")
_DAMPERS = "dampers of hinges and slides; springs in the sidecar; of other coordinates dropped"
Row = tuple[str, Fate, Fate, Fate, Fate]


def _row(kinds: str, urdf: Fate, mjcf: Fate | None = None, usd: Fate | None = None, toml: Fate = _AS_IS) -> Row:
    """Elements by the words of `kind_of`, separated by commas, and their fates in the order of `FORMATS`."""
    mjcf = urdf if mjcf is None else mjcf
    return kinds, urdf, mjcf, mjcf if usd is None else usd, toml


_FLOATS = "in the tree; one that closes a loop constrains nothing, and is left out"
_SEVERAL = "universal, cylindrical, planar, pin slot, generic, parallel, perpendicular, orientation, point on line"
_ITS = "its coordinates"
_SAMPLED = (
    f"{_ITS} follow by Python functions, which a file cannot contain; sample them into cams (add_cam) between the "
    "coordinates of a generic joint before saving"
)
_ROWS = (
    _row("body, rod, solid", Fate(WRITTEN, "a link, its frame at its joint"), Fate(WRITTEN, "a body")),
    _row("body without gravity", _SIDE, Fate(WRITTEN, "`gravcomp`"), Fate(CHANGED, "a schema of PhysX")),
    _row("form", Fate(OMITTED, "it is drawn, and moves nothing")),
    _row("gravity", _SIDE, Fate(WRITTEN, "`option`"), Fate(WRITTEN, "`PhysicsScene`")),
    _row("time-dependent gravity", Fate(DROPPED, "gravity keeps its constant part"), toml=_GIVEN),
    _row("drawing tolerance", _SIDE, Fate(DROPPED, "loops are closed within the default tolerance")),
    _row("revolute, prismatic, fixed", _AS_IS, Fate(WRITTEN, "`connect` and `weld` where they close loops"), _AS_IS),
    _row(
        "free",
        Fate(CHANGED, f"`floating`, {_FLOATS}"),
        Fate(CHANGED, f"`freejoint`, {_FLOATS}"),
        Fate(WRITTEN, "`PhysicsJoint`"),
    ),
    _row("spherical", _CHAIN, Fate(WRITTEN, "`ball`, or `connect` where it closes a loop"), _AS_IS),
    _row(f"{_SEVERAL}, point on plane", _CHAIN, Fate(CHANGED, "several joints of one body"), _LOCKED),
    _row(
        "screw",
        Fate(CHANGED, "a slide that mimics a hinge"),
        Fate(CHANGED, "a slide coupled to a hinge"),
        Fate(PARTLY, "its thread is dropped"),
    ),
    _row("constant velocity", Fate(DROPPED, "its bodies are not joined; two universal joints approximate it")),
    _row("custom", _LOOSE, usd=_LOCKED, toml=Fate(REFUSED, _SAMPLED)),
    _row("compliance", Fate(DROPPED, "reactions that the motion does not determine are shared otherwise")),
    _row(
        "coupler, gear, belt, rack", Fate(PARTLY, f"`mimic`, {_RATIO}"), Fate(PARTLY, f"an equality, {_RATIO}"), _HINGES
    ),
    _row("distance", _FREE, usd=Fate(WRITTEN, "`PhysicsDistanceJoint`")),
    _row("rolling", _FREE),
    _row("cam", _FREE, toml=_GIVEN),
    _row("constraint", _FREE, toml=Fate(REFUSED, _PYTHON)),
    _row("point on curve", _FREE, toml=_GIVEN),
    _row(
        "rotor",
        Fate(WRITTEN, "a `transmission` with `drake:rotor_inertia`"),
        Fate(WRITTEN, "`armature`"),
        Fate(CHANGED, "an armature of PhysX"),
    ),
    _row("drive", Fate(DROPPED, "the driven coordinate becomes free"), toml=_GIVEN),
    _row("spring", _SIDE, Fate(PARTLY, "`tendon`; of negative stiffness, damping or length dropped"), _NONE),
    _row("torsion spring", Fate(PARTLY, _DAMPERS), Fate(PARTLY, "sums along a coordinate; negative ones dropped")),
    _row("torque, force", Fate(DROPPED, "it no longer acts"), toml=_GIVEN),
    _row("force law", Fate(DROPPED, "it no longer acts"), toml=Fate(REFUSED, _PYTHON)),
    _row("friction", Fate(DROPPED, "nothing resists the motion"), toml=_GIVEN),
    *(_row(kind.replace("_", " "), Fate(DROPPED, load.lost)) for kind, load in LOADS.items() if load.lost),
    _row("sensor", Fate(OMITTED, "it measures, and moves nothing"), toml=_GIVEN),
)
TABLE: dict[str, dict[str, Fate]] = {
    kind: dict(zip(FORMATS, fates, strict=True)) for kinds, *fates in _ROWS for kind in kinds.split(", ")
}
"""By element and format."""


def visit(d: Description, report: Writing) -> None:
    """Report what the format of this writing drops or leaves out; refuse what it refuses."""
    for kind, name, word, record in elements(d):
        fate = TABLE.get(kind, {}).get(report.kind) or Fate(DROPPED, f"not known to the writer of {report.kind}")
        called = f"{word} {name}".strip()
        if fate.rule == DROPPED:
            report.dropped.append(f"{called}: {fate.effect}")
        elif fate.rule == OMITTED:
            report.changed.append(f"{called} is not written: {fate.effect}")
        elif fate.rule == REFUSED:
            if isinstance(record, JointRecord):
                Element("joint", name).fail(fate.effect.replace(_ITS, ", ".join(record.follows)))
            Element(kind, name).fail(fate.effect)


def elements(d: Description) -> Iterator[tuple[str, str, str, Any]]:
    """Everything in a mechanism: its kind, its name, the word for it, and its record if it has one."""
    yield "gravity", "", "gravity", None
    if d.changing_gravity is not None:
        yield "time-dependent gravity", "", "time-dependent gravity", None
    if d.drawing_tolerance != DRAWING_TOLERANCE:
        yield "drawing tolerance", f"{d.drawing_tolerance:g}", "the drawing tolerance", None
    tables: list[dict[str, Any]] = [d.bodies, d.joints, d.couplings, d.rotors, d.drives, d.forces, d.sensors]
    for table in tables:
        for name, record in table.items():
            kind = kind_of(record).replace("_", " ")
            yield kind, name, _word(kind, record), record
            if table is d.bodies and not record.gravity:
                yield "body without gravity", name, "body", record
            if table is d.bodies and record.solid is not None:
                yield "form", name, "form of body", record
            if isinstance(record, JointRecord) and record.compliance is not None:
                yield "compliance", name, "compliance of joint", record


def _word(kind: str, record: Any) -> str:
    """The word before its name."""
    if isinstance(record, CouplingRecord):
        return record.word
    return f"{kind} joint" if isinstance(record, JointRecord) else kind
