"""Joints that a run parts: which they are, the model of such a run, and its states."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import ArrayLike

from ..builder.checks import Element
from ..builder.compiled import CompiledModel, compile_description
from ..builder.joints import joint_record, motions
from ..builder.measures import Along, Coordinate, Cosine, Distance
from ..builder.records import Joint, JointRecord
from ..errors import ArgumentError
from ..events import Action, Lock, Release, listed
from ..numeric import is_list, shown
from ..options import COORDINATES
from ..state import Layout, State
from ..tolerance import EQUAL_IN_SIX_DIGITS
from .models import Modelled, changed, compile
from .set_valued import is_latch, latch_of

_FREE = 6
"""Directions in which a joint moves that constrains nothing."""
_ACTING = {"forces": "load", "drives": "drive", "couplings": "coupling", "rotors": "rotor"}
"""Tables of a description whose elements may act along a joint, and their words."""


def parting(
    mechanism: Modelled, events: Iterable[Any] | None, locked: Iterable[Any] = (), parted: Iterable[Any] = ()
) -> dict[str, str]:
    """Joints that are `parted` at the start or that events part: those that are released and that nothing locks. Each
    with who asks for it, in words.

    Raises a `DescriptionError` where something acts along a coordinate of one of them.
    """
    found = listed(events)
    at_start = [lock_of(given) for given in joints_of("locked", locked)]
    locks = {named_joint(mechanism, "locked", x.joint).name for x in at_start if not is_measure(x.joint)}
    asked: dict[str, Element] = {}
    for name in parted_at_start(mechanism, parted):
        if name in locks:
            raise ArgumentError(f"the joint {name!r} is both locked and parted; give one", argument="parted")
        asked[name] = Element("argument", "parted")
    done = [(event, action) for event in found for action in event.then]
    own = [(event, x) for event, x in done if isinstance(x, Lock)]
    locks |= {named_joint(mechanism, event.name, x.joint).name for event, x in own if not is_measure(x.joint)}
    named = {x.name for x in [*at_start, *(x for _, x in own)]} - {None}
    locks |= {x["joint"] for x in mechanism._description.forces.values() if is_latch(x)}
    if any(not isinstance(action, Action) for _, action in done):
        locks |= set(mechanism._description.joints)  # a function may lock any of them
    for event, action in done:
        if not isinstance(action, Release) or latch_of(mechanism, action.joint) is not None:
            continue
        if is_measure(action.joint) or (isinstance(action.joint, str) and action.joint in named):
            continue
        if (name := named_joint(mechanism, event.name, action.joint).name) not in locks:
            asked.setdefault(name, Element("event", event.name))
    for name, element in asked.items():
        _can_part(mechanism, element, name)
    return {name: f'{element.kind} "{element.name}"' for name, element in asked.items()}


def parted_at_start(mechanism: Modelled, parted: Iterable[Any]) -> list[str]:
    """Names of the joints that are parted at the start."""
    return [named_joint(mechanism, "parted", joint).name for joint in joints_of("parted", parted)]


def _can_part(mechanism: Modelled, element: Element, joint: str) -> None:
    """Refuse to part a joint that constrains nothing, or along whose coordinates something acts."""
    if len(motions(mechanism._description.joints[joint])) == _FREE:
        element.fail(f'it parts the joint "{joint}", which constrains nothing')
    data = json.loads(compile(mechanism).description)
    acting = [
        f'{word} "{item["name"]}"'
        for table, word in _ACTING.items()
        for item in data.get(table, ())
        if joint in (item.get("joint"), *_measured(item.get("measure")), *_measured(item.get("terms")))
    ]
    if acting:
        element.fail(
            f'it parts the joint "{joint}", but {", ".join(acting)} would go on acting along it; let these act between '
            "points of its bodies instead, or, if a lock is to end, lock the joint before (pt.Lock, locked=)"
        )


def _measured(data: Any) -> list[str]:
    """The joints of a measure, or of a list of measures."""
    found = data if isinstance(data, list) else [data]
    return [item["joint"] for item in found if isinstance(item, Mapping) and "joint" in item]


def named_joint(mechanism: Modelled, asker: str, joint: Any) -> JointRecord:
    return joint_record(mechanism, Element("event", asker), joint)


def is_measure(given: Any) -> TypeGuard[Distance | Along | Cosine]:
    """Whether it is measured between bodies."""
    return isinstance(given, Distance | Along | Cosine)


def lock_of(given: Any) -> Lock:
    """What is locked at the start: a joint, a coordinate, a measure, or a lock."""
    lock = given if isinstance(given, Lock) else Lock(given)
    if isinstance(lock.joint, Coordinate) and lock.coordinate is None:
        return Lock(lock.joint.joint, lock.joint.coordinate, lock.name)
    return lock


def joints_of(argument: str, given: Any) -> list[Any]:
    if isinstance(given, str | Joint | Lock | Coordinate | Distance | Along | Cosine):
        return [given]
    if not is_list(given):
        raise ArgumentError(f"{argument} must be a list of joints, not {shown(given)}", argument=argument)
    return list(given)


def layout_that_parts(
    mechanism: Modelled, coordinates: str, parameters: Mapping[str, ArrayLike] | None, joints: Sequence[str]
) -> tuple[CompiledModel, Layout]:
    """As `layout_of`, of the mechanism from which a run can part these joints: they are not in its tree."""
    made = compile_description(mechanism._description.copy(), coordinates, joints)
    return changed(*made, parameters)


def of_parting_run(
    mechanism: Modelled,
    state: Any,
    model: CompiledModel,
    parameters: Mapping[str, ArrayLike] | None,
    apart: Sequence[str] = (),
) -> State | None:
    """A state of a run that could part joints, in the coordinates of this model, where the joints `apart` may be open;
    None for anything else.

    Raises an `ArgumentError` where another joint is open.
    """
    parts = state._layout.parting if isinstance(state, State) else ()
    if not parts or not set(parts) <= set(mechanism._description.joints):
        return None
    sources = (layout_that_parts(mechanism, c, parameters, parts)[0] for c in COORDINATES)
    source = next((source for source in sources if state.is_of(source.summary)), None)
    if source is None:
        return None
    points = source.core.motion(np.array([state.t]), state.q[None], state.v[None]).joints()["joint_point"][0]
    size = float(np.ptp(points, axis=0).max(initial=0.0))
    off = np.abs(source.core.constraints(state.t, state.q))
    for row, name in enumerate(source.summary["rows_names"]):
        joint, _, part = name.rpartition(".") if name not in parts else (name, "", "")
        largest = EQUAL_IN_SIX_DIGITS * (1.0 if part.startswith("turn") else size)
        if joint in parts and joint not in apart and off[row] > largest:
            raise ArgumentError(
                f"the joint {joint!r} is apart in this state, by {off[row]:.3g}; go on with parted=[{joint!r}], or "
                "take a state from before",
                argument="initial",
            )
    return moved(state, source, model)


def moved(state: State, source: CompiledModel, model: CompiledModel) -> State:
    """A state of one model in the coordinates of another one."""
    q, v = model.core.transferred(source.core, state.q, state.v)
    return State(state.t, q, v, layout=model._laid_out(Layout(model.summary)))
