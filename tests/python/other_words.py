"""One mechanism said otherwise: in another frame, in other units, in another order, joints from child to parent.

`python -m other_words 60 600` asks it of mechanisms drawn by chance, those whose bodies have an extent.
"""

from __future__ import annotations

import sys
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
from oracle import chance
from oracle.drawing import GROUND, Body, Drawing, Joint, Load, Spring

import partita as pt
from partita.errors import PartitaError, SuspectResultWarning

Array = Any
REWRITTEN = ("turned", "shifted", "millimetres", "kilometres and tonnes", "reversed", "swapped", "named anew")
"""Ways of saying it."""


def of(m: pt.Mechanism) -> Drawing:
    """The drawing of bodies, revolutes, slides, cylindrical, ball and universal joints, without forces."""
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
    return d.turned(chance.rotation(rng))


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
    """Parents and children swapped of joints whose coordinates mean the same but for the sign, and where nothing acts
    along them."""
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


def rewritten(d: Drawing, how: str, rng: Any) -> Drawing:
    """The drawing in one of the ways `SAID`; bodies and joints keep their order but in "reversed"."""
    if how == "millimetres":
        return d.scaled(1e3, 1.0, 1.0)
    if how == "kilometres and tonnes":
        return d.scaled(1e-3, 1e-3, 1.0)
    changes = {
        "turned": turned,
        "shifted": shifted,
        "reversed": reversed_,
        "swapped": swapped,
        "named anew": named_anew,
    }
    return changes[how](d, rng)


def verdicts(m: pt.Mechanism, d: Drawing, back: bool, coordinates: str = "relative") -> dict[str, Any]:
    """Everything that is said of a mechanism and depends on no words; `back`: in the order of the drawing reversed."""
    report = m.report(coordinates=coordinates).to_dict()
    of_joint = {x["joint"]: x["determined"] for x in report["reactions"]}
    order = [j.name for j in d.joints][:: -1 if back else 1]
    singular = report["singular"]
    found = {key: report[key] for key in ("mobility", "degrees_of_freedom", "joint_rows", "joint_rank", "gruebler")}
    found |= {
        "redundant": len(report["redundant"]),
        "determined": [freely(of_joint[name], kind) for name, kind in zip(order, kinds(d, back), strict=True)],
        "components": [tuple(of_joint[name]) for name in order],
        "geometric_error": report["geometric_error"],
        "geometric_errors": len(report["geometric_errors"]),
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
    """The flags of a joint as far as parent and child agree on its axes: across the axis of a turn each has two of its
    own."""
    if kind in ("revolute", "cylindrical", "prismatic"):
        return flags[2], flags[5], sum(flags[:2]) == 2, sum(flags[3:5]) == 2
    return (all(flags[:3]), all(flags[3:]))


def by_chance(seed: int) -> Drawing:
    """A mechanism drawn by chance, without forces; all bodies have an extent: masses hide no geometry."""
    d = replace(chance.mechanism(seed), forces=())
    thick = [replace(b, inertia=b.inertia + 0.01 * b.mass * d.size**2 * np.eye(3)) for b in d.bodies]
    return replace(d, bodies=tuple(thick))


def same(a: Any, b: Any, what: str) -> bool:
    """The opening over a short motion is measured to a percent: how far it goes depends on where coordinates point."""
    if what == "geometric_error":
        return abs(a - b) <= 2e-2 * max(a, b) + 1e-12
    return bool(a == b)


def differences(d: Drawing, seed: int) -> list[str]:
    """What is said differently, in each of the ways `SAID` and between the two kinds of coordinates; rho aside."""

    def answered(x: Drawing, back: bool, coordinates: str = "relative") -> dict[str, Any]:
        try:
            return verdicts(x.build(), x, back, coordinates)
        except PartitaError as error:
            return {"refused": type(error).__name__}

    rng, known, found = np.random.default_rng(seed), answered(d, False), []
    for how in (*REWRITTEN, "by bodies"):
        other = d if how == "by bodies" else rewritten(d, how, rng)
        now = answered(other, how == "reversed", "absolute" if how == "by bodies" else "relative")
        # the axes of a joint are laid by its parent
        aside = {"rho", "components"} if how == "swapped" else {"rho"}
        for key in sorted((known.keys() | now.keys()) - aside):
            if not same(known.get(key), now.get(key), key if key in known and key in now else ""):
                found.append(f"{how}: {key} {known.get(key)}, then {now.get(key)}")
    return found


def main(first: int, last: int) -> int:
    """Print what differs; 1 if anything does."""
    warnings.simplefilter("ignore", SuspectResultWarning)
    bad = 0
    for seed in range(first, last):
        for words in differences(by_chance(seed), seed):
            print(f"{seed}: {words}", flush=True)
            bad += 1
    print(f"{last - first} mechanisms, {bad} differences")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), int(sys.argv[2])))
