"""The description: plain records of the user's input, and the handles that the `add_...` methods return."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from numpy.typing import ArrayLike

from ..errors import UnknownNameError
from ..products import matmul
from ..sensing import SensorRecord
from ..shapes import Shape
from ..units.door import SI
from .checks import Array, Element, find, vector
from .poses import PoseValue
from .values import Function, Value

GROUND = "ground"


class Handle:
    """An element of a mechanism, accepted wherever its name is.

    Its attributes are the arguments with which it was added, in SI: `crank.mass`, `hinge.point`, `spring.stiffness`;
    `dir(crank)` lists them, and `kind` names the method that made it. Setting one repeats the call: the value is
    checked as when the element was added, dependent quantities are computed again, and a refusal leaves everything
    unchanged. Arrays are read-only copies: set the whole of them. `change` sets several at once.

    Raises `UnknownAttributeError`, which is an `AttributeError`, for what such an element does not have;
    `UnknownNameError` where it was removed.
    """

    table = ""
    name: str
    mechanism: Any  # a Builder; the import would go up

    def __init__(self, name: str, mechanism: Any) -> None:
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "mechanism", mechanism)

    def __getattr__(self, word: str) -> Any:
        if word.startswith("_") or word in ("name", "mechanism"):
            raise AttributeError(word)
        return self.mechanism._read(self, word)

    def __setattr__(self, word: str, value: Any) -> None:
        self.mechanism._change(self, {word: value})

    def change(self, **arguments: Any) -> None:
        """Set several attributes at once, where one alone would not fit the others: `drive.change(position=None,
        velocity=2.0)`. All are set, or none."""
        self.mechanism._change(self, arguments)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.mechanism._words(self)})

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Handle):
            return NotImplemented
        return self.table == other.table and self.name == other.name and self.mechanism is other.mechanism

    def __hash__(self) -> int:
        return hash((self.table, self.name))

    def __repr__(self) -> str:
        try:
            about = self.mechanism._content(self)
        except UnknownNameError:
            about = "removed"
        return f"{type(self).__name__}({self.name!r}: {about})"

    def __str__(self) -> str:
        return self.name


class Point(NamedTuple):
    """A point of a body: its name, and where the point is in its axes [m]. `Body.at` and `Body.world` make one."""

    body: str
    """Name of the body."""
    coordinates: tuple[float, float, float]
    """In the axes of the body, from its origin [m]."""

    def __repr__(self) -> str:
        return f"{self.body}.at(({', '.join(f'{x:g}' for x in self.coordinates)}))"


class Body(Handle):
    """A rigid body, or the ground."""

    table = "bodies"

    def at(self, point: ArrayLike) -> Point:
        """The point of this body at (x, y, z) in its axes [m], from its origin; of the ground in the world.

        Accepted wherever a point is: of springs, distances, contacts, forces and sensors, where a plain (x, y, z) is in
        body axes as well, and of joints, where a plain (x, y, z) is in the world of the drawing.

        >>> import partita as pt
        >>> m = pt.Mechanism("swing")
        >>> rod = m.add_rod("rod", start=(2, 0, 0), end=(3, 0, 0), mass=1.0)
        >>> rod.at((1, 0, 0)) == rod.world((3, 0, 0))
        True
        >>> m.add_spring("S", m.ground, (3, 1, 0), rod, rod.world((3, 0, 0)), stiffness=100.0).point2.tolist()
        [1.0, 0.0, 0.0]
        """
        x, y, z = vector(Element("body", self.name), "the point", point, "m").tolist()
        return Point(self.name, (x, y, z))

    def world(self, point: ArrayLike) -> Point:
        """The point of this body that is drawn at (x, y, z) in the world [m]; see `at`."""
        place = vector(Element("body", self.name), "the point", point, "m")
        if self.name != GROUND:
            record = self.mechanism._description.bodies[find("body", self.name, self.mechanism._description.bodies)]
            place = matmul(record.rotation.T, place - record.position)
        x, y, z = place.tolist()
        return Point(self.name, (x, y, z))


class Joint(Handle):
    """A joint between two bodies."""

    table = "joints"


class Force(Handle):
    """A spring, a torque or a force."""

    table = "forces"


class Drive(Handle):
    """The prescribed motion of one joint coordinate, or of another measure."""

    table = "drives"


class Coupling(Handle):
    """A constraint between joints or bodies that is not a joint: a gear, a distance, a rolling contact, ..."""

    table = "couplings"


class Rotor(Handle):
    """The rotor of a motor that turns with a joint."""

    table = "rotors"


@dataclass(frozen=True)
class Ref:
    """An element named in an argument where a body and a joint may share a name."""

    table: str
    name: str


Call = tuple[str, Mapping[str, Any]]
"""The method that adds an element, and its arguments in SI."""


@dataclass(frozen=True)
class Solid:
    """Of what a body was made: its shape, and its mass by one of `material`, `density` and `mass`."""

    shape: Shape
    word: str
    value: str | float


@dataclass(frozen=True)
class BodyRecord:
    """One rigid body; arrays in body axes except `position` and `rotation`."""

    name: str
    mass: float
    inertia: Array  # (3, 3) about the centre of mass
    com: Array  # (3,)
    position: Array  # (3,) of the body's origin in the world, as drawn
    rotation: Array  # (3, 3) body axes to world axes, as drawn
    rod: tuple[Array, Array, float] | None = None  # start, end, length
    gravity: bool = True
    solid: Solid | None = None

    def to_world(self, point: Array) -> Array:
        """World position of a point of the body as drawn."""
        return self.position + matmul(self.rotation, point)


@dataclass(frozen=True)
class JointRecord:
    """One joint; `point` and `geometry` ("axis", "axis1", "axis2", "normal", "frame") in the world of the
    drawing."""

    name: str
    kind: str
    parent: str
    child: str
    point: Array | None  # None: the child's origin as drawn
    geometry: Mapping[str, Array]
    free: tuple[str, ...] = ()  # all directions that move, where they are chosen
    child_point: Array | None = None
    child_axis: Array | None = None
    child_frame: Array | None = None
    pitch: float | None = None
    cut: str = "auto"
    compliance: Array | None = None  # (6,) along and about the joint axes
    follows: Mapping[str, Function] = field(default_factory=dict)  # directions that are functions of the others


@dataclass(frozen=True)
class DriveRecord:
    """Prescribed motion of a measurement: its position, velocity or acceleration, according to `level`; `rate` is the
    initial rate of an acceleration. Or the pose of a joint, with this many translations before its spatial rotation."""

    name: str
    measure: Mapping[str, Any]
    motion: Value | PoseValue
    level: str = "position"
    rate: float = 0.0
    slides: int = 0
    interpolation: str | None = None
    arguments: Mapping[str, Any] | None = None  # of a pose: "joint", "pose", and the joint that was added to "carry" it


@dataclass(frozen=True)
class CouplingRecord:
    """A coupling: `kind` is "linear", "curve", "function" or "roll", `terms` its readings, `data` its numbers."""

    name: str
    kind: str
    word: str
    terms: tuple[Mapping[str, Any], ...]
    data: Mapping[str, Any]
    call: Call = ("", {})


@dataclass(frozen=True)
class RotorRecord:
    """A rotor on one coordinate of a joint, which moves the inertia ratio^2 inertia besides its bodies."""

    name: str
    joint: str
    coordinate: int
    inertia: float
    ratio: float


@dataclass(frozen=True)
class TorqueRecord:
    """Effort along one joint coordinate; with `over`, a table over that measure instead of time."""

    name: str
    joint: str
    coordinate: int
    value: Value
    over: Mapping[str, Any] | None = None
    periodic: bool = False
    interpolation: str | None = None


@dataclass(frozen=True)
class ForceRecord:
    """Force on a point of a body; `value` has three components, or is one function that returns three
    numbers."""

    name: str
    body: str
    point: Array
    value: tuple[Value, Value, Value] | Function
    axes: str
    at_center: bool = False  # no point was given: wherever the centre of mass is
    interpolation: str | None = None


DRAWING_TOLERANCE = 1e-4
"""Default drawing tolerance. Scale: rad; fraction of lengths. Reason: four decimals, as drawings have."""
LARGEST_TOLERANCE = 1e-2
"""With a larger difference it is another mechanism. Scale: rad; fraction of lengths. Reason: a hundredth is a
dimension."""


@dataclass(frozen=True)
class LoadRecord:
    """Any other force: `said` contains the arguments given by the user, for files; `means` what is passed to the core.
    Values that may be tables or functions are stored in both unchanged. `units` are those of its parameters."""

    name: str
    kind: str
    arguments: Mapping[str, Any]
    means: Mapping[str, Any]
    units: Mapping[str, SI] = field(default_factory=dict)

    def __getitem__(self, word: str) -> Any:
        return self.means[word]


ForceLike = TorqueRecord | ForceRecord | LoadRecord


@dataclass
class Description:
    """All input so far, in order. `version` grows with every addition."""

    name: str
    gravity: Array
    changing_gravity: tuple[Value, Value, Value] | Function | None = None  # in addition
    drawing_tolerance: float = DRAWING_TOLERANCE
    bodies: dict[str, BodyRecord] = field(default_factory=dict)
    joints: dict[str, JointRecord] = field(default_factory=dict)
    drives: dict[str, DriveRecord] = field(default_factory=dict)
    driven: dict[str, str] = field(default_factory=dict)  # measure as text -> drive
    couplings: dict[str, CouplingRecord] = field(default_factory=dict)
    rotors: dict[str, RotorRecord] = field(default_factory=dict)
    forces: dict[str, ForceLike] = field(default_factory=dict)
    sensors: dict[str, SensorRecord] = field(default_factory=dict)
    numbers: dict[str, int] = field(default_factory=dict)  # made-up name -> number at which the next one is looked for
    explicit: dict[tuple[str, str, str], bool] = field(default_factory=dict)  # kind, name, argument: given as a `Point`
    version: int = 0

    def copy(self) -> Description:
        """A copy of the present state, independent of later additions; records never change and are shared."""
        tables = {
            name: dict(getattr(self, name))
            for name in (
                "bodies",
                "joints",
                "drives",
                "driven",
                "couplings",
                "rotors",
                "forces",
                "sensors",
                "numbers",
                "explicit",
            )
        }
        return Description(
            self.name, self.gravity, self.changing_gravity, self.drawing_tolerance, version=self.version, **tables
        )

    def loads(self, kind: str) -> Iterator[LoadRecord]:
        """Those of a kind."""
        return (x for x in self.forces.values() if isinstance(x, LoadRecord) and x.kind == kind)

    def store(self, table: dict[str, Any], record: Any) -> None:
        """Add a finished record."""
        table[record.name] = record
        self.version += 1
