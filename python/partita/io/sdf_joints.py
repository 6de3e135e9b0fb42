"""SDFormat: joints between links, coordinates that follow others, and gears."""

from __future__ import annotations

import numpy as np

from ..products import matmul, norm
from ..tolerance import EQUAL_IN_SIX_DIGITS
from .format_table import content
from .robot import Array, Effort, Joint, Tie, unit
from .sdf_scope import Scope
from .xmltree import Element, numbers

_KINDS = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "ball": "spherical",
    "universal": "universal",
    "fixed": "fixed",
    "screw": "screw",
}
GEARBOX = "gearbox"
"""Type of a joint that couples two hinges."""
_IN_MODEL = "use_parent_model_frame"


def add_joints(scope: Scope) -> None:
    """Add the joints of a model and of all models inside it; then what couples them."""
    moving = [(model, item) for model in scope.all() if not model.static for item in model.element.all("joint")]
    for model, item in moving:
        _joint(model, item)
    for model, item in moving:
        _mimic(model, item)
    for model, item in moving:
        if item.get("type") == GEARBOX:
            _gearbox(model, item)


def _joint(scope: Scope, item: Element) -> None:
    name, kind = scope.full(item.must("name")), item.must("type")
    if name in scope.made.joints:
        item.fail(f'has the name "{name}", which is already in use')
    if kind == GEARBOX:
        return
    if kind not in _KINDS:
        item.fail(f'has the type "{kind}"; known: {", ".join((*_KINDS, GEARBOX))}')
    ends = []
    for tag in ("parent", "child"):
        link = scope.carrier(scope.word(item, tag), item)
        if link not in scope.made.links and link != "world":
            item.fail(f"has a {tag} that is attached to no link")
        ends.append(link)
    if ends == ["world", "world"]:
        scope.note("dropped", item, "both of its ends are the ground", f'joint "{name}"', "other")
        return
    where = matmul(scope.at, scope.frame(scope.keys[id(item)], item))
    axes = [_axis(scope, item, tag, where) for tag in ("axis", "axis2") if item.first(tag) is not None]
    if not axes and _KINDS[kind] not in ("fixed", "spherical"):
        item.fail("holds no <axis>")
    if kind == "universal" and len(axes) != 2:
        item.fail("is universal and needs <axis> and <axis2>")
    axis = axes[0] if axes else np.array([1.0, 0.0, 0.0])
    made = Joint(name, _KINDS[kind], ends[0], ends[1], where, axis, item, second=axes[1] if len(axes) > 1 else None)
    if kind == "screw":
        advance, old = item.first("screw_thread_pitch"), item.first("thread_pitch")
        if advance is not None:
            made.pitch = numbers(advance, "the text", advance.text, 1)[0]
        elif old is not None:  # radians per metre, the other way round
            made.pitch = -2 * np.pi / (numbers(old, "the text", old.text, 1)[0] or old.fail("is 0"))
        else:
            item.fail("is a screw and needs <screw_thread_pitch>")
    for number, tag in enumerate(("axis", "axis2")):
        found = item.first(tag)
        if found is None:
            continue
        dynamics = found.first("dynamics")
        of = {x.tag: numbers(x, "the text", x.text, 1)[0] for x in (dynamics.children if dynamics else ())}
        if made.kind == "universal" or (number == 0 and made.kind in ("revolute", "prismatic")):
            called = f"spring of {name}" + (f" {tag}" if made.kind == "universal" else "")
            stiffness, damping = of.pop("spring_stiffness", 0.0), of.pop("damping", 0.0)
            law = Effort(stiffness, damping, of.pop("spring_reference", 0.0), number, called)
            made.efforts += [] if law.is_empty else [law]
        text = f"springs and dampers do not act along the coordinate of a {kind} joint: add_torsion_spring"
        if made.kind == "spherical":
            text = "a damper or spring would act about all axes of a ball, which are no coordinates: add_bushing"
        for key, value in of.items():
            if value != 0.0:
                scope.note("dropped", found, text, f'joint "{name}" {key} {value:g}')
    rotor = _values(item, "drake:rotor_inertia", "drake:gear_ratio")
    if inertia := rotor.get("drake:rotor_inertia", 0.0):
        if inertia < 0.0:
            item.fail(f"has a rotor of the inertia {inertia:g}; it must be 0 or more")
        ratio = rotor.get("drake:gear_ratio", 1.0)
        made.efforts += [Effort(rotor=inertia, ratio=ratio)] if ratio != 0.0 else []
        scope.note("used", item, f"a rotor of {inertia:g} turns {ratio:g} times as fast", f'joint "{name}"')
    scope.made.joints[name] = made


def _mimic(scope: Scope, item: Element) -> None:
    """A coordinate that follows another: multiplier x (the other - reference) + offset."""
    axis = item.first("axis")
    mimic = None if axis is None else axis.first("mimic")
    if mimic is None:
        return
    name, other = scope.full(item.must("name")), scope.full(mimic.must("joint"))
    for joint in (name, other):
        if joint not in scope.made.joints or scope.made.joints[joint].kind not in ("revolute", "prismatic"):
            mimic.fail(f'couples joint "{joint}", which does not have exactly one coordinate')
    if mimic.get("axis", "axis") != "axis":
        mimic.fail(f'follows the axis "{mimic.get("axis")}" of joint "{other}", which has one axis, "axis"')
    values = {"multiplier": 1.0, "offset": 0.0, "reference": 0.0}
    for tag in values:
        found = mimic.first(tag)
        if found is not None:
            values[tag] = numbers(found, "the text", found.text, 1)[0]
    factor, offset = values["multiplier"], values["offset"] - values["multiplier"] * values["reference"]
    if factor == 0.0:
        mimic.fail("has the multiplier 0; fix the joint instead")
    scope.made.ties.append(Tie(f"{name} follows {other}", [name, other], [1.0, -factor], offset, mimic))
    text = f"joint {name} = {factor:g} x {other} + {offset:g}, a coupler"
    scope.note("used", mimic, text)


def _gearbox(scope: Scope, item: Element) -> None:
    """theta_2 = -ratio theta_1: angles of parent and child from the reference body, about the two axes."""
    name, ratio = scope.full(item.must("name")), 1.0
    if (given := item.first("gearbox_ratio")) is not None:
        ratio = numbers(given, "the text", given.text, 1)[0] or given.fail("is 0; fix the joint instead")
    where = matmul(scope.at, scope.frame(scope.keys[id(item)], item))
    base = scope.carrier(scope.word(item, "gearbox_reference_body"), item)
    axes = [matmul(where[:3, :3], _axis(scope, item, tag, where)) for tag in ("axis", "axis2")]
    links = [scope.carrier(scope.word(item, end), item) for end in ("parent", "child")]
    hinges = [_hinge(scope, base, link, axis) for link, axis in zip(links, axes, strict=True)]
    if hinges[0] is None or hinges[1] is None:
        text = f'it would gear hinges on "{base}" about these axes, which are not there: add_gear, add_coupler'
        scope.note("dropped", item, text, content(item))
        return
    (first, one), (second, other) = hinges[0], hinges[1]
    scope.made.ties.append(Tie(name, [second, first], [other, ratio * one], 0.0, item))
    scope.note("used", item, f"a gear: {second} turns {-ratio * one * other:g} times as far as {first}")


def _hinge(scope: Scope, base: str, link: str, axis: Array) -> tuple[str, float] | None:
    """The hinge between two links about an axis, and 1 where its coordinate is the angle of the link, else -1."""
    for joint in scope.made.joints.values():
        about = matmul(joint.pose[:3, :3], joint.axis)
        along = float(matmul(about, axis))
        parallel = joint.kind == "revolute" and float(norm(np.cross(about, axis))) <= EQUAL_IN_SIX_DIGITS
        if parallel and (joint.parent, joint.child) in ((base, link), (link, base)):
            return joint.name, float(np.sign(along)) * (1.0 if joint.parent == base else -1.0)
    return None


def _values(item: Element, *tags: str) -> dict[str, float]:
    """Numbers of elements that are there."""
    return {x.tag: numbers(x, "the text", x.text, 1)[0] for x in item.all(*tags)}


def _axis(scope: Scope, item: Element, tag: str, where: Array) -> Array:
    """An axis in the joint's own frame."""
    found = item.the(tag).first("xyz")
    axis = np.array([0.0, 0.0, 1.0] if found is None else numbers(found, "the text", found.text, 3))
    other = "" if found is None else found.get("expressed_in")
    if scope.version < (1, 5) or (scope.version < (1, 7) and scope.flag(item.the(tag).first(_IN_MODEL), False)):
        other = "__model__"
    if other:
        axis = matmul(matmul(where[:3, :3].T, (matmul(scope.at, scope.frame(other, item)))[:3, :3]), axis)
    direction = unit(axis)
    return direction if direction is not None else item.fail("has an axis of length 0")
