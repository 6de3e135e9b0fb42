"""Couplings: constraints between joints or bodies other than joints: `Mechanism.add_gear` and similar methods.

A coupling acts on the coordinates of joints in the spanning tree, of joints that close loops, and in absolute
coordinates. Coordinates are zero as drawn, so a coupling is satisfied as drawn. Its force is
`result.coupling(name).effort`.

Every function raises `DescriptionError` for impossible data, and `UnknownNameError` for a joint or body that does not
exist.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..shapes import Shape
from ..tolerance import EQUAL
from ..units import Quantity
from .bodies import radius_of, resolve
from .checks import Element, choice, direction, name_of, number, numbers, switch, takes
from .drawing import Drawing
from .measures import Along, BodyLike, Coordinate, Distance, drawn, measure, measured_in
from .name_first import name_first
from .points import point_on
from .records import Coupling, CouplingRecord, Joint
from .relations import Follower, Law, Profile, RateLaw
from .values import Function, is_table, table

MOST = 12
"""Maximum number of arguments of a function."""


def add_coupler(
    self: Drawing,
    name: str,
    terms: Sequence[Any],
    factors: ArrayLike,
    offset: Quantity | None = None,
    *,
    word: str = "coupler",
) -> Coupling:
    """Constrain a weighted sum of coordinates: factors[0] x terms[0] + factors[1] x terms[1] + ... = offset.

    The general form of gear, rack, belt and distance; a differential or a planetary gear has three terms.

    Args:
        terms: joints (their first coordinates), or `pt.Coordinate`, `pt.Distance`, `pt.Along`, `pt.Cosine`; any
            number of them.
        factors: one nonzero number for each term. The first has no unit; the others convert their terms to the unit of
            the first: (1, "-20 mm/rad") for a translation and a rotation.
        offset: value of the sum, in the unit of the first term; None: as drawn, so that the drawing satisfies it
            (coordinates of joints are zero as drawn).
        word: what reports and messages call it.

    In absolute coordinates, and for joints that close loops in space, whole turns are not known. If the factors have no
    common period, the coupling then constrains only the rates, which gives the same motion.

    >>> import partita as pt
    >>> m = pt.Mechanism("differential")
    >>> for shaft in ("left", "right", "cage"):
    ...     wheel = m.add_body(shaft, mass=1.0, inertia=(1, 1, 2))
    ...     joint = m.add_revolute(f"of {shaft}", m.ground, wheel, point=(0, 0, 0))
    >>> m.add_coupler("gears", ["of left", "of right", "of cage"], [1, 1, -2]).name
    'gears'
    """
    element = _element(self, name)
    found = _terms(self, element, terms)
    units = [measured_in(self, term) for term in found]
    weights = [
        number(element, "factors", f)
        for f in numbers(element, "factors", factors, factor_units(units)).ravel().tolist()
    ]
    if len(weights) != len(found):
        element.fail(f"there are {len(found)} terms but {len(weights)} factors; give one for each")
    if 0.0 in weights:
        element.fail(f"factor {weights.index(0.0)} is 0; leave that term out")
    given = None if offset is None else number(element, "offset", offset, units[0])
    as_drawn = sum(weight * drawn(self, term) for weight, term in zip(weights, found, strict=True))
    data = {"factors": weights, "offset": as_drawn if given is None else given}
    call = ("add_coupler", {"terms": found, "factors": weights, "offset": given, "word": str(word)})
    return _store(self, CouplingRecord(element.name, "linear", str(word), tuple(found), data, call))


@name_first(2)
def add_gear(
    self: Drawing,
    joint1: Joint | str,
    joint2: Joint | str,
    ratio: float,
    *,
    coordinate1: int = 0,
    coordinate2: int = 0,
    name: str | None = None,
) -> Coupling:
    """Couple two joints: the rate of `joint2` is `ratio` times the rate of `joint1`.

    For two external gears on fixed axes the ratio is minus the radius of the first over that of the second; for an
    internal gear it is positive.

    >>> import partita as pt
    >>> m = pt.Mechanism("gears")
    >>> for i in (1, 2):
    ...     wheel = m.add_body(f"wheel {i}", mass=1.0, inertia=(1, 1, 2), position=(i, 0, 0))
    ...     joint = m.add_revolute(f"A{i}", m.ground, wheel, point=(i, 0, 0))
    >>> m.add_gear("A1", "A2", ratio=-2.0).name
    'gear A1 - A2'
    """
    name = f"gear {joint1} - {joint2}" if name is None else name
    element = _element(self, name)
    terms = [Coordinate(joint2, coordinate2), Coordinate(joint1, coordinate1)]
    units = [measured_in(self, measure(self, element, x)) for x in terms]
    value = number(element, "ratio", ratio, factor_units(units)[1])
    if value == 0.0:
        element.fail("ratio is 0: joint2 would stand still; use add_fixed instead")
    made = add_coupler(self, name, terms, [1.0, -value], word="gear")
    return _recorded_as(
        self, made, "add_gear", joint1=str(joint1), joint2=str(joint2), ratio=value, **_which(self, made)
    )


@name_first(2)
def add_belt(
    self: Drawing,
    pulley1: Joint | str,
    pulley2: Joint | str,
    radius1: Quantity,
    radius2: Quantity,
    *,
    crossed: bool = False,
    name: str | None = None,
) -> Coupling:
    """Couple two revolute joints by a belt or chain that does not slip: radius1 x rate1 = radius2 x rate2.

    The axes must point in the same direction; for a crossed belt reverse the axis of the second pulley.

    >>> import partita as pt
    >>> m = pt.Mechanism("belt")
    >>> for i in (1, 2):
    ...     wheel = m.add_body(f"wheel {i}", mass=1.0, inertia=(1, 1, 2), position=(i, 0, 0))
    ...     joint = m.add_revolute(f"A{i}", m.ground, wheel, point=(i, 0, 0))
    >>> m.add_belt("A1", "A2", radius1=0.1, radius2=0.3).name
    'belt A1 - A2'
    """
    name = f"belt {pulley1} - {pulley2}" if name is None else name
    element = _element(self, name)
    radii = [_positive(element, what, r) for what, r in (("radius1", radius1), ("radius2", radius2))]
    ratio = radii[0] / radii[1] * (-1.0 if switch(element, "crossed", crossed) else 1.0)
    made = add_coupler(self, name, [Coordinate(pulley2), Coordinate(pulley1)], [1.0, -ratio], word="belt")
    ends = {"pulley1": str(pulley1), "pulley2": str(pulley2), "radius1": radii[0], "radius2": radii[1]}
    return _recorded_as(self, made, "add_belt", **ends, crossed=bool(crossed))


@name_first(2)
def add_rack(
    self: Drawing,
    pinion: Joint | str,
    slide: Joint | str,
    radius: Quantity,
    *,
    coordinate1: int = 0,
    coordinate2: int = 0,
    name: str | None = None,
) -> Coupling:
    """Couple a rotation and a translation: the rate of `slide` is `radius` times that of `pinion`; negative: reversed.

    >>> import partita as pt
    >>> m = pt.Mechanism("steering")
    >>> wheel = m.add_body("pinion", mass=1.0, inertia=(1, 1, 2))
    >>> rack = m.add_body("rack", mass=1.0, inertia=(1, 1, 2))
    >>> turn = m.add_revolute("P", m.ground, wheel, point=(0, 0, 0))
    >>> slide = m.add_prismatic("R", m.ground, rack, axis=(1, 0, 0))
    >>> m.add_rack(turn, slide, radius=0.02).name
    'rack P - R'
    """
    name = f"rack {pinion} - {slide}" if name is None else name
    element = _element(self, name)
    value = number(element, "radius", radius, "m")
    if value == 0.0:
        element.fail("radius is 0 m: the rack would stand still")
    terms = [Coordinate(slide, coordinate2), Coordinate(pinion, coordinate1)]
    made = add_coupler(self, name, terms, [1.0, -value], word="rack")
    return _recorded_as(
        self, made, "add_rack", pinion=str(pinion), slide=str(slide), radius=value, **_which(self, made)
    )


def add_distance(
    self: Drawing,
    name: str,
    body1: BodyLike,
    point1: ArrayLike,
    body2: BodyLike,
    point2: ArrayLike,
    length: Quantity | None = None,
) -> Coupling:
    """Keep two points at a constant distance: a massless rod between two balls, without an idle rotation.

    Prefer it to a body if the mass of the rod does not matter: a rod with ball joints at both ends has an idle
    rotation. The force in it is `result.coupling(name).tension`.

    Args:
        point1, point2: in body axes, of the ground in the world [m].
        length: [m]; None: as drawn.

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> bob = m.add_body("bob", mass=1.0, inertia=(1e-3, 1e-3, 1e-3), position=(0, -1, 0))
    >>> m.add_distance("wire", m.ground, (0, 0, 0), bob, (0, 0, 0)).name
    'wire'
    """
    element = _element(self, name)
    rod = Distance(body1, point1, body2, point2)
    found = measure(self, element, rod)
    as_drawn = drawn(self, found)
    if length is None and as_drawn == 0.0:
        element.fail("its points coincide as drawn; a distance of 0 has no direction: use a spherical joint")
    held = as_drawn if length is None else _positive(element, "length", length)
    made = add_coupler(self, name, [rod], [1.0], held, word="distance")
    ends = {key: found[key] for key in ("body1", "point1", "body2", "point2")}
    return _recorded_as(self, made, "add_distance", **ends, length=None if length is None else held)


@name_first(2)
def add_cam(
    self: Drawing,
    follower: Any,
    cam: Any,
    law: tuple[ArrayLike, ArrayLike] | Callable[..., Any],
    *,
    periodic: bool = False,
    name: str | None = None,
    word: str = "cam",
) -> Coupling:
    """Let one coordinate follow another: follower = law(cam).

    Args:
        follower, cam: joints (their first coordinates), or measurements as in `add_coupler`.
        law: a table (x, y), joined by a twice differentiable cubic spline and computed without Python; or a function of
            one number (arithmetic, NumPy functions, `np.polynomial.Polynomial`).
        periodic: the table repeats after its last x, as smoothly as elsewhere; first and last y must be equal.

    >>> import numpy as np
    >>> import partita as pt
    >>> m = pt.Mechanism("valve")
    >>> shaft = m.add_body("shaft", mass=1.0, inertia=(1, 1, 2))
    >>> valve = m.add_body("valve", mass=0.1, inertia=(1, 1, 2))
    >>> turn = m.add_revolute("A", m.ground, shaft, point=(0, 0, 0))
    >>> lift = m.add_prismatic("V", m.ground, valve, axis=(0, 1, 0))
    >>> m.add_cam(lift, turn, lambda x: 0.01 * (1.0 - np.cos(x))).name
    'cam A - V'
    """
    name = f"cam {cam} - {follower}" if name is None else name
    element = _element(self, name)
    terms = _terms(self, element, [follower, cam])
    if callable(law):
        takes(element, "law", law, "one argument, the reading of the cam", 1)
        function = Function(Follower(element, law))
        data = {"function": function, "like": 0}
        made = _store(self, CouplingRecord(element.name, "function", str(word), tuple(terms), data))
        return _recorded_as(self, made, "add_cam", follower=terms[0], cam=terms[1], law=law, word=str(word))
    if not is_table(law):
        element.fail(f"law must be a table (x, y) or a function of one number, not {law!r}")
    repeats = switch(element, "periodic", periodic)
    follows, leads = (measured_in(self, term) for term in terms)
    curve = table(element, "law", (law[0], law[1]), "periodic" if repeats else "spline", (leads, follows))
    if repeats:
        gap = abs(float(curve.values[-1] - curve.values[0]))
        if gap > EQUAL * float(np.abs(curve.values).max()):
            element.fail(
                f"a periodic law must end where it begins: y is {curve.values[0]:g} first, {curve.values[-1]:g} last; "
                "for a follower that goes on at each turn give a table over all turns, without periodic"
            )
    data = {"curve": curve, "periodic": repeats}
    made = _store(self, CouplingRecord(element.name, "curve", str(word), tuple(terms), data))
    arguments = {"law": (curve.times, curve.values), "periodic": repeats, "word": str(word)}
    return _recorded_as(self, made, "add_cam", follower=terms[0], cam=terms[1], **arguments)


def add_point_on_curve(
    self: Drawing,
    name: str,
    body1: BodyLike,
    body2: BodyLike,
    point2: ArrayLike,
    curve: tuple[ArrayLike, ArrayLike] | Callable[..., Any],
    *,
    origin: ArrayLike = (0.0, 0.0, 0.0),
    x_axis: ArrayLike = (1.0, 0.0, 0.0),
    y_axis: ArrayLike = (0.0, 1.0, 0.0),
    polar: bool = False,
) -> Coupling:
    """Keep a point of `body2` on a curve of `body1`, seen along the normal of the curve's plane: a slot, a rail, a cam.

    It does not constrain the point across the plane; use a joint or `add_point_on_plane` for that.

    Args:
        point2: the point, in axes of `body2` [m].
        curve: y over x: a table or a function; or, with `polar`, a table (angle [rad], radius [m]) that closes after a
            whole turn, such as the outline of a cam.
        origin, x_axis, y_axis: origin and axes of the curve, in axes of `body1`.

    >>> import partita as pt
    >>> m = pt.Mechanism("bead")
    >>> bead = m.add_body("bead", mass=1.0, inertia=(1, 1, 1), position=(0, 1, 0))
    >>> m.add_point_on_curve("wire", m.ground, bead, (0, 0, 0), lambda x: 1.0 + x**2).name
    'wire'
    """
    element = _element(self, name)
    x, y = (
        Along(body1, origin, axis, body2, point2)
        for axis in (direction(element, "x_axis", x_axis), direction(element, "y_axis", y_axis))
    )
    found = measure(self, element, x)
    arguments = {"body1": found["body1"], "body2": found["body2"], "point2": found["point2"], "origin": found["point1"]}
    arguments |= {"x_axis": x.axis, "y_axis": y.axis}
    if not switch(element, "polar", polar):
        made = add_cam(self, y, x, curve, name=name, word="curve")
        return _recorded_as(self, made, "add_point_on_curve", **arguments, curve=_call_of(self, made)["law"])
    if callable(curve) or not is_table(curve):
        element.fail("a polar curve is a table (angles, radii)")
    outline = table(element, "curve", (curve[0], curve[1]), "spline", ("rad", "m"))
    span = float(outline.times[-1] - outline.times[0])
    closes = abs(float(outline.values[-1] - outline.values[0])) <= EQUAL * float(np.abs(outline.values).max())
    if abs(span - math.tau) > EQUAL or not closes:
        element.fail(
            f"a polar curve closes after a whole turn: angles span {span:g} rad, radii begin with "
            f"{outline.values[0]:g} and end with {outline.values[-1]:g} m"
        )
    if float(outline.values.min()) <= 0.0:
        element.fail(f"a radius is {outline.values.min():g} m; all must be positive")
    values = np.append(outline.values[:-1], outline.values[0])
    function = Function(Profile(outline.times, values))
    terms = tuple(_terms(self, element, [x, y]))
    made = _store(self, CouplingRecord(element.name, "function", "curve", terms, {"function": function, "like": 0}))
    line = (outline.times, outline.values)
    return _recorded_as(self, made, "add_point_on_curve", **arguments, curve=line, polar=True)


def add_rolling(
    self: Drawing,
    name: str,
    body: BodyLike,
    radius: Quantity | Shape,
    *,
    center: ArrayLike = (0.0, 0.0, 0.0),
    axis: ArrayLike = (0.0, 0.0, 1.0),
    ball: bool = False,
    on: BodyLike | None = None,
    point: ArrayLike = (0.0, 0.0, 0.0),
    normal: ArrayLike = (0.0, 1.0, 0.0),
    slips: bool = False,
) -> Coupling:
    """Let a disc (a wheel with a sharp edge) or a ball roll on a plane without slipping.

    Contact is one constraint on positions; rolling adds two nonholonomic constraints on velocities, which leave every
    position accessible. A shape that has a radius may stand for it, such as `wheel.shape`.

    Args:
        body: the rolling body; `center` [m] and `axis` of the disc are in its axes.
        ball: a ball, which has no axis.
        radius: [m].
        on: the body that carries the plane; None: the ground.
        point, normal: a point of the plane, and its normal towards the centre, in axes of `on`.
        slips: True: contact only, without the constraints of rolling.

    >>> import partita as pt
    >>> m = pt.Mechanism("coin")
    >>> coin = m.add_body("coin", mass=1.0, inertia=(1, 1, 2), position=(0, 0.5, 0))
    >>> m.add_rolling("edge", coin, radius=0.5).name
    'edge'
    """
    element = _element(self, name)
    roller = resolve(self, element, "body", body, ground=False)
    carrier = resolve(self, element, "on", self.ground if on is None else on)
    if roller == carrier:
        element.fail(f'"{roller}" cannot roll on itself; name two different bodies')
    data = {
        "body": roller,
        "center": point_on(self, element, "center", center, roller).tolist(),
        "axis": None if switch(element, "ball", ball) else direction(element, "axis", axis).tolist(),
        "radius": _positive(element, "radius", radius_of(element, "radius", radius)),
        "on": carrier,
        "point": point_on(self, element, "point", point, carrier).tolist(),
        "normal": direction(element, "normal", normal).tolist(),
        "slips": switch(element, "slips", slips),
    }
    arguments = {key: value for key, value in data.items() if value is not None}
    call = ("add_rolling", {**arguments, "ball": data["axis"] is None})
    return _store(self, CouplingRecord(element.name, "roll", "rolling contact", (), data, call))


def add_constraint(
    self: Drawing,
    name: str,
    function: Callable[..., Any],
    of: Sequence[Any],
    *,
    gradient: Callable[..., Any] | None = None,
    level: str = "position",
    word: str = "constraint",
) -> Coupling:
    """Add a user-defined constraint: function(t, x1, x2, ...) = 0 of measurements of the mechanism.

    Several of them between two bodies make a user-defined joint.

    Args:
        function: returns one number. With level "velocity" it returns the coefficients g_i of a nonholonomic constraint
            g_1 x1' + g_2 x2' + ... = 0, and optionally one further number that is added to the sum.
        of: its arguments, in order: joints (their first coordinates) or measurements as in `add_coupler`; at most 12.
        gradient: (t, x1, x2, ...) -> the partial derivatives; None: computed exactly if the function uses only
            arithmetic and NumPy functions, otherwise by central differences, which a note reports.

    The function and its first derivatives must be continuous. Whole turns are not known for the angle of a joint that
    closes a loop in space (or in absolute coordinates): if such an angle reaches half a turn, the function must be
    periodic.

    Raises:
        DescriptionError: the given gradient is not that of the function.
        EvaluationError: the function returns anything but finite numbers, jumps, or depends on whole turns that are not
            known (here or during a run).

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum on a parabola")
    >>> bob = m.add_body("bob", mass=1.0, inertia=(1, 1, 1))
    >>> x = pt.Along(m.ground, (0, 0, 0), (1, 0, 0), bob, (0, 0, 0))
    >>> y = pt.Along(m.ground, (0, 0, 0), (0, 1, 0), bob, (0, 0, 0))
    >>> m.add_constraint("parabola", lambda t, x, y: y - x**2, of=[x, y]).name
    'parabola'
    """
    element = _element(self, name)
    terms = _terms(self, element, of)
    if len(terms) > MOST:
        element.fail(
            f"its function would have {len(terms)} arguments; at most {MOST} are allowed. add_coupler takes a sum of "
            f"any number of terms"
        )
    kind = choice(element, "level", level, ("position", "velocity"))
    if not callable(function):
        element.fail(f"function must be callable, not {function!r}")
    if gradient is not None and (kind == "velocity" or not callable(gradient)):
        element.fail("gradient must be a function of (t, x1, x2, ...) and applies to constraints on positions only")
    for what, one in (("function", function), ("gradient", gradient)):
        if one is not None:
            takes(element, what, one, f"t and {len(terms)} readings", 1 + len(terms))
    law = Law(element, function, gradient) if kind == "position" else RateLaw(element, function, None)
    start = [drawn(self, term) for term in terms]
    law(0.0, start, [0.0] * len(terms))
    law.compare(start)
    data = {"function": Function(law), "level": kind}
    arguments = {"function": function, "of": terms, "gradient": gradient, "level": kind, "word": str(word)}
    record = CouplingRecord(element.name, "function", str(word), tuple(terms), data, ("add_constraint", arguments))
    return _store(self, record)


def _element(mechanism: Drawing, name: str) -> Element:
    return name_of("coupling", name, mechanism._description.couplings)


def _positive(element: Element, what: str, value: Any) -> float:
    found = number(element, what, value, "m")
    if found <= 0.0:
        element.fail(f"{what} = {found:g} m must be positive")
    return found


def factor_units(units: list[str]) -> list[str]:
    """Units of factors that bring every term into the unit of the first."""
    return ["" if unit == units[0] else f"{units[0] or '1'}/{unit}" if unit else units[0] for unit in units]


def _recorded_as(mechanism: Drawing, made: Coupling, method: str, **arguments: Any) -> Coupling:
    """Record the method and the arguments by which it was given."""
    table = mechanism._description.couplings
    table[made.name] = replace(table[made.name], call=(method, arguments))
    return made


def _call_of(mechanism: Drawing, made: Coupling) -> Mapping[str, Any]:
    return mechanism._description.couplings[made.name].call[1]


def _which(mechanism: Drawing, made: Coupling) -> dict[str, Any]:
    """The coordinates of a pair, the second as the first term."""
    second, first = mechanism._description.couplings[made.name].terms
    return {"coordinate1": first["coordinate"], "coordinate2": second["coordinate"]}


def _terms(mechanism: Drawing, element: Element, terms: Any) -> list[dict[str, Any]]:
    if isinstance(terms, str | dict) or not isinstance(terms, Sequence):
        element.fail(f"terms must be a list of joints or measurements, not {terms!r}")
    if not terms:
        element.fail("it has no terms; name at least one joint or measurement")
    return [measure(mechanism, element, term) for term in terms]


def _store(mechanism: Drawing, record: CouplingRecord) -> Coupling:
    mechanism._description.store(mechanism._description.couplings, record)
    return Coupling(record.name, mechanism)
