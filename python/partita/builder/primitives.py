"""Joints of one or two constraints, and joints with a coupling built in: `Mechanism.add_screw` and similar methods.

Properties common to all joints are described in `joints`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from numpy.typing import ArrayLike

from ..tolerance import EQUAL
from ..units import Quantity
from . import frames
from .checks import Element, choice, direction, number, takes
from .drawing import Drawing
from .joints import DIRECTIONS, BodyLike, directions, joint_element, store_joint
from .records import Joint
from .relations import Follower
from .values import Function


def add_screw(
    self: Drawing,
    name: str,
    parent: BodyLike,
    child: BodyLike,
    point: ArrayLike,
    axis: ArrayLike = (0.0, 0.0, 1.0),
    *,
    pitch: Quantity,
    child_point: ArrayLike | None = None,
    child_axis: ArrayLike | None = None,
    child_frame: Any = None,
    cut: str = "auto",
) -> Joint:
    """Add a screw: the child advances `pitch` [m] along `axis` for each turn about it; negative: a left-hand thread.

    A cylindrical joint whose two coordinates are coupled. Coordinates: translation [m], rotation [rad].

    >>> import partita as pt
    >>> m = pt.Mechanism("jack")
    >>> nut = m.add_body("nut", mass=1.0, inertia=(1, 1, 1))
    >>> m.add_screw("thread", m.ground, nut, point=(0, 0, 0), axis=(0, 1, 0), pitch=0.005).name
    'thread'
    """
    element = joint_element(self, name)
    value = number(element, "pitch", pitch, "m")
    if value == 0.0:
        element.fail("pitch = 0 m: a screw must advance; use a revolute joint instead")
    geometry = {"axis": direction(element, "axis", axis)}
    return store_joint(
        self, element, "screw", parent, child, point, geometry, cut, child_point, child_axis, child_frame, pitch=value
    )


def add_custom_joint(
    self: Drawing,
    name: str,
    parent: BodyLike,
    child: BodyLike,
    point: ArrayLike | None = None,
    *,
    free: Sequence[str],
    follows: Mapping[str, Callable[..., Any]],
    frame: Any = None,
    child_point: ArrayLike | None = None,
    child_frame: Any = None,
    cut: str = "auto",
) -> Joint:
    """Add a user-defined joint: each of six directions is locked, free, or a function of the free ones.

    The child translates along the joint axes x, y, z and then rotates about them, as with `add_joint`: a knee that
    rolls as it bends, a roller in a curved slot, a screw of varying pitch. It may be in the tree, close a loop or be
    used in absolute coordinates; its reaction is that of all its constraints.

    Args:
        free: the coordinates, some of "x", "y", "z", "rx", "ry", "rz".
        follows: for each dependent direction, its function of the free coordinates in the order of this list: {"x":
            lambda rz: ...} in m or rad, 0 where all of them are 0. It must be twice differentiable; its derivatives are
            exact if it uses only arithmetic and NumPy functions, otherwise those of polynomials through its values or
            differences of high order, which a note reports.
            At most two rotations may be free or dependent.
        point, frame, child_point, child_frame, cut: as in `add_joint`.

    `run.joint(...)` has the coordinates of all directions that move, in the order of the list above. Whole turns are
    not known for the angle of a joint that closes a loop in space (or in absolute coordinates): if such an angle
    reaches half a turn, the functions must be periodic. Files cannot hold functions.

    >>> import partita as pt
    >>> m = pt.Mechanism("knee")
    >>> shank = m.add_rod("shank", start=(0, 0, 0), end=(0, -0.4, 0), mass=3.0)
    >>> knee = m.add_custom_joint(
    ...     "knee", m.ground, shank, point=(0, 0, 0), free=["rz"], follows={"x": lambda rz: 0.02 * rz}
    ... )
    >>> m.simulate(0.1).joint("knee").position.shape[1]   # x, rz
    2
    """
    element = joint_element(self, name)
    chosen = directions(element, free)
    if not chosen:
        element.fail("free is empty, so no direction exists that the others could follow; name one or more")
    if not isinstance(follows, Mapping) or not follows:
        element.fail("follows must give a function for each dependent direction; use add_joint if there is none")
    named = [choice(element, "follows", direction, DIRECTIONS) for direction in follows]
    if both := [direction for direction in named if direction in chosen]:
        element.fail(f"{', '.join(both)} cannot be both free and dependent")
    ordered = tuple(direction for direction in DIRECTIONS if direction in chosen or direction in named)
    if sum(direction.startswith("r") for direction in ordered) > 2:
        element.fail(
            "it rotates about all three axes, which angles cannot describe without singularities; let at most two "
            "rotations be free or dependent"
        )
    laws = {direction: _follower(element, direction, follows[direction], len(chosen)) for direction in named}
    geometry = {"frame": frames.rotation(element, "frame", frame)}
    return store_joint(
        self,
        element,
        "custom",
        parent,
        child,
        point,
        geometry,
        cut,
        child_point,
        None,
        child_frame,
        ordered,
        follows={direction: Function(law) for direction, law in laws.items()},
    )


def _follower(element: Element, direction: str, function: Any, count: int) -> Follower:
    """A function that can be evaluated as drawn, where it is 0."""
    if not callable(function):
        element.fail(f"{direction} must follow by a function of the free coordinates, not {function!r}")
    takes(element, f"the function of {direction}", function, f"the free coordinates, {count} of them", count)
    law = Follower(element, function)
    value = law(0.0, [0.0] * (1 + count), [0.0] * (1 + count))[0]
    if abs(value) > EQUAL:
        element.fail(f"{direction} is {-value:g} where the free coordinates are 0, as drawn; it must be 0 there")
    return law


def add_constant_velocity(
    self: Drawing,
    name: str,
    parent: BodyLike,
    child: BodyLike,
    point: ArrayLike,
    axis: ArrayLike = (1.0, 0.0, 0.0),
    *,
    child_point: ArrayLike | None = None,
    child_axis: ArrayLike | None = None,
    child_frame: Any = None,
) -> Joint:
    """Add a constant-velocity joint: two shafts, aligned along `axis` as drawn, rotate at equal speed at any angle.

    Prefer it to two universal joints if the intermediate shaft does not matter. It always closes a loop and has no
    coordinates: read the motion from the bodies.

    >>> import partita as pt
    >>> m = pt.Mechanism("drive shaft")
    >>> bodies = [m.add_rod(f"shaft {i}", start=(i, 0, 0), end=(i + 1, 0, 0), mass=1.0) for i in range(2)]
    >>> m.add_constant_velocity("CV", bodies[0], bodies[1], point=(1, 0, 0)).name
    'CV'
    """
    element = joint_element(self, name)
    geometry = {"axis": direction(element, "axis", axis)}
    return store_joint(
        self, element, "constant_velocity", parent, child, point, geometry, "auto", child_point, child_axis, child_frame
    )


def add_point_on_line(
    self: Drawing,
    name: str,
    parent: BodyLike,
    child: BodyLike,
    point: ArrayLike,
    axis: ArrayLike = (1.0, 0.0, 0.0),
    *,
    child_point: ArrayLike | None = None,
    child_axis: ArrayLike | None = None,
    child_frame: Any = None,
    cut: str = "auto",
) -> Joint:
    """Keep a point of the child on a line of the parent along `axis`; all rotations are free.

    Coordinates: the slide [m], then a unit quaternion (w, x, y, z).

    >>> import partita as pt
    >>> m = pt.Mechanism("bead")
    >>> bead = m.add_body("bead", mass=1.0, inertia=(1, 1, 1))
    >>> m.add_point_on_line("wire", m.ground, bead, point=(0, 0, 0)).name
    'wire'
    """
    element = joint_element(self, name)
    geometry = {"axis": direction(element, "axis", axis)}
    return store_joint(
        self, element, "point_on_line", parent, child, point, geometry, cut, child_point, child_axis, child_frame
    )


def add_point_on_plane(
    self: Drawing,
    name: str,
    parent: BodyLike,
    child: BodyLike,
    point: ArrayLike,
    normal: ArrayLike = (0.0, 0.0, 1.0),
    *,
    child_point: ArrayLike | None = None,
    child_axis: ArrayLike | None = None,
    child_frame: Any = None,
    cut: str = "auto",
) -> Joint:
    """Keep a point of the child in a plane of the parent with this `normal`; all rotations are free.

    Coordinates: two slides [m], then a unit quaternion (w, x, y, z).

    >>> import partita as pt
    >>> m = pt.Mechanism("pen")
    >>> pen = m.add_body("pen", mass=1.0, inertia=(1, 1, 1))
    >>> m.add_point_on_plane("paper", m.ground, pen, point=(0, 0, 0)).name
    'paper'
    """
    element = joint_element(self, name)
    geometry = {"normal": direction(element, "normal", normal)}
    return store_joint(
        self, element, "point_on_plane", parent, child, point, geometry, cut, child_point, child_axis, child_frame
    )


def add_parallel(
    self: Drawing,
    name: str,
    parent: BodyLike,
    child: BodyLike,
    axis: ArrayLike,
    point: ArrayLike | None = None,
    *,
    child_axis: ArrayLike | None = None,
    child_frame: Any = None,
    cut: str = "auto",
) -> Joint:
    """Keep `axis` of the child parallel to the same axis of the parent. Coordinates: three slides [m], a turn [rad].

    `point` is the point about which the reaction moment is given; None: the child's origin as drawn.

    >>> import partita as pt
    >>> m = pt.Mechanism("tray")
    >>> tray = m.add_body("tray", mass=1.0, inertia=(1, 1, 1))
    >>> m.add_parallel("level", m.ground, tray, axis=(0, 1, 0)).name
    'level'
    """
    element = joint_element(self, name)
    geometry = {"axis": direction(element, "axis", axis)}
    return store_joint(self, element, "parallel", parent, child, point, geometry, cut, None, child_axis, child_frame)


def add_perpendicular(
    self: Drawing,
    name: str,
    parent: BodyLike,
    child: BodyLike,
    axis1: ArrayLike,
    axis2: ArrayLike,
    point: ArrayLike | None = None,
    *,
    child_frame: Any = None,
    cut: str = "auto",
) -> Joint:
    """Keep `axis2` of the child at a right angle to `axis1` of the parent. Coordinates: three slides [m], two turns
    [rad] about these axes.

    >>> import partita as pt
    >>> m = pt.Mechanism("vane")
    >>> vane = m.add_body("vane", mass=1.0, inertia=(1, 1, 1))
    >>> m.add_perpendicular("square", m.ground, vane, axis1=(1, 0, 0), axis2=(0, 1, 0)).name
    'square'
    """
    element = joint_element(self, name)
    axes = {"axis1": direction(element, "axis1", axis1), "axis2": direction(element, "axis2", axis2)}
    return store_joint(self, element, "perpendicular", parent, child, point, axes, cut, None, None, child_frame)


def add_orientation(
    self: Drawing,
    name: str,
    parent: BodyLike,
    child: BodyLike,
    point: ArrayLike | None = None,
    *,
    child_frame: Any = None,
    cut: str = "auto",
) -> Joint:
    """Keep the orientation of the child relative to the parent as drawn. Coordinates: three slides [m].

    >>> import partita as pt
    >>> m = pt.Mechanism("carriage")
    >>> carriage = m.add_body("carriage", mass=1.0, inertia=(1, 1, 1))
    >>> m.add_orientation("upright", m.ground, carriage).name
    'upright'
    """
    element = joint_element(self, name)
    return store_joint(
        self,
        element,
        "orientation",
        parent,
        child,
        point,
        {"frame": frames.rotation(element, "frame", None)},
        cut,
        None,
        None,
        child_frame,
    )
