"""USD physics: what acts along the coordinates of joints: drives, and the springs, dampers and rotors of PhysX, Newton
and MuJoCo.

Newton's numbers are per degree; those of MuJoCo per radian, but for angles, whose unit its scene states. A number of
the one precedes that of the next: Newton, PhysX, MuJoCo.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..tolerance import EQUAL_IN_SIX_DIGITS
from .robot import Effort
from .usd_bodies import Bodies
from .usd_joints import Kind
from .usd_stage import Prim
from .usd_table import ACCELERATION, AXES, OWN

_ARMATURES = ("newton:armature", "physxJoint:armature", "mjc:armature")
_PASSIVE = ("newton:damping", "mjc:damping", "mjc:stiffness")
_BALL = "a rotor, damper or spring would act about all axes of rotation, which are no coordinates here: add_bushing"
_PER_RADIAN = 180.0 / np.pi


def turns(axis: str) -> bool:
    """Whether a drive acts about an axis."""
    return axis.startswith("rot") or axis == "angular"


class Efforts(Bodies):
    """Bodies, and what acts along the coordinates of their joints."""

    def efforts(self, prim: Prim, name: str, kind: Kind, drawn: dict[str, float]) -> list[Effort]:
        """Springs, dampers and rotors along the coordinates of a joint."""
        found: list[Effort] = []
        several = len(kind.coordinates) > 1
        for axis in (*AXES, "angular", "linear"):
            acts = prim.has(f"PhysicsDriveAPI:{axis}")
            if axis not in kind.coordinates:
                if acts:
                    words = "a drive would act along a direction that is not a coordinate of this joint"
                    self.remark(prim, words, f"drive {axis}")
                continue
            own, along = kind.coordinates[axis], f" {axis}" if several else ""
            effort = (self.drive(prim, axis, drawn.get(axis, 0.0)) if acts else None) or Effort()
            effort = replace(effort, coordinate=own, rotor=self.rotor(prim, axis))
            passive = replace(self.passive(prim, axis, drawn.get(axis, 0.0)), coordinate=own)
            if effort.stiffness == effort.damping == 0.0:
                effort, passive = replace(passive, rotor=effort.rotor, constant=effort.constant), Effort()
            found += [] if effort.is_empty else [replace(effort, name=f"spring of {name}{along}" if several else "")]
            found += [] if passive.is_empty else [replace(passive, name=f"passive spring of {name}{along}")]
        if len([word for word in kind.free if len(word) == 2]) > sum(map(turns, kind.coordinates)):
            given = [key for key in (*_ARMATURES, *_PASSIVE) if prim.real(key, 0.0) != 0.0]
            if given:
                self.remark(prim, _BALL, ", ".join(f"{key} {prim.get(key)}" for key in given))
        return found

    def unit(self, axis: str) -> float:
        """Of an inertia along a coordinate, and so of stiffness and damping there, per radian."""
        return self.mass * (self.length**2 if turns(axis) else 1.0)

    def rotor(self, prim: Prim, axis: str) -> float:
        """The inertia of what turns with a coordinate."""
        given = [(key, prim.real(key, 0.0)) for key in _ARMATURES if prim.value(key) is not None]
        found = given[0][1] * self.unit(axis) if given else 0.0
        if any(value != given[0][1] for _, value in given):
            words = "programs would take different inertias of rotors; the first of these is used"
            self.remark(prim, words, ", ".join(f"{key} {value:g}" for key, value in given), "changed")
        beside = f"{OWN}:{axis}:rotor"
        if not prim.has(beside):
            return found
        exact = prim.real(beside, 0.0)
        same = not (given or prim.has("PhysxJointAPI")) or bool(np.float32(exact) == np.float32(found))
        return float(self.agreed(prim, beside, exact, found, same))

    def passive(self, prim: Prim, axis: str, drawn: float) -> Effort:
        """The spring and the damper of a joint itself, by Newton or MuJoCo."""
        unit, turn = self.unit(axis), turns(axis)
        damping = unit * prim.real("mjc:damping", 0.0)
        if prim.value("newton:damping") is not None:
            damping = unit * prim.real("newton:damping", 0.0) * (_PER_RADIAN if turn else 1.0)
        stiffness = unit * prim.real("mjc:stiffness", 0.0)
        scale = self.length if not turn else 1.0 if self.settings("mjc:compiler:angle") == "radian" else 1 / _PER_RADIAN
        rest = scale * (prim.real("mjc:springref", 0.0) - prim.real("mjc:ref", 0.0)) - drawn
        stiffness *= self.settings("mjc:flag:spring") not in (False, 0)
        damping *= self.settings("mjc:flag:damper") not in (False, 0)
        return Effort(stiffness, damping, rest if stiffness != 0.0 else 0.0)

    def drive(self, prim: Prim, axis: str, drawn: float) -> Effort | None:
        """A drive: stiffness (target - x) + damping (target rate - rate)."""

        def read(key: str) -> float:
            return float(prim.finite(f"drive:{axis}:physics:{key}", (0.0,))[0])

        stiffness, damping, target, rate = map(read, ("stiffness", "damping", "targetPosition", "targetVelocity"))
        kind = str(prim.value(f"drive:{axis}:physics:type") or "force")
        law = f"drive {axis}: stiffness {stiffness:g}, damping {damping:g}, target {target:g}, rate {rate:g}"
        if stiffness == 0.0 and damping == 0.0:
            return None
        if kind != "force":
            self.remark(prim, ACCELERATION, f"{law}, type {kind}")
            return None
        turn = turns(axis)
        per = self.unit(axis) * (_PER_RADIAN if turn else 1.0)
        unit = np.pi / 180.0 if turn else self.length
        found = (per * stiffness, per * damping, unit * target)
        words = [f"{OWN}:{axis}:{word}" for word in ("stiffness", "damping", "rest")]
        stiffness, damping, target = (
            float(
                self.agreed(
                    prim,
                    word,
                    exact,
                    value,
                    abs(exact - value) <= EQUAL_IN_SIX_DIGITS * (unit + abs(value)),
                )
            )
            for word, value in zip(words, found, strict=True)
            for exact in (float(prim.finite(word, (value,))[0]),)
        )
        target, torque = target - drawn, damping * unit * rate
        if stiffness != 0.0:
            return Effort(stiffness, damping, target + torque / stiffness)
        return Effort(0.0, damping, 0.0, constant=torque)
