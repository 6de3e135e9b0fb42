"""Joints: `Mechanism.add_revolute` and similar methods.

All methods share these conventions. `parent` and `child` are bodies or their names (or the ground); points and axes are
in world axes, in the drawn position; coordinates are zero there; positive rotations and translations move the child
about or along the axis, relative to the parent. `child_point` and `child_axis` are for a rough drawing in which the
loops are still open: they give the point and the axis of the joint on the child, as drawn. `child_frame` (instead of
`child_axis`) gives its full orientation there: the directions on the child that lie along the world's axes (along
`frame` if the joint has one) when all coordinates are zero. `assemble` then closes the loops. `cut` says whether the
joint closes a loop instead of being part of the spanning tree: "auto" (chosen by Partita), "always" or "never".

Every function raises `DescriptionError` for impossible data and `UnknownNameError` for a body that does not
exist.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..numeric import is_list
from ..products import norm
from . import frames
from .bodies import own_name, resolve
from .checks import Array, Element, choice, direction, find, index, name_of
from .drawing import Drawing
from .points import point_in_world
from .records import Body, Joint, JointRecord
from .values import Function

BodyLike = Body | str
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
CUTS = ("auto", "always", "never")
CHOSEN = ("generic", "custom")
"""Kinds whose directions are chosen."""
AXES_CROSS = 2e-3
"""Axes that cross at less are parallel. Scale: sine of the angle. Reason: a tenth of a degree; their rotations cannot
be distinguished."""
# Along and about the joint's axes x, y, z, its one axis along z; r1 and r2 are rotations about axes of its own.
_MOTIONS: dict[str, tuple[str, ...]] = {
    "revolute": ("rz",),
    "prismatic": ("z",),
    "cylindrical": ("z", "rz"),
    "universal": ("r1", "r2"),
    "planar": ("x", "y", "rz"),
    "spherical": ("rx", "ry", "rz"),
    "fixed": (),
    "free": DIRECTIONS,
    "screw": ("z", "rz"),
    "constant_velocity": (),
    "point_on_line": ("z", "rx", "ry", "rz"),
    "point_on_plane": ("x", "y", "rx", "ry", "rz"),
    "parallel": ("x", "y", "z", "rz"),
    "perpendicular": ("x", "y", "z", "r1", "r2"),
    "orientation": ("x", "y", "z"),
    "pin_slot": ("z", "r2"),
}


def add_revolute(
    self: Drawing,
    name: str,
    parent: BodyLike,
    child: BodyLike,
    point: ArrayLike,
    axis: ArrayLike = (0.0, 0.0, 1.0),
    *,
    child_point: ArrayLike | None = None,
    child_axis: ArrayLike | None = None,
    child_frame: Any = None,
    cut: str = "auto",
) -> Joint:
    """Add a hinge: the child rotates about `axis` through `point`. One coordinate, the angle [rad].

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> m.add_revolute("A", m.ground, rod, point=(0, 0, 0)).name
    'A'
    """
    element = joint_element(self, name)
    geometry = {"axis": direction(element, "axis", axis)}
    return store_joint(
        self, element, "revolute", parent, child, point, geometry, cut, child_point, child_axis, child_frame
    )


def add_prismatic(
    self: Drawing,
    name: str,
    parent: BodyLike,
    child: BodyLike,
    point: ArrayLike | None = None,
    axis: ArrayLike = (1.0, 0.0, 0.0),
    *,
    child_point: ArrayLike | None = None,
    child_axis: ArrayLike | None = None,
    child_frame: Any = None,
    cut: str = "auto",
) -> Joint:
    """Add a slide along `axis` without rotation. One coordinate, the translation [m].

    The reaction moment is about `point`; None: the child's origin as drawn.

    >>> import partita as pt
    >>> m = pt.Mechanism("slide")
    >>> block = m.add_body("block", mass=1.0, inertia=(1, 1, 1))
    >>> m.add_prismatic("S", m.ground, block, axis=(0, 1, 0)).name
    'S'
    """
    element = joint_element(self, name)
    geometry = {"axis": direction(element, "axis", axis)}
    return store_joint(
        self, element, "prismatic", parent, child, point, geometry, cut, child_point, child_axis, child_frame
    )


def add_cylindrical(
    self: Drawing,
    name: str,
    parent: BodyLike,
    child: BodyLike,
    point: ArrayLike,
    axis: ArrayLike = (0.0, 0.0, 1.0),
    *,
    child_point: ArrayLike | None = None,
    child_axis: ArrayLike | None = None,
    child_frame: Any = None,
    cut: str = "auto",
) -> Joint:
    """Add a joint that slides along and turns about `axis` through `point`. Coordinates: slide [m], turn
    [rad].

    >>> import partita as pt
    >>> m = pt.Mechanism("piston")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(0, 0, 1), mass=1.0)
    >>> m.add_cylindrical("C", m.ground, rod, point=(0, 0, 0)).name
    'C'
    """
    element = joint_element(self, name)
    geometry = {"axis": direction(element, "axis", axis)}
    return store_joint(
        self, element, "cylindrical", parent, child, point, geometry, cut, child_point, child_axis, child_frame
    )


def add_spherical(
    self: Drawing,
    name: str,
    parent: BodyLike,
    child: BodyLike,
    point: ArrayLike,
    *,
    child_point: ArrayLike | None = None,
    child_frame: Any = None,
    cut: str = "auto",
) -> Joint:
    """Add a ball joint at `point`. Coordinates: a unit quaternion (w, x, y, z) of the child relative to the
    parent.

    Its three velocities are the child's relative angular velocity in child axes [rad/s]; there is no singular
    position.

    >>> import partita as pt
    >>> m = pt.Mechanism("top")
    >>> top = m.add_body("top", mass=1.0, inertia=(1, 1, 1), com=(0, 0, 0.1))
    >>> m.add_spherical("S", m.ground, top, point=(0, 0, 0)).name
    'S'
    """
    return store_joint(
        self, joint_element(self, name), "spherical", parent, child, point, {}, cut, child_point, None, child_frame
    )


def add_universal(
    self: Drawing,
    name: str,
    parent: BodyLike,
    child: BodyLike,
    point: ArrayLike,
    axis1: ArrayLike,
    axis2: ArrayLike,
    *,
    child_point: ArrayLike | None = None,
    child_frame: Any = None,
    cut: str = "auto",
) -> Joint:
    """Add a universal joint at `point`: a turn about `axis1`, fixed in the parent, then about `axis2`, fixed
    in the child.

    The axes must not be parallel; a right angle is usual. Coordinates: the two angles [rad].

    >>> import partita as pt
    >>> m = pt.Mechanism("shaft")
    >>> shaft = m.add_rod("shaft", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> m.add_universal("U", m.ground, shaft, point=(0, 0, 0), axis1=(0, 1, 0), axis2=(0, 0, 1)).name
    'U'
    """
    element = joint_element(self, name)
    first, second = direction(element, "axis1", axis1), direction(element, "axis2", axis2)
    sine = norm(np.cross(first, second)) / float(norm(first) * norm(second))
    if sine < AXES_CROSS:
        element.fail(
            f"axis1 {first.tolist()} and axis2 {second.tolist()} are parallel; a universal joint needs two axes at "
            "an angle, ideally a right angle"
        )
    axes = {"axis1": first, "axis2": second}
    return store_joint(self, element, "universal", parent, child, point, axes, cut, child_point, None, child_frame)


def add_pin_slot(
    self: Drawing,
    name: str,
    parent: BodyLike,
    child: BodyLike,
    point: ArrayLike,
    axis1: ArrayLike = (1.0, 0.0, 0.0),
    axis2: ArrayLike = (0.0, 0.0, 1.0),
    *,
    child_point: ArrayLike | None = None,
    child_frame: Any = None,
    cut: str = "auto",
) -> Joint:
    """Add a pin in a slot: a slide along the slot `axis1`, fixed in the parent, then a turn about the pin `axis2`,
    fixed in the child, at a right angle to it.

    Scotch yokes, slotted levers and Geneva wheels have one. Coordinates: translation [m], angle [rad]; the force acts
    across the slot. For a pin that can also tilt or move along its own axis use `add_point_on_line` or `add_joint`.

    >>> import partita as pt
    >>> m = pt.Mechanism("yoke")
    >>> yoke = m.add_body("yoke", mass=1.0, inertia=(1, 1, 1))
    >>> crank = m.add_rod("crank", start=(0, 0, 0), end=(0, 0.1, 0), mass=0.2)
    >>> m.add_pin_slot("pin", yoke, crank, point=(0, 0.1, 0), axis1=(0, 1, 0)).name
    'pin'
    """
    element = joint_element(self, name)
    axes = {"axis1": direction(element, "axis1", axis1), "axis2": direction(element, "axis2", axis2)}
    return store_joint(self, element, "pin_slot", parent, child, point, axes, cut, child_point, None, child_frame)


def add_planar(
    self: Drawing,
    name: str,
    parent: BodyLike,
    child: BodyLike,
    point: ArrayLike | None = None,
    normal: ArrayLike = (0.0, 0.0, 1.0),
    *,
    child_point: ArrayLike | None = None,
    child_axis: ArrayLike | None = None,
    child_frame: Any = None,
    cut: str = "auto",
) -> Joint:
    """Add a joint that keeps `point` in the plane across `normal`. Coordinates: two slides [m], then the turn
    [rad].

    `point` None: the child's origin as drawn. `child_axis` is the normal on the child in a rough drawing. The
    first translation is along the x axis of the parent, projected into the plane (of the child where the parent is the
    ground; the y axis where x is within 26 degrees of the normal), the second perpendicular to it. To drive along a
    given direction, use `add_joint` with a frame.

    >>> import partita as pt
    >>> m = pt.Mechanism("puck")
    >>> puck = m.add_body("puck", mass=0.1, inertia=(1e-4, 1e-4, 2e-4))
    >>> m.add_planar("P", m.ground, puck).name
    'P'
    """
    element = joint_element(self, name)
    geometry = {"normal": direction(element, "normal", normal)}
    return store_joint(
        self, element, "planar", parent, child, point, geometry, cut, child_point, child_axis, child_frame
    )


def add_fixed(
    self: Drawing,
    name: str,
    parent: BodyLike,
    child: BodyLike,
    point: ArrayLike | None = None,
    *,
    child_point: ArrayLike | None = None,
    child_frame: Any = None,
    cut: str = "auto",
) -> Joint:
    """Weld the child to the parent as drawn. No coordinate; its reaction is that of a section through the
    weld at `point`.

    `point` None: the child's origin as drawn.

    >>> import partita as pt
    >>> m = pt.Mechanism("frame")
    >>> frame = m.add_rod("frame", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> m.add_fixed("weld", m.ground, frame).name
    'weld'
    """
    return store_joint(
        self, joint_element(self, name), "fixed", parent, child, point, {}, cut, child_point, None, child_frame
    )


def add_free(
    self: Drawing,
    name: str,
    parent: BodyLike,
    child: BodyLike,
    point: ArrayLike | None = None,
    *,
    cut: str = "auto",
) -> Joint:
    """Let the child move freely, and give that motion a name. Coordinates: three slides [m], a quaternion (w,
    x, y, z).

    It imposes no constraint; use it to set or read the motion of a body that has no other joint. `point` None: the
    child's origin as drawn.

    >>> import partita as pt
    >>> m = pt.Mechanism("stone")
    >>> stone = m.add_body("stone", mass=1.0, inertia=(1, 1, 1))
    >>> m.add_free("flight", m.ground, stone).name
    'flight'
    """
    return store_joint(self, joint_element(self, name), "free", parent, child, point, {}, cut)


def add_joint(
    self: Drawing,
    name: str,
    parent: BodyLike,
    child: BodyLike,
    free: Iterable[str],
    point: ArrayLike | None = None,
    frame: Any = None,
    *,
    child_point: ArrayLike | None = None,
    child_frame: Any = None,
    cut: str = "auto",
) -> Joint:
    """Add a joint with any subset of the six directions free. Prefer a named joint where there is one.

    Args:
        free: some of "x", "y", "z" (slides along the joint axes) and "rx", "ry", "rz" (turns about them).
            Coordinates come in this order, whatever the order here; all three rotations together are a quaternion.
        point: position of the joint in the world [m]; None: the child's origin as drawn.
        frame: joint axes in the world as drawn, as `orientation` in `add_body`; None: parallel to the world.

    >>> import partita as pt
    >>> m = pt.Mechanism("slotted")
    >>> plate = m.add_body("plate", mass=1.0, inertia=(1, 1, 2))
    >>> m.add_joint("slot", m.ground, plate, free=("x", "rz"), point=(0, 0, 0)).name
    'slot'
    """
    element = joint_element(self, name)
    ordered = directions(element, free)
    geometry = {"frame": frames.rotation(element, "frame", frame)}
    return store_joint(
        self, element, "generic", parent, child, point, geometry, cut, child_point, None, child_frame, ordered
    )


def directions(element: Element, free: Any) -> tuple[str, ...]:
    """Directions that are free, in the order of their coordinates."""
    wanted = [choice(element, "free", item, DIRECTIONS) for item in _listed(element, free)]
    if len(set(wanted)) < len(wanted):
        element.fail(f"free names a direction twice: {', '.join(wanted)}")
    return tuple(item for item in DIRECTIONS if item in wanted)


def _listed(element: Element, free: Any) -> list[Any]:
    if not is_list(free):
        element.fail(f'free must be a list of directions such as ("x", "rz"), not {free!r}')
    return list(free)


def joint_element(mechanism: Drawing, name: str) -> Element:
    return name_of("joint", name, mechanism._description.joints)


def store_joint(
    mechanism: Drawing,
    element: Element,
    kind: str,
    parent: BodyLike,
    child: BodyLike,
    point: ArrayLike | None,
    geometry: dict[str, Array],
    cut: str,
    child_point: ArrayLike | None = None,
    child_axis: ArrayLike | None = None,
    child_frame: Any = None,
    free: tuple[str, ...] = (),
    pitch: float | None = None,
    follows: Mapping[str, Function] | None = None,
) -> Joint:
    """Check the arguments common to all joints and store the record."""
    first, second = resolve(mechanism, element, "parent", parent), resolve(mechanism, element, "child", child)
    if first == second:
        element.fail(f'parent and child are both "{first}"; a joint needs two different bodies')
    if child_axis is not None and child_frame is not None:
        element.fail("child_axis and child_frame both orient the joint on its child; give one of them")
    record = JointRecord(
        name=element.name,
        kind=kind,
        parent=first,
        child=second,
        point=None if point is None else point_in_world(mechanism, element, "point", point),
        geometry=geometry,
        free=free,
        child_point=None if child_point is None else point_in_world(mechanism, element, "child_point", child_point),
        child_axis=None if child_axis is None else direction(element, "child_axis", child_axis),
        child_frame=None if child_frame is None else frames.rotation(element, "child_frame", child_frame),
        pitch=pitch,
        cut=choice(element, "cut", cut, CUTS),
        follows=follows or {},
    )
    mechanism._description.store(mechanism._description.joints, record)
    return Joint(element.name, mechanism)


def motions(joint: JointRecord) -> tuple[str, ...]:
    """Directions in which a joint moves, in the order of its coordinates: "x", "y", "z", then rotations "r..."."""
    return joint.free if joint.kind in CHOSEN else _MOTIONS[joint.kind]


def speeds(joint: JointRecord) -> int:
    """Number of velocities of a joint: an effort can act along each."""
    return len(motions(joint))


def unit_of(joint: JointRecord, coordinate: int) -> str:
    """Unit of a coordinate, of which there are as many as velocities: "m" for a translation, "rad" for a rotation."""
    return "rad" if motions(joint)[coordinate].startswith("r") else "m"


def effort_of(joint: JointRecord, coordinate: int) -> str:
    """Unit of the effort along a coordinate."""
    return "N" if unit_of(joint, coordinate) == "m" else "N m"


def scalars(joint: JointRecord) -> int:
    """Number of leading coordinates that are a slide or an angle, not part of a quaternion."""
    moving = motions(joint)
    turns = sum(item.startswith("r") for item in moving)
    return len(moving) - 3 if turns == 3 else len(moving)


def joint_record(mechanism: Drawing, element: Element, joint: Joint | str) -> JointRecord:
    """The record of the joint given by a handle or a name."""
    joints = mechanism._description.joints
    name = own_name(mechanism, element, "joint", joint, Joint)
    return joints[find("joint", name, joints, where=f'{element.kind} "{element.name}": ')]


def coordinate_of(element: Element, joint: JointRecord, coordinate: Any, count: int) -> int:
    """A coordinate number that the joint has and the element can use."""
    if count == 0:
        element.fail(f'the {joint.kind} joint "{joint.name}" has no translation or angle along which this could act')
    return index(element, f'coordinate of the {joint.kind} joint "{joint.name}"', coordinate, count)


class NamedJoints(Drawing):
    """The methods of this module."""

    add_revolute = add_revolute
    add_prismatic = add_prismatic
    add_cylindrical = add_cylindrical
    add_spherical = add_spherical
    add_universal = add_universal
    add_pin_slot = add_pin_slot
    add_planar = add_planar
    add_fixed = add_fixed
    add_free = add_free
    add_joint = add_joint
