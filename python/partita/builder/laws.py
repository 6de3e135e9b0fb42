"""Force laws: a Python function of selected points, joints and bodies."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..errors import EvaluationError
from ..numeric import is_list, shown
from ..state import Layout
from .bodies import resolve
from .checks import Array, Element, find, name_of, takes
from .drawing import Drawing
from .forces import store
from .joints import joint_record, scalars
from .points import point_on
from .records import GROUND, Body, Force, Joint, LoadRecord, Point, Ref
from .travelling import check_picklable
from .values import Function, finite, one_number


class PointView(NamedTuple):
    """A point of a body as read by a law, in world axes."""

    position: Array
    """(3,) [m]."""
    velocity: Array
    """(3,) [m/s]."""


class BodyView(NamedTuple):
    """A body as read by a law, in world axes."""

    position: Array
    """Of its origin (3,) [m]."""
    rotation: Array
    """Body axes as columns (3, 3)."""
    velocity: Array
    """Of its origin (3,) [m/s]."""
    angular_velocity: Array
    """(3,) [rad/s]."""


class JointView(NamedTuple):
    """A joint as read by a law: floats where it has one coordinate, else arrays."""

    position: Any
    """[rad] or [m]."""
    rate: Any
    """[rad/s] or [m/s]."""


Sight = tuple[str, int]
"""Kind of a reading ("point", "body" or "joint") and its number of coordinates."""

_SIZES = {"point": 6, "body": 18}
_TABLES = {"body": "bodies", "joint": "joints"}


def add_force_law(
    self: Drawing,
    name: str,
    function: Callable[..., Any],
    *,
    on: Sequence[Any],
    sees: Sequence[Any] = (),
) -> Force:
    """Add forces and moments computed by a function of selected readings.

    The function is called as f(t, *seen), with one argument for each entry of `sees`:

    - (body, point), the point in body axes: has `.position` and `.velocity`;
    - a body: has `.position`, `.rotation`, `.velocity` and `.angular_velocity`;
    - a joint: has `.position` and `.rate`, numbers if it has one coordinate, else arrays. The angle of a joint that
      closes a loop in space (or in absolute coordinates) is known up to full turns, between -pi and pi: near half a
      turn a function that is not the same a turn further on ends the run.

    It returns, for each entry of `on`, the force (three numbers) or the pair (force, moment); with a single entry, just
    that one. All quantities are in world axes [m, N, N m], whatever the coordinates of the mechanism. Its power counts
    as work. Prefer `add_spring` and similar methods where they are equivalent: a function is by far the most expensive
    part of an evaluation, and its derivatives are computed by differences.

    Args:
        name: unique among the forces.
        function: f(t, *seen); its result must depend only on its arguments.
        on: bodies (the force acts at the centre of mass) and pairs (body, point in body axes); not the ground.
        sees: what the function reads; handles, or names that are not shared by a body and a joint.

    >>> import numpy as np
    >>> import partita as pt
    >>> m = pt.Mechanism("kite")
    >>> kite = m.add_body("kite", mass=0.3, inertia=(0.02, 0.02, 0.04))
    >>> def drag(t, kite):
    ...     wind = np.array([8.0, 0.0, 0.0]) - kite.velocity
    ...     return 0.05 * np.linalg.norm(wind) * wind
    >>> m.add_force_law("air", drag, sees=[kite], on=[kite]).name
    'air'
    """
    element = name_of("force", name, self._description.forces)
    if not callable(function):
        element.fail(f"function must be a function f(t, *seen), not {shown(function)}")
    on, sees = _items(element, "on", on), _items(element, "sees", sees)
    seen, sights, asked = list[dict[str, Any]](), list[Sight](), list[Any]()
    for i, item in enumerate(sees):
        kind, means = _sight(self, element, f"sees[{i}]", item)
        sights.append((kind, len(means)))
        seen += means
        point = means[0].get("point")
        asked.append((point["body"], point["point"]) if point else Ref(_TABLES[kind], str(item)))
    spots = [_spot(self, element, f"on[{i}]", item) for i, item in enumerate(on)]
    if not spots:
        element.fail("it acts on nothing; name a body, or a pair (body, point), in `on`")
    own = [_is_pair(item) and item[1] is not None for item in on]
    pushed = [
        (spot["body"], spot["point"]) if given else Ref("bodies", spot["body"])
        for spot, given in zip(spots, own, strict=True)
    ]
    takes(element, "function", function, f"t and the {len(sees)} things seen", 1 + len(sees))
    call = Function(LawCall(element, function, sights, len(spots)))
    arguments = {"value": call, "on": pushed, "sees": asked}
    return store(self, LoadRecord(name, "law", arguments, {"value": call, "sees": seen, "on": spots}))


def _items(element: Element, what: str, value: Any) -> list[Any]:
    if isinstance(value, dict) or not is_list(value):
        element.fail(f"{what} must be a list, not {shown(value)}")
    return list(value)


def _is_pair(item: Any) -> bool:
    return isinstance(item, tuple | list) and len(item) == 2 and isinstance(item[0], str | Body)


def _pair(item: Any) -> tuple[Any, Any]:
    """The body, and the point on it."""
    return item[0], item if isinstance(item, Point) else item[1]


def _spot(mechanism: Drawing, element: Element, what: str, item: Any) -> dict[str, Any]:
    """A point of a body at which a force can act."""
    body, point = _pair(item) if _is_pair(item) else (item, None)
    name = resolve(mechanism, element, what, body, ground=False)
    record = mechanism._description.bodies[name]
    return {
        "body": name,
        "point": record.com.copy() if point is None else point_on(mechanism, element, f"{what} point", point, name),
    }


def _sight(mechanism: Drawing, element: Element, what: str, item: Any) -> tuple[str, list[dict[str, Any]]]:
    """The arguments of the function, and their form for the core."""
    if _is_pair(item):
        body, point = _pair(item)
        name = resolve(mechanism, element, what, body)
        return "point", [{"point": {"body": name, "point": point_on(mechanism, element, f"{what} point", point, name)}}]
    d = mechanism._description
    if isinstance(item, Joint) or (isinstance(item, str) and item in d.joints):
        if isinstance(item, str) and item in d.bodies:
            element.fail(f'{what} is "{item}", which names a body and a joint; give the handle of one of them')
        record = joint_record(mechanism, element, item)
        count = scalars(record)
        if count == 0:
            element.fail(
                f'{what}: the {record.kind} joint "{record.name}" has no translation or angle to read; read its '
                "bodies instead"
            )
        return "joint", [{"joint": [record.name, i]} for i in range(count)]
    if isinstance(item, str):
        find("body or joint", item, [*d.bodies, *d.joints], GROUND, where=f'force "{element.name}": {what}: ')
    return "body", [{"body": resolve(mechanism, element, what, item)}]


class LawCall:
    """A user's law with the element it belongs to, not yet bound to a compiled model."""

    def __init__(self, element: Element, function: Callable[..., Any], sights: list[Sight], count: int) -> None:
        self.element, self.function, self.sights, self.count = element, function, sights, count
        self.notes: list[str] = []

    def bind(self, layout: Layout) -> Callable[[float, Array], Any]:
        """The function as the core calls it: all readings in one array, all wrenches in another."""

        def call(t: float, seen: Array) -> Array:
            return self._wrenches(t, self.function(t, *self._views(seen)))

        return call

    def __getstate__(self) -> dict[str, Any]:
        check_picklable(self.element, "function", self.function)
        return self.__dict__

    def __deepcopy__(self, memo: dict[int, Any]) -> LawCall:
        """With the same function: Python copies functions as themselves."""
        return LawCall(self.element, self.function, self.sights, self.count)

    def _views(self, seen: Array) -> list[Any]:
        views: list[Any] = []
        at = 0
        for kind, count in self.sights:
            size = _SIZES.get(kind, 2 * count)
            x = seen[at : at + size]
            at += size
            if kind == "point":
                views.append(PointView(x[:3], x[3:]))
            elif kind == "body":
                views.append(BodyView(x[:3], x[3:12].reshape(3, 3), x[12:15], x[15:]))
            else:
                views.append(JointView(float(x[0]), float(x[1])) if count == 1 else JointView(x[::2], x[1::2]))
        return views

    def _wrenches(self, t: float, value: Any) -> Array:
        """Three forces and three moments for each point, one after the other."""
        try:
            parts = [value] if self.count == 1 else list(value)
            if len(parts) != self.count:
                raise TypeError(f"{len(parts)} entries for {self.count} points")
            numbers = [x for part in parts for x in _wrench(part)]
        except TypeError as error:
            wanted = "a force, or (force, moment)" if self.count == 1 else "one for each of its points"
            raise self._error(t, f"the function must return {wanted}, three numbers each, not {error}") from error
        if not finite(numbers):
            raise self._error(t, f"the function returned {shown(value)}")
        return np.array(numbers)

    def _error(self, t: float, sentence: str) -> EvaluationError:
        name = self.element.name
        return EvaluationError(f'{self.element.kind} "{name}" at t = {t:g} s: {sentence}', t=t, where=name)


def _wrench(value: ArrayLike) -> list[float]:
    """Force and moment as six numbers."""
    items: list[Any] = list(value)  # type: ignore[arg-type]
    pair = items if len(items) == 2 else [items, (0.0, 0.0, 0.0)]
    numbers = [[one_number(x) for x in part] for part in pair]
    if any(len(part) != 3 for part in numbers):
        raise TypeError(f"{shown(value)}")
    return [*numbers[0], *numbers[1]]
