"""Mechanisms as plain data: built through the public face of Partita, written as Python lines, turned and scaled."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

import partita as pt

Array = Any
GROUND = "ground"


@dataclass(frozen=True)
class Body:
    name: str
    mass: float
    inertia: Array
    com: Array
    position: Array
    rotation: Array


@dataclass(frozen=True)
class Joint:
    """`axes`: the columns that the kind needs (one axis, two axes, or a frame). `child_point`, `child_axis`: where they
    sit on the child in a drawing whose loops are open. `pitch`: of a screw, for a turn; `bent`: what turns the
    axes of a constant-velocity joint from the parent to the child; `follows`: of a joint of one's own, the directions
    that are functions of the free ones."""

    name: str
    kind: str
    parent: str
    child: str
    point: Array
    axes: Array
    free: tuple[str, ...] = ()
    cut: str = "auto"
    child_point: Array | None = None
    child_axis: Array | None = None
    pitch: float = 0.0
    bent: Array | None = None
    follows: tuple[tuple[str, Any], ...] = ()

    @property
    def on_child(self) -> Array:
        """The point as the child carries it, world of the drawing."""
        return self.point if self.child_point is None else self.child_point

    @property
    def alignment(self) -> Array:
        """The shortest turn of the child in the drawing that puts its axis in line with the parent's."""
        if self.child_axis is None:
            return np.eye(3)
        a, c = unit(np.asarray(self.axes)[:, 0]), unit(self.child_axis)
        v = np.cross(c, a)
        k = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
        return np.eye(3) + k + k @ k / (1.0 + c @ a)

    def motions(self, frame: Array) -> tuple[list[Array], list[Array], bool]:
        """Free slides and turns in the order of the coordinates, and whether all turns are free. World of the drawing.

        `frame`: the joint axes, which a planar joint chooses itself in its plane.
        """
        a = np.asarray(self.axes)
        if self.kind == "revolute":
            return [], [unit(a[:, 0])], False
        if self.kind == "prismatic":
            return [unit(a[:, 0])], [], False
        if self.kind in ("cylindrical", "screw"):
            return [unit(a[:, 0])], [unit(a[:, 0])], False
        if self.kind in ("spherical", "constant_velocity"):
            return [], [], True
        if self.kind == "universal":
            return [], [unit(a[:, 0]), unit(a[:, 1])], False
        if self.kind == "pin_slot":
            return [unit(a[:, 0])], [unit(a[:, 1])], False
        if self.chooses:
            n = unit(a[:, 0])
            assert abs(frame[:, 2] @ n - 1.0) < 1e-9, f"the third axis of a {self.kind} joint is its first one drawn"
            slides = list(frame.T if self.kind in ("parallel", "perpendicular") else frame.T[:2])
            if self.kind == "point_on_plane":
                return slides, [], True
            return slides, [n, unit(a[:, 1])] if self.kind == "perpendicular" else [n], False
        if self.kind == "point_on_line":
            return [unit(a[:, 0])], [], True
        if self.kind == "orientation":
            return list(np.eye(3)), [], False
        if self.kind == "fixed":
            return [], [], False
        if self.kind == "free":
            return list(np.eye(3)), [], True
        assert self.kind in ("generic", "custom"), f"a {self.kind} joint is not known"
        slides = [a[:, "xyz".index(f)] for f in self.moving if len(f) == 1]
        turns = [a[:, "xyz".index(f[1])] for f in self.moving if len(f) == 2]
        return slides, ([] if len(turns) == 3 else turns), len(turns) == 3

    @property
    def moving(self) -> tuple[str, ...]:
        """Of a generic joint or one's own: the directions that are not locked, in the order of the coordinates."""
        named = {*self.free, *(direction for direction, _ in self.follows)}
        return tuple(f for f in ("x", "y", "z", "rx", "ry", "rz") if f in named)

    @property
    def chooses(self) -> bool:
        """Whether the joint chooses axes about its first one by itself, along which it counts slides."""
        return self.kind in ("planar", "point_on_plane", "parallel", "perpendicular")

    @property
    def coordinates(self) -> tuple[int, int]:
        """How many slides and angles it has, and how many speeds."""
        if self.kind == "constant_velocity":
            return 0, 0
        slides, turns, ball = self.motions(self.some)
        return len(slides) + len(turns), len(slides) + len(turns) + 3 * ball

    @property
    def some(self) -> Array:
        """Axes of the joint as far as they matter for what it leaves free: any about the one that is drawn."""
        if not self.chooses:
            return np.eye(3)
        n = unit(np.asarray(self.axes)[:, 0])
        x = unit(np.cross(n, np.eye(3)[int(np.argmin(np.abs(n)))]))
        return np.column_stack([x, np.cross(n, x), n])


@dataclass(frozen=True)
class Spring:
    name: str
    body1: str
    point1: Array
    body2: str
    point2: Array
    stiffness: float
    damping: float
    length: float


@dataclass(frozen=True)
class Torsion:
    name: str
    joint: str
    coordinate: int
    stiffness: float
    damping: float
    angle: float


@dataclass(frozen=True)
class Rotor:
    """Moves the inertia ratio^2 inertia with a coordinate of a joint."""

    name: str
    joint: str
    coordinate: int
    inertia: float
    ratio: float


@dataclass(frozen=True)
class Torque:
    name: str
    joint: str
    coordinate: int
    value: float


@dataclass(frozen=True)
class Load:
    """A force on a point of a body; `swing`: it swings with this angular frequency as a function of time."""

    name: str
    body: str
    force: Array
    point: Array
    axes: str
    swing: float = 0.0


@dataclass(frozen=True)
class Drive:
    """x = rate t + amplitude (1 - cos(frequency t)): closed at t = 0."""

    name: str
    joint: str
    coordinate: int
    rate: float
    amplitude: float
    frequency: float

    def position(self, t: Any) -> Any:
        return self.rate * t + self.amplitude * (1.0 - np.cos(self.frequency * t))

    def derivatives(self, t: float) -> tuple[float, float]:
        a, w = self.amplitude, self.frequency
        return self.rate + a * w * float(np.sin(w * t)), a * w**2 * float(np.cos(w * t))

    @property
    def course(self) -> dict[str, Any]:
        """As it is given."""
        return {"position": self.position}


@dataclass(frozen=True)
class TableDrive:
    """Position, rate or acceleration by a table over time: joined by a `Spline` on request, else positions by the curve
    `Monotone`, rates and accelerations by straight lines from entry to entry."""

    name: str
    joint: str
    coordinate: int
    level: str
    curve: Any
    start: float = 0.0

    def position(self, t: float) -> float | None:
        """Not known where rates are prescribed: it is their integral along the motion."""
        return self.curve.derivatives(t)[0] if self.level == "position" else None

    def derivatives(self, t: float) -> tuple[float, float]:
        value, slope, second = self.curve.derivatives(t)
        if self.level == "position":
            return slope, second
        if self.level == "velocity":
            return value, slope
        x, y = self.curve.x, self.curve.y
        # straight pieces: the trapezium is exact on each
        times = np.array([0.0, *x[(x > 0.0) & (x < t)], t])
        values = np.interp(times, x, y)
        return self.start + float(np.sum(0.5 * np.diff(times) * (values[1:] + values[:-1]))), float(values[-1])

    @property
    def course(self) -> dict[str, Any]:
        rate = {"rate": self.start} if self.level == "acceleration" else {}
        word = self.curve.interpolation
        return {self.level: (self.curve.x, self.curve.y), **rate, **({"interpolation": word} if word else {})}


@dataclass(frozen=True)
class Coupling:
    """A condition between joints or bodies, in the words of a description. `call`: the method that adds it and its
    arguments; without one it is read, not built."""

    name: str
    kind: str
    data: dict[str, Any]
    call: tuple[str, tuple[Any, ...], dict[str, Any]] | None = None


@dataclass(frozen=True)
class Drawing:
    """A whole mechanism; `size`, `mass` and `time` are what its numbers are compared with."""

    gravity: Array
    bodies: tuple[Body, ...] = ()
    joints: tuple[Joint, ...] = ()
    forces: tuple[Any, ...] = ()
    drives: tuple[Any, ...] = ()
    size: float = 1.0
    mass: float = 1.0
    time: float = 1.0
    words: str = ""
    seed: int = field(default=0, compare=False)
    couplings: tuple[Coupling, ...] = ()
    rotors: tuple[Rotor, ...] = ()

    def build(self) -> pt.Mechanism:
        """Through the public face."""
        m = pt.Mechanism("by chance", gravity=tuple(self.gravity))
        for b in self.bodies:
            m.add_body(b.name, mass=b.mass, inertia=b.inertia, com=b.com, position=b.position, orientation=b.rotation)
        for j in self.joints:
            call, arguments = joint_call(j)
            getattr(m, call)(j.name, j.parent, j.child, **arguments)
        for f in self.forces:
            call, positional, named = force_call(f)
            getattr(m, call)(*positional, **named)
        for d in self.drives:
            m.add_drive(d.joint, **d.course, coordinate=d.coordinate, name=d.name)
        for c in self.couplings:
            if c.call is not None:
                method, positional, named = c.call
                getattr(m, method)(*positional, **named)
        for r in self.rotors:
            m.add_rotor(r.joint, r.inertia, ratio=r.ratio, coordinate=r.coordinate, name=r.name)
        return m

    def lines(self) -> str:
        """The same as a Python program."""
        out = ["import numpy as np", "import partita as pt", ""]
        out.append(f"m = pt.Mechanism('short', gravity={words(self.gravity)})")
        for b in self.bodies:
            inertia, rotation = words(b.inertia), words(b.rotation)
            out.append(
                f"m.add_body({b.name!r}, mass={b.mass!r}, inertia={inertia}, com={words(b.com)}, "
                f"position={words(b.position)}, orientation={rotation})"
            )
        for j in self.joints:
            call, arguments = joint_call(j)
            reported = ", ".join(f"{key}={words(value)}" for key, value in arguments.items())
            out.append(f"m.{call}({j.name!r}, {j.parent!r}, {j.child!r}, {reported})")
        for f in self.forces:
            call, positional, named = force_call(f)
            reported = ", ".join([*map(words, positional), *(f"{key}={words(value)}" for key, value in named.items())])
            if isinstance(f, Load) and f.swing:
                reported = f"{f.body!r}, lambda t, s: np.cos({f.swing!r} * t) * np.array({words(f.force)}), "
                reported += f"point={words(f.point)}, axes={f.axes!r}, name={f.name!r}"
            out.append(f"m.{call}({reported})")
        for d in self.drives:
            if not isinstance(d, Drive):
                course = ", ".join(f"{key}={words(value)}" for key, value in d.course.items())
                out.append(f"m.add_drive({d.joint!r}, {course}, coordinate={d.coordinate}, name={d.name!r})")
                continue
            x = f"{d.rate!r} * t + {d.amplitude!r} * (1 - np.cos({d.frequency!r} * t))"
            out.append(f"m.add_drive({d.joint!r}, lambda t: {x}, coordinate={d.coordinate}, name={d.name!r})")
        for method, positional, named in (c.call for c in self.couplings if c.call is not None):
            reported = ", ".join([*map(words, positional), *(f"{key}={words(value)}" for key, value in named.items())])
            out.append(f"m.{method}({reported})")
        for r in self.rotors:
            where = f"coordinate={r.coordinate}, name={r.name!r}"
            out.append(f"m.add_rotor({r.joint!r}, {r.inertia!r}, ratio={r.ratio!r}, {where})")
        return "\n".join(out)

    def turned(self, r: Array) -> Drawing:
        """The whole mechanism, gravity included, turned by the rotation r."""
        bodies = [replace(b, position=r @ b.position, rotation=r @ b.rotation) for b in self.bodies]

        def there(x: Array | None) -> Array | None:
            return None if x is None else r @ x

        joints = [
            replace(
                j, point=r @ j.point, axes=r @ j.axes, child_point=there(j.child_point), child_axis=there(j.child_axis)
            )
            for j in self.joints
        ]

        def force(f: Any) -> Any:
            if isinstance(f, Load) and f.axes == "world":
                return replace(f, force=r @ f.force)
            if isinstance(f, Spring):
                one = r @ f.point1 if f.body1 == GROUND else f.point1
                return replace(f, point1=one, point2=r @ f.point2 if f.body2 == GROUND else f.point2)
            return f

        gravity, forces = r @ self.gravity, tuple(map(force, self.forces))
        return replace(self, gravity=gravity, bodies=tuple(bodies), joints=tuple(joints), forces=forces)

    def scaled(self, length: float, mass: float, time: float) -> Drawing:
        """In other units: every length `length` times as large, and so on."""
        force, moment, rate = mass * length / time**2, mass * length**2 / time**2, 1.0 / time
        bodies = [
            replace(
                b, mass=b.mass * mass, inertia=b.inertia * (mass * length**2), com=b.com * length,
                position=b.position * length,
            )
            for b in self.bodies
        ]  # fmt: skip
        slides = {j.name: len(j.motions(j.some)[0]) for j in self.joints}

        def along(name: str, coordinate: int) -> float:
            return length if coordinate < slides[name] else 1.0

        def one(f: Any) -> Any:
            if isinstance(f, Spring):
                k, d = f.stiffness * mass / time**2, f.damping * mass / time
                ends = {"point1": f.point1 * length, "point2": f.point2 * length}
                return replace(f, stiffness=k, damping=d, length=f.length * length, **ends)
            if isinstance(f, Torsion):
                x = along(f.joint, f.coordinate)
                effort = moment / x
                return replace(
                    f, stiffness=f.stiffness * effort / x, damping=f.damping * effort / x / rate, angle=f.angle * x
                )
            if isinstance(f, Torque):
                return replace(f, value=f.value * moment / along(f.joint, f.coordinate))
            return replace(f, force=f.force * force, point=f.point * length, swing=f.swing * rate)

        def drive(d: Drive) -> Drive:
            x = along(d.joint, d.coordinate)
            return replace(d, rate=d.rate * x * rate, amplitude=d.amplitude * x, frequency=d.frequency * rate)

        def unit_of(direction: str) -> float:
            return 1.0 if direction.startswith("r") else length

        def there(j: Joint) -> Joint:
            units = np.array([unit_of(x) for x in j.free])
            return replace(
                j, point=j.point * length, child_point=None if j.child_point is None else j.child_point * length,
                pitch=j.pitch * length, follows=tuple((x, law.scaled(unit_of(x), units)) for x, law in j.follows),
            )  # fmt: skip

        return replace(
            self, gravity=self.gravity * (length / time**2),
            bodies=tuple(bodies), joints=tuple(map(there, self.joints)),
            forces=tuple(map(one, self.forces)), drives=tuple(map(drive, self.drives)),
            size=self.size * length, mass=self.mass * mass, time=self.time * time,
        )  # fmt: skip


def unit(x: Array) -> Array:
    return x / np.linalg.norm(x)


ALONG_AN_AXIS = (
    "revolute", "prismatic", "cylindrical", "screw", "constant_velocity", "point_on_line", "parallel",
)  # fmt: skip


def joint_call(j: Joint) -> tuple[str, dict[str, Any]]:
    """The method that adds a joint, and its arguments after the bodies."""
    a = np.asarray(j.axes)
    found: dict[str, Any] = {"point": j.point}
    if j.kind in ALONG_AN_AXIS:
        found["axis"] = a[:, 0]
    elif j.kind in ("planar", "point_on_plane"):
        found["normal"] = a[:, 0]
    elif j.kind in ("universal", "pin_slot", "perpendicular"):
        found.update(axis1=a[:, 0], axis2=a[:, 1])
    elif j.kind in ("generic", "custom"):
        found.update(free=j.free, frame=a)
    if j.kind == "screw":
        found["pitch"] = j.pitch
    if j.kind == "custom":
        found["follows"] = dict(j.follows)
    if j.child_point is not None:
        found["child_point"] = j.child_point
    if j.child_axis is not None:
        found["child_axis"] = j.child_axis
    if j.kind != "constant_velocity":
        found["cut"] = j.cut
    calls = {"generic": "add_joint", "custom": "add_custom_joint"}
    return calls.get(j.kind, f"add_{j.kind}"), found


def force_call(f: Any) -> tuple[str, tuple[Any, ...], dict[str, Any]]:
    """The method that adds a force, and its arguments."""
    if isinstance(f, Spring):
        named = {"stiffness": f.stiffness, "damping": f.damping, "length": f.length}
        return "add_spring", (f.name, f.body1, f.point1, f.body2, f.point2), named
    if isinstance(f, Torsion):
        named = {"stiffness": f.stiffness, "damping": f.damping, "angle": f.angle}
        return "add_torsion_spring", (f.joint,), {**named, "coordinate": f.coordinate, "name": f.name}
    if isinstance(f, Torque):
        return "add_torque", (f.joint, f.value), {"coordinate": f.coordinate, "name": f.name}
    if not isinstance(f, Load):
        call: tuple[str, tuple[Any, ...], dict[str, Any]] = f.call()
        return call
    return "add_force", (f.body, value_of(f)), {"point": f.point, "axes": f.axes, "name": f.name}


def value_of(f: Load) -> Any:
    """A load that does not swing is three numbers, one that does a function."""
    if not f.swing:
        return f.force
    value: Callable[[float, Any], Array] = lambda t, state: np.cos(f.swing * t) * f.force  # noqa: E731
    return value


def words(x: Any) -> str:
    """A number, a name or an array as Python reads it back, to the last digit."""
    if isinstance(x, np.ndarray):
        return repr(x.tolist())
    if isinstance(x, tuple):
        return f"({', '.join(map(words, x))},)"
    return repr(x)
