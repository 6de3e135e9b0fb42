"""One mechanism said otherwise: in another frame, in other units, in another order, its joints drawn from child to parent."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from oracle.chance import rotation
from oracle.drawing import GROUND, Drawing, Joint, Load, Spring

import partita as pt

Array = Any
SAID = ("turned", "shifted", "millimetres", "kilometres and tonnes", "reversed", "swapped", "named anew")
"""Ways of saying it."""


def of(m: pt.Mechanism) -> Drawing:
    """The drawing of a mechanism of bodies, revolutes, slides, cylindrical, ball and universal joints, without forces."""
    from oracle.drawing import Body

    spec = m.to_spec()
    bodies = tuple(
        Body(b["name"], b["mass"], *(np.array(b[key]) for key in ("inertia", "com", "position", "orientation")))
        for b in spec["bodies"]
    )
    joints = []
    for j in spec["joints"]:
        axes = np.array([j[key] for key in ("axis", "axis2") if key in j] or [[0.0, 0.0, 1.0]]).T
        other = {key: np.array(j[key]) for key in ("child_point", "child_axis") if j.get(key) is not None}
        joints.append(Joint(j["name"], j["kind"], j["parent"], j["child"], np.array(j["point"]), axes, **other))
    return Drawing(np.array(spec["gravity"]), bodies, tuple(joints), words=m.name)


def turned(d: Drawing, rng: Any) -> Drawing:
    """The whole mechanism turned, gravity included."""
    return d.turned(rotation(rng))


def shifted(d: Drawing, rng: Any) -> Drawing:
    """The whole mechanism elsewhere, by three of its sizes."""
    by = 3.0 * d.size * rng.normal(size=3)

    def there(x: Array | None) -> Array | None:
        return None if x is None else x + by

    def force(f: Any) -> Any:
        if isinstance(f, Spring):
            ends = {f"point{i}": getattr(f, f"point{i}") + by for i in "12" if getattr(f, f"body{i}") == GROUND}
            return replace(f, **ends)
        return f

    bodies = tuple(replace(b, position=b.position + by) for b in d.bodies)
    joints = tuple(replace(j, point=j.point + by, child_point=there(j.child_point)) for j in d.joints)
    return replace(d, bodies=bodies, joints=joints, forces=tuple(map(force, d.forces)))


def reversed_(d: Drawing, _: Any) -> Drawing:
    """Bodies, joints and forces in the other order."""
    return replace(d, bodies=d.bodies[::-1], joints=d.joints[::-1], forces=d.forces[::-1])


def swapped(d: Drawing, _: Any) -> Drawing:
    """Parents and children of joints swapped, where their coordinates mean the same but for the sign and nothing acts on
    them: revolutes, slides, balls."""
    acted = {getattr(x, "joint", None) for x in (*d.forces, *d.drives)}

    def other(j: Joint) -> Joint:
        if j.kind not in ("revolute", "prismatic", "spherical", "fixed", "cylindrical") or j.name in acted:
            return j
        new = replace(j, parent=j.child, child=j.parent)
        if j.child_point is not None:
            new = replace(new, point=j.child_point, child_point=j.point)
        if j.child_axis is not None:
            axes = np.array(j.axes)
            axes[:, 0] = j.child_axis
            new = replace(new, axes=axes, child_axis=np.asarray(j.axes)[:, 0])
        return new

    return replace(d, joints=tuple(map(other, d.joints)))


def named_anew(d: Drawing, _: Any) -> Drawing:
    """Names whose alphabetical order is the other way round."""
    bodies = {b.name: f"z{len(d.bodies) - i:03d}" for i, b in enumerate(d.bodies)} | {GROUND: GROUND}
    joints = {j.name: f"w{len(d.joints) - i:03d}" for i, j in enumerate(d.joints)}

    def force(f: Any) -> Any:
        if isinstance(f, Spring):
            return replace(f, body1=bodies[f.body1], body2=bodies[f.body2])
        if isinstance(f, Load):
            return replace(f, body=bodies[f.body])
        return replace(f, joint=joints[f.joint])

    return replace(
        d,
        bodies=tuple(replace(b, name=bodies[b.name]) for b in d.bodies),
        joints=tuple(replace(j, name=joints[j.name], parent=bodies[j.parent], child=bodies[j.child]) for j in d.joints),
        forces=tuple(map(force, d.forces)),
        drives=tuple(replace(x, joint=joints[x.joint]) for x in d.drives),
    )


def said(d: Drawing, how: str, rng: Any) -> Drawing:
    """The drawing in one of the ways `SAID`; bodies and joints keep their order but in "reversed"."""
    if how == "millimetres":
        return d.scaled(1e3, 1.0, 1.0)
    if how == "kilometres and tonnes":
        return d.scaled(1e-3, 1e-3, 1.0)
    ways = {"turned": turned, "shifted": shifted, "reversed": reversed_, "swapped": swapped, "named anew": named_anew}
    return ways[how](d, rng)


def verdicts(m: pt.Mechanism, d: Drawing, back: bool, coordinates: str = "relative") -> dict[str, Any]:
    """Everything that is said of a mechanism and depends on no words; `back`: in the order of the drawing reversed."""
    report = m.report(coordinates=coordinates).to_dict()
    of_joint = {x["joint"]: x["determined"] for x in report["reactions"]}
    order = [j.name for j in d.joints][:: -1 if back else 1]
    singular = report["singular"]
    found = {key: report[key] for key in ("mobility", "freedoms", "joint_rows", "joint_rank", "gruebler")}
    found |= {
        "redundant": len(report["redundant"]),
        "determined": [freely(of_joint[name], kind) for name, kind in zip(order, kinds(d, back), strict=True)],
        "misfit": report["misfit"],
        "misfits": len(report["misfits"]),
        "suspicious": len(report["suspicious"]),
        "singular": singular and tuple(singular[key] for key in ("here", "beside", "structure", "many")),
        "idle": len(report["idle"]),
    }
    if coordinates == "relative":
        names = {x["name"].split(".")[0]: x["rho"] for x in report["coordinates"]}
        found["rho"] = names
    return found


def kinds(d: Drawing, back: bool) -> list[str]:
    return [j.kind for j in d.joints][:: -1 if back else 1]


def freely(flags: list[bool], kind: str) -> tuple[Any, ...]:
    """The flags of a joint in its axes as far as the axes are its own: across the axis of a turn any two will do."""
    if kind in ("revolute", "cylindrical", "prismatic"):
        return flags[2], flags[5], sum(flags[:2]) == 2, sum(flags[3:5]) == 2
    return (all(flags[:3]), all(flags[3:]))
