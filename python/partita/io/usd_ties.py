"""USD physics: joints that follow others, by the schemas of PhysX, Newton and MuJoCo; actuators and tendons."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..tolerance import EQUAL_IN_SIX_DIGITS, LONG_ROUNDING
from .mjcf_table import HIGHER, MOTOR, ROPE, SERVO, TENDON
from .robot import Tie
from .usd_efforts import Efforts
from .usd_joints import Kind
from .usd_stage import Prim
from .usd_table import AXES, OWN

_FOLLOWS = "it would follow another joint: add_coupler"
_SINGLE = ("revolute", "prismatic")


class Known(NamedTuple):
    """A joint that was read: its name, its prim, and of which kind it is, as drawn."""

    name: str
    prim: Prim
    kind: Kind

    @property
    def drawn(self) -> float:
        """Its one coordinate where it is drawn."""
        return sum(dict(self.kind.drawn).values())


class Ties(Efforts):
    """Bodies, and joints that follow each other."""

    known: dict[str, Known]
    """Joints by the paths of their prims."""

    def tie(self, one: Known) -> None:
        """Couple a joint to those that it follows."""
        self.mimic(one)
        self.follow(one)

    def leader(self, prim: Prim, *keys: str) -> tuple[Known | None, str]:
        """The joint that a relationship names, and the words for it."""
        targets: list[str] = next((found for key in keys if (found := prim.value(key))), [])
        return (self.known.get(targets[0]) if len(targets) == 1 else None), ", ".join(targets) or "nothing"

    def mimic(self, one: Known) -> None:
        """By PhysX: coordinate + gearing x the other's + offset = 0, in degrees."""
        name, prim, kind = one
        for axis in AXES[3:]:
            if not prim.has(f"PhysxMimicJointAPI:{axis}"):
                continue
            key = f"physxMimicJoint:{axis}"
            gearing, offset = (
                float(prim.finite(f"{key}:{word}", (x,))[0]) for word, x in (("gearing", 1.0), ("offset", 0.0))
            )
            other, called = self.leader(prim, f"{key}:referenceJoint")
            law = f"{axis}: gearing {gearing:g}, offset {offset:g}, to {called}"
            if other is None or kind.word != "revolute" or other.kind.word != "revolute":
                self.remark(prim, _FOLLOWS, law)
                continue
            ours = f"{OWN}:{axis}"
            turn = -np.radians(offset)
            for word, value in (("gearing", gearing), ("offset", -turn)):
                exact = float(prim.finite(f"{ours}:{word}", (value,))[0])
                same = bool(np.isclose(exact, value, rtol=EQUAL_IN_SIX_DIGITS, atol=LONG_ROUNDING))
                value = float(self.agreed(prim, f"{ours}:{word}", exact, value, same))
                gearing, turn = (value, turn) if word == "gearing" else (gearing, -value)
            title = str(prim.value(f"{ours}:name") or f"{name} mimic")
            rest = turn - one.drawn - gearing * other.drawn
            self.made.ties.append(Tie(title, [name, other.name], [1.0, gearing], rest, prim))

    def follow(self, one: Known) -> None:
        """By Newton, or by an equality of MuJoCo: coordinate = coefficient 0 + coefficient 1 x the other's + ..."""
        name, prim, kind = one
        equality = prim.has("MjcEqualityJointAPI")
        if not prim.has("NewtonMimicAPI") and not equality:
            if prim.value("newton:mimicJoint"):
                self.remark(prim, "without NewtonMimicAPI, which is not applied here, it means nothing to Newton",
                            f"newton:mimicJoint {prim.get('newton:mimicJoint')}")  # fmt: skip
            return
        other, called = self.leader(prim, "newton:mimicJoint", "mjc:target")
        turn = kind.word == "revolute"
        scale = 1.0 if turn else self.length
        offset, factor = (scale * prim.real("mjc:coef0", 0.0), prim.real("mjc:coef1", 1.0)) if equality else (0.0, 1.0)
        if prim.value("newton:mimicCoef0") is not None:
            offset = prim.real("newton:mimicCoef0", 0.0) * (np.pi / 180.0 if turn else self.length)
        factor = prim.real("newton:mimicCoef1", factor)
        higher = [prim.real(f"mjc:coef{i}", 0.0) for i in (2, 3, 4)] if equality else []
        law = f"coefficients {' '.join(f'{x:g}' for x in (offset, factor, *higher))}, to {called}"
        if not prim.flag("newton:mimicEnabled", True) or self.settings("mjc:flag:equality") in (False, 0):
            self.remark(prim, "it would follow another joint, which the file disables", law, "changed")
        elif other is None or kind.word not in _SINGLE or other.kind.word not in _SINGLE or factor == 0.0:
            self.remark(prim, _FOLLOWS, law)
        elif any(higher):
            self.remark(prim, HIGHER, law)
        elif kind.word != other.kind.word and not equality:
            self.remark(prim, "it would follow a joint of another type, by a number whose unit is not defined", law)
        else:
            if kind.word != other.kind.word:  # metres per radian, or radians per metre
                factor *= self.length if kind.word == "prismatic" else 1.0 / self.length
            rest = offset - one.drawn + factor * other.drawn
            self.made.ties.append(Tie(f"{name} follows {other.name}", [name, other.name], [1.0, -factor], rest, prim))

    def driven(self) -> None:
        """Report actuators and tendons, by whether they act by themselves."""
        for prim in self.prims:
            if prim.tag == "NewtonActuator":
                acts = any(prim.real(f"newton:{key}", 0.0) for key in ("kp", "kd", "constEffort"))
                law = ", ".join(f"{key} {prim.get(f'newton:{key}')}" for key in ("kp", "kd", "ki", "constEffort")
                                if prim.value(f"newton:{key}") is not None)  # fmt: skip
                self.remark(prim, SERVO if acts else MOTOR, law, "motion" if acts else "bounds")
            elif prim.tag == "MjcActuator":
                acts = str(prim.value("mjc:biasType") or "none") != "none"
                self.remark(prim, SERVO if acts else MOTOR, "", "motion" if acts else "bounds")
            elif prim.tag == "MjcTendon":
                law = ", ".join(f"{key} {prim.real(f'mjc:{key}', 0.0):g}" for key in _TENDON)
                if any(prim.real(f"mjc:{key}", 0.0) for key in _TENDON):
                    self.remark(prim, TENDON, law)
                elif (low := prim.real("mjc:range:min", 0.0)) < (high := prim.real("mjc:range:max", 0.0)):
                    self.remark(prim, ROPE, f"range {low:g} to {high:g}", "bounds")
                else:
                    self.remark(prim, "without stiffness and damping it only guides or measures", "", "other")


_TENDON = ("stiffness", "damping", "armature", "frictionloss")
