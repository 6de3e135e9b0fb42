"""Sensors: named outputs of a mechanism."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from ..numeric import shown
from ..sensing import OF_MOUNTED, OPERATIONS, READS, SensorRecord, known
from .bodies import own_name, resolve
from .checks import Element, choice, find, index, name_of, number, takes
from .drawing import Drawing
from .joints import joint_record, speeds
from .measures import Along, Coordinate, Cosine, Distance, measure
from .points import point_on
from .records import (
    GROUND,
    Body,
    Coupling,
    Drive,
    Force,
    Handle,
    Joint,
    LoadRecord,
    Point,
    TorqueRecord,
)

Tree = Any
"""A sensor's name, a number, or a list of an operation and its operands."""


class Reading(ABC):
    """Operands of expressions: sums, differences, products, quotients, components, norms."""

    @abstractmethod
    def tree(self) -> Tree:
        """As plain data."""

    def __add__(self, other: Any) -> Expression:
        return _made("sum", self, other)

    def __radd__(self, other: Any) -> Expression:
        return _made("sum", other, self)

    def __sub__(self, other: Any) -> Expression:
        return _made("sum", self, _made("product", -1.0, other))

    def __rsub__(self, other: Any) -> Expression:
        return _made("sum", other, _made("product", -1.0, self))

    def __mul__(self, other: Any) -> Expression:
        return _made("product", self, other)

    def __rmul__(self, other: Any) -> Expression:
        return _made("product", other, self)

    def __truediv__(self, other: Any) -> Expression:
        return _made("quotient", self, other)

    def __rtruediv__(self, other: Any) -> Expression:
        return _made("quotient", other, self)

    def __neg__(self) -> Expression:
        return _made("product", -1.0, self)

    def __getitem__(self, component: int) -> Expression:
        """One component of a vector, counted from 0."""
        if isinstance(component, bool) or not isinstance(component, int) or component < 0:
            raise IndexError(f"a component is counted from 0, not {shown(component)}")
        return Expression(["component", self.tree(), component])

    __iter__ = None  # otherwise Python would iterate over its components without end

    def norm(self) -> Expression:
        """Length of a vector, or the size of a number."""
        return _made("norm", self)

    def dot(self, other: Any) -> Expression:
        """Product of two vectors, a number."""
        return _made("dot", self, other)


class Expression(Reading):
    """An expression of other sensors, to be given to `add_sensor`.

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> tip = m.add_sensor("tip", (rod, (1, 0, 0)), "velocity")
    >>> m.add_sensor("speed", tip.norm()).name
    'speed'
    """

    def __init__(self, tree: Tree) -> None:
        self._tree = tree

    def tree(self) -> Tree:
        return self._tree

    def __repr__(self) -> str:
        return f"Expression({self._tree!r})"


class Sensor(Handle, Reading):
    """A named output; sums, products and components of it are expressions."""

    table = "sensors"

    def tree(self) -> Tree:
        return self.name


class Imu(NamedTuple):
    """An accelerometer and a gyroscope on one body."""

    specific_force: Sensor
    """Acceleration of the point less that of gravity [m/s^2]."""
    angular_velocity: Sensor
    """Of the body [rad/s]."""


def _made(word: str, *parts: Any) -> Expression:
    return Expression([word, *(part.tree() if isinstance(part, Reading) else part for part in parts)])


_MEASURES = (Coordinate, Distance, Along, Cosine)


def add_sensor(
    self: Drawing,
    name: str,
    of: Any,
    reads: str | None = None,
    *,
    axes: Any = None,
    coordinate: int | None = None,
    function: Callable[..., Any] | None = None,
    unit: str | None = None,
    text: str | None = None,
) -> Sensor:
    """Add a named output: a quantity over time, for `run.sensor(name)`, saved files and plots.

    A sensor does not affect the motion. Its values are computed on request, at the outputs, from the coordinates,
    velocities, accelerations and multipliers of the run, without finite differences.

    Possible values of `of`, and of `reads` for each:

    - (body, point), the point in body axes: "position", "velocity", "acceleration" (3), and what an accelerometer there
      measures, "specific_force": the acceleration less that of gravity, in the axes of the body (3) [m/s^2];
    - a body: the same for its origin, "rotation" (3, 3), "angular_velocity", "angular_acceleration" (3);
    - a joint, including one that closes a loop: "position", "velocity", "acceleration", "drive" (all its coordinates,
      or one selected by `coordinate`), "force", "moment" (3) on its child;
    - pt.Distance, pt.Along, pt.Cosine, pt.Coordinate: "position", "velocity", "acceleration" (a number);
    - a spring between points: "length", "rate", "force" (positive in tension), "power", "energy";
    - a torque, torsion spring or other load along a joint coordinate: "effort", "power", "energy";
    - any other force: "force", "moment" about its point of application, "position" of that point (3), on its first body
      (`coordinate` selects the others), "power", "energy";
    - a drive: "effort", and "power" where it drives one coordinate; a coupling: "effort";
    - an expression of other sensors: `front + rear`, `2 * tip[0]`, `force * rate`, `tip.norm()`, `a.dot(b)`;
    - a list of other sensors with a `function` f(t, a, b, ...) of their values at one output: a number or an array.

    Power is the power delivered to the bodies. Vectors are in world axes unless `axes` says otherwise, a specific force
    in those of its body. An accelerometer and a gyroscope in one call: `add_imu`. Force laws f(t, state) read sensors
    of positions and velocities by `state.sensor(name)`; they cannot read sensors that need
    accelerations or forces, since these depend on the force laws.

    Args:
        name: unique among the sensors.
        of: the measured object: a handle, or a name that only one element of the mechanism has.
        reads: the measured quantity; None for expressions and functions.
        axes: a body in whose axes vectors are given, as measured by a sensor mounted on it, or "world" (points, bodies,
            forces); for the force and moment of a joint "joint" or "world".
        coordinate: index of the coordinate of a joint, or of the body of a force on several bodies; None: all
            coordinates of a joint, the first body of a force.
        function: f(t, *values); its result must depend only on its arguments. A file cannot hold it.
        unit: for files and plots; None: the unit of the measured quantity.
        text: a long name; None: made from the measured quantity.

    Returns:
        A handle, which can be used in expressions.

    Raises:
        DescriptionError: the name is taken, `of` does not have this quantity, or an expression is not meaningful.
        UnknownNameError: nothing has that name.

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> tip = m.add_sensor("tip", (rod, (1, 0, 0)), "acceleration")
    >>> felt = m.add_sensor("felt", tip.norm() / 9.81, unit="g")
    >>> run = m.simulate(1.0)
    >>> run.sensor("felt").values[0].round(6).item(), run.sensor("tip").unit      # faster than a stone falls
    (1.5, 'm/s^2')
    """
    element = name_of("sensor", name, self._description.sensors)
    for what, value in (("unit", unit), ("text", text)):
        if value is not None and (not isinstance(value, str) or not value.isprintable()):
            element.fail(f"{what} must be printable text, not {shown(value)}")
    if function is not None and not callable(function):
        element.fail(f"function must be a function f(t, *values), not {shown(function)}")
    data = _data(self, element, of, function is not None)
    if function is not None:
        count = len(data["sensors"])
        takes(element, "function", function, f"t and the values of {count} sensors", 1 + count)
    if data["of"] in ("expression", "function"):
        given = {"reads": reads, "axes": axes, "coordinate": coordinate}
        more = next((what for what, value in given.items() if value is not None), None)
        if more is not None:
            element.fail(f"{more} applies to measured quantities; an expression is complete by itself")
    else:
        _complete(self, element, data, reads, axes, coordinate)
    self._description.store(self._description.sensors, SensorRecord(element.name, data, unit, text, function))
    return Sensor(element.name, self)


def add_imu(self: Drawing, name: str, of: Any, *, axes: Any = None) -> Imu:
    """Add an inertial measurement unit: an accelerometer and a gyroscope at one point of a body, as two sensors.

    The accelerometer measures the specific force, the acceleration of the point less that of gravity: at rest
    9.81 m/s^2 upwards, in free fall nothing. Both are vectors (3) in the axes of the body, which turn with it.

    Args:
        name: the sensors are called "NAME specific force" and "NAME angular velocity".
        of: (body, point), the point in body axes [m]; a body: its origin.
        axes: another body in whose axes both are given, or "world"; None: those of the body.

    Returns:
        Both sensors: `specific_force` [m/s^2], `angular_velocity` [rad/s].

    Raises:
        DescriptionError: a name is taken, or `of` is no point of a body. UnknownNameError: there is no such body.

    >>> import partita as pt
    >>> m = pt.Mechanism("arm", gravity=(0, -9.81, 0))
    >>> arm = m.add_rod("arm", start=(0, 0, 0), end=(0, 2, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, arm, point=(0, 0, 0))
    >>> imu = m.add_imu("imu", (arm, (2, 0, 0)))
    >>> run = m.simulate(1.0, t_eval=[0.0, 1.0])      # it stands upright; the arm's x points up
    >>> run.sensor("imu specific force").values[0].round(9).tolist()
    [9.81, 0.0, 0.0]
    >>> run.sensor(imu.angular_velocity.name).unit
    'rad/s'
    """
    element = name_of("sensor", name, self._description.sensors)
    names = [f"{name} {quantity}" for quantity in ("specific force", "angular velocity")]
    for each in names:
        name_of("sensor", each, self._description.sensors)
    data = _data(self, element, of, False)
    if data["of"] not in ("point", "body"):
        element.fail(f"an IMU is mounted at a point of a body, (body, (x, y, z)), not at {shown(of)}")
    body, given = {"body": data["body"]}, data["body"] if axes is None else axes
    felt = add_sensor(self, names[0], of, "specific_force", axes=given)
    return Imu(felt, add_sensor(self, names[1], body, "angular_velocity", axes=given))


def _data(m: Drawing, element: Element, of: Any, function: bool) -> dict[str, Any]:
    """The measured object, as plain data."""
    if function:
        if isinstance(of, str | bytes | dict | Reading) or not isinstance(of, Sequence):
            element.fail(f"a function takes a list of other sensors, not {shown(of)}")
        return {"of": "function", "sensors": [_sensor(m, element, one) for one in of]}
    if isinstance(of, dict):
        return _from_dict(m, element, of)
    if isinstance(of, Reading):
        return {"of": "expression", "expression": known_expression(m, element, of)}
    if isinstance(of, _MEASURES):
        return {"of": "measure", "measure": measure(m, element, of)}
    if isinstance(of, tuple | list):
        if len(of) != 2 or not isinstance(of[0], str | Body):
            element.fail(f"a point is given as (body, (x, y, z)), not as {shown(of)}")
        return _point(m, element, of[0], of if isinstance(of, Point) else of[1])
    if isinstance(of, str):
        return _named(m, element, of)
    for kind, what in ((Body, "body"), (Joint, "joint"), (Force, "force"), (Drive, "drive"), (Coupling, "coupling")):
        if isinstance(of, kind):
            return _element(m, element, what, own_name(m, element, "of", of, kind))
    element.fail(
        f"a sensor cannot read {shown(of)}; give a body, (body, point), a joint, a force, a drive, a "
        "coupling, pt.Distance and the like, or an expression of other sensors"
    )


def known_expression(m: Drawing, element: Element, of: Reading) -> Tree:
    """A sensor of this mechanism or an expression of such, checked, as plain data."""
    if isinstance(of, Sensor):
        own_name(m, element, "of", of, Sensor)
    return _tree(m, element, of.tree())


def _point(m: Drawing, element: Element, body: Any, point: Any) -> dict[str, Any]:
    name = resolve(m, element, "the body of the point", body)
    return {"of": "point", "body": name, "point": point_on(m, element, "the point", point, name).tolist()}


def _tables(m: Drawing) -> dict[str, Any]:
    d = m._description
    return {
        "body": {**d.bodies, GROUND: None},
        "joint": d.joints,
        "force": d.forces,
        "drive": d.drives,
        "coupling": d.couplings,
        "sensor": d.sensors,
    }


def _named(m: Drawing, element: Element, name: str) -> dict[str, Any]:
    """The object of this name, if it is unique."""
    tables = _tables(m)
    kinds = [kind for kind, table in tables.items() if name in table]
    if len(kinds) > 1:
        element.fail(f'"{name}" is the name of a {" and of a ".join(kinds)}; give the handle of the intended one')
    if not kinds:
        every = [other for table in tables.values() for other in table]
        find("element", name, every, where=f'sensor "{element.name}": ')
    if kinds[0] == "sensor":
        return {"of": "expression", "expression": name}
    return _element(m, element, kinds[0], name)


def _element(m: Drawing, element: Element, kind: str, name: Any) -> dict[str, Any]:
    """A named element of a kind."""
    if not isinstance(name, str):
        element.fail(f"a {kind} is given by its name, not by {shown(name)}")
    find(kind, name, _tables(m)[kind], where=f'sensor "{element.name}": ')
    data: dict[str, Any] = {"of": kind, kind: name}
    if kind == "force":
        data["form"] = _form(m._description.forces[name])
    if kind == "drive":
        drive = m._description.drives[name]
        if drive.level != "pose":
            data["measure"] = dict(drive.measure)
    return data


def _form(record: Any) -> str:
    if isinstance(record, LoadRecord) and record.kind == "spring":
        return "spring"
    if isinstance(record, LoadRecord) and record.arguments.get("restitution") is not None:
        return "effort"
    if isinstance(record, TorqueRecord):
        return "effort"
    return "effort" if isinstance(record, LoadRecord) and "joint" in record.means else "load"


_KEYS = ("body", "joint", "force", "drive", "coupling", "measure", "expression")


def _from_dict(m: Drawing, element: Element, of: dict[str, Any]) -> dict[str, Any]:
    """In the form of a file: { body = "rod", point = [...] }, { joint = "A" }, { expression = ["sum", "a", "b"] },
    ..."""
    keys = [key for key in of if key != "point"]
    if len(keys) != 1 or keys[0] not in _KEYS or ("point" in of and keys[0] != "body"):
        element.fail(
            f"of must have one key of {', '.join(_KEYS)} (a point beside a body), not {', '.join(map(str, of))}"
        )
    key = keys[0]
    if "point" in of:
        return _point(m, element, of[key], of["point"])
    if key == "measure":
        return {"of": "measure", "measure": measure(m, element, of[key])}
    if key == "expression":
        return {"of": "expression", "expression": _tree(m, element, of[key])}
    return _element(m, element, key, of[key])


def _sensor(m: Drawing, element: Element, one: Any) -> str:
    name = own_name(m, element, "a sensor of the list", one, Sensor)
    return known(name, m._description.sensors, f'sensor "{element.name}": ')


def _tree(m: Drawing, element: Element, tree: Tree, depth: int = 0) -> Tree:
    """An expression, checked."""
    if isinstance(tree, str):
        return known(tree, m._description.sensors, f'{element.kind} "{element.name}": ')
    if not isinstance(tree, list | tuple):
        return number(element, "a number in the expression", tree)
    if depth > 100:
        element.fail("the expression is nested more than 100 deep; name parts of it as sensors of their own")
    if not tree or not isinstance(tree[0], str) or tree[0] not in OPERATIONS:
        element.fail(f"an expression begins with one of {', '.join(OPERATIONS)}, not with {shown(tree[:1])}")
    word, parts = tree[0], list(tree[1:])
    least = OPERATIONS[word]
    if len(parts) < least or (len(parts) > least and word not in ("sum", "product")):
        element.fail(f"a {word} has {least} operands, not {len(parts)}")
    if word == "component":
        inner = _tree(m, element, parts[0], depth + 1)
        return [word, inner, index(element, "the component", parts[1], 1000)]
    return [word, *(_tree(m, element, part, depth + 1) for part in parts)]


def _complete(m: Drawing, element: Element, data: dict[str, Any], reads: Any, axes: Any, coordinate: Any) -> None:
    """Add the quantity that is read, and its direction, if the object has it."""
    form = data.get("form", data["of"])
    if reads is None:
        element.fail(f"give the quantity to read of the {data['of']}: {', '.join(READS[form])}")
    data["reads"] = choice(element, "reads", reads, READS[form])
    if data["of"] == "drive" and "measure" not in data and data["reads"] == "power":
        element.fail(
            f'the drive "{data["drive"]}" prescribes a pose, which has no single rate and effort; read the '
            "power of its joint"
        )
    if data["of"] == "joint":
        _along_joint(m, element, data, coordinate)
    elif coordinate is not None:
        if form != "load" or data["reads"] in ("power", "energy"):
            element.fail("coordinate applies to joints, and to forces that act on several bodies")
        data["body"] = index(element, "coordinate", coordinate, _sides(m._description.forces[data["force"]]))
    if axes is None and data["reads"] in OF_MOUNTED:
        axes = data["body"]
    if axes is None:
        return
    if data["of"] == "joint" and data["reads"] in ("force", "moment"):
        data["axes"] = choice(element, "axes", axes, ("world", "joint"))
    elif form in ("point", "body", "load") and data["reads"] not in ("rotation", "power", "energy"):
        data["axes"] = "world" if isinstance(axes, str) and axes == "world" else resolve(m, element, "axes", axes)
    else:
        element.fail(f"{data['reads']} of a {data['of']} is not a vector, so it takes no axes")


def _along_joint(m: Drawing, element: Element, data: dict[str, Any], coordinate: Any) -> None:
    record = joint_record(m, element, data["joint"])
    count = speeds(record)
    if data["reads"] in ("force", "moment"):
        if coordinate is not None:
            element.fail("coordinate applies to motions and drives; the components of a force are x, y and z")
        return
    if count == 0:
        element.fail(f'the {record.kind} joint "{record.name}" has no degree of freedom; read its force or moment')
    if coordinate is not None:
        index(element, f'coordinate of the joint "{record.name}"', coordinate, count)
        if count > 1:
            data["coordinate"] = int(coordinate)


def _sides(record: Any) -> int:
    """Bodies that a force acts on."""
    if not isinstance(record, LoadRecord):
        return 1
    return len(record.means["on"]) if record.kind == "law" else 2
