"""`python tools/beside_pinocchio.py`: mechanisms by Partita and by Pinocchio, rows of docs/others.md.

Pinocchio is asked for by itself (`pip install pin`); no test needs it.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin
from beside import BENNETT, EVERY, FOUR_BAR, Hinge, Known, Reading, asked, reported, tree
from scipy.integrate import solve_ivp

# As its example of a four-bar has them: gain of the corrector, accuracy and rounds of the proximal solver, its
# regularisation, step [s].
GAIN, ACCURACY, ROUNDS = 10.0, 1e-8, 10
REGULARISATION, STEP = 1e-10, 5e-3
SOFT = 1e-4  # regularisation at which its steps get through the redundancy of Bennett's linkage: found by trying
WILD = 1e3  # a rate [rad/s] that none of these mechanisms has


def main() -> None:
    """Run and print."""
    print(f"Pinocchio {pin.__version__}")
    for known in asked("mechanisms by Partita and by Pinocchio", (FOUR_BAR, BENNETT)):
        for kind, words in (("ball", "ball"), ("weld", "link cut and welded")):
            for mu, step in ((REGULARISATION, STEP), (REGULARISATION, STEP / 10), (SOFT, STEP / 10)):
                settings = f"{words}, mu {mu:g}, its example's steps of {1e3 * step:g} ms"
                reported(known, "Pinocchio", settings, partial(euler, known, kind, mu, step))
            reported(
                known, "Pinocchio", f"{words}, mu {REGULARISATION:g}, DOP853 of SciPy", partial(adaptive, known, kind)
            )


class Chain:
    """A single loop of hinges, opened, with the constraint that closes it."""

    def __init__(self, known: Known, kind: str, regularisation: float) -> None:
        """`kind`: "ball" at the joint that closes the loop, or "weld" in a link cut in two halves."""
        self.known = known
        m, run = known.mechanism, known.run
        hinges, (cut,) = tree(known)
        halved = cut.child if cut.child != "ground" else cut.parent
        shadow = Hinge(cut.name, cut.parent, cut.child, cut.point, cut.axis, cut.rate)
        if halved == cut.parent:
            shadow = cut._replace(parent=cut.child, child=cut.parent, rate=-cut.rate)
        self.model = model = pin.Model()
        model.gravity.linear = np.array(m.gravity)
        self.ids, points, rates = {"ground": 0}, {"ground": np.zeros(3)}, []
        weld = kind == "weld"
        self.signs: dict[str, tuple[int, float]] = {}
        for h, name in [*((h, h.child) for h in hinges), *([(shadow, "shadow")] if weld else [])]:
            placement = pin.SE3(np.eye(3), h.point - points[h.parent])
            joint = model.addJoint(self.ids[h.parent], pin.JointModelRevoluteUnaligned(h.axis), placement, h.name)
            body, at = m.bodies[h.child], run.body(h.child)
            turn = at.rotation[0]
            part = 0.5 if weld and h.child == halved else 1.0
            com = at.position[0] + turn @ np.array(body.com) - h.point
            model.appendBodyToJoint(
                joint,
                pin.Inertia(part * body.mass, com, part * turn @ np.array(body.inertia) @ turn.T),
                pin.SE3.Identity(),
            )
            self.ids[name], points[name] = joint, h.point
            rates.append(h.rate)
            self.signs[h.name] = (joint, 1.0 if m.joints[h.name].child == h.child else -1.0)
        ends = ("shadow", halved) if weld else (shadow.child, shadow.parent)
        self.closing = pin.RigidConstraintModel(
            pin.ContactType.CONTACT_6D if weld else pin.ContactType.CONTACT_3D, model,
            self.ids[ends[0]], pin.SE3(np.eye(3), cut.point - points[ends[0]]),
            self.ids[ends[1]], pin.SE3(np.eye(3), cut.point - points[ends[1]]), pin.ReferenceFrame.LOCAL,
        )  # fmt: skip
        self.closing.setBaumgarteCorrectorParameters(pin.BaumgarteCorrectorParameters(GAIN, 2.0 * np.sqrt(GAIN)))
        if not weld:  # what pushes the child of the joint that closes the loop
            self.signs[cut.name] = (-1, 1.0 if m.joints[cut.name].child == shadow.child else -1.0)
        self.data = model.createData()
        self.closings, self.founds = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
        self.closings.append(self.closing)
        self.founds.append(self.closing.createData())
        self.settings = pin.ProximalSettings(ACCURACY, regularisation, ROUNDS)
        pin.initConstraintDynamics(model, self.data, self.closings, self.founds)
        self.points = points
        self.q, self.v = pin.neutral(model), np.array(rates)

    def acceleration(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Of the chain with its loop closed."""
        zero = np.zeros(self.model.nv)
        return pin.constraintDynamics(self.model, self.data, q, v, zero, self.closings, self.founds, self.settings)

    def seen(self, q: np.ndarray, v: np.ndarray) -> Reading:
        """Bodies and forces at a state."""
        m, run = self.known.mechanism, self.known.run
        a = self.acceleration(q, v)
        first, second = self.closing.joint1_id, self.closing.joint2_id
        push = self.closing.joint1_placement.act(self.founds[0].contact_force)
        world = self.data.oMi[first].act(push)
        outer = [pin.Force.Zero() for _ in range(self.model.njoints)]
        outer[first] = push
        if second:
            outer[second] = -self.data.oMi[second].actInv(world)
        torque = pin.rnea(self.model, self.data, q, v, a, outer)
        scale = max(np.abs(f.vector).max() for f in self.data.f)
        assert np.abs(torque).max() < 1e-6 * scale, torque  # nothing but joints and the constraint acts
        pin.forwardKinematics(self.model, self.data, q, v)
        bodies: dict[str, Any] = {}
        for name in m.bodies:
            joint, at, body = self.ids[name], run.body(name), m.bodies[name]
            position, turn = self.data.oMi[joint].translation, self.data.oMi[joint].rotation
            speed = pin.getVelocity(self.model, self.data, joint, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            arm = turn @ (at.position[0] - self.points[name])
            rotation = turn @ at.rotation[0]
            arm_now = arm + rotation @ np.array(body.com)
            bodies[name] = (position + arm, rotation, speed.linear + np.cross(speed.angular, arm_now), speed.angular)
        forces = {}
        for name, (joint, sign) in self.signs.items():
            force = world.linear if joint < 0 else self.data.oMi[joint].act(self.data.f[joint]).linear
            forces[name] = sign * np.array(force)
        return Reading(bodies, forces)


def euler(known: Known, kind: str, regularisation: float, step: float, look: bool) -> list[Reading] | None:
    """Its example's steps: velocities first, positions by the new ones."""
    chain = Chain(known, kind, regularisation)
    q, v, seen = chain.q, chain.v, list[Reading]()
    every = round(EVERY / step)
    for i in range(round(known.case.seconds / step) + 1):
        if np.abs(v).max() > WILD:
            return None
        if look and i % every == 0:
            seen.append(chain.seen(q, v))
        v = v + step * chain.acceleration(q, v)
        q = pin.integrate(chain.model, q, step * v)
    return seen


def adaptive(known: Known, kind: str, look: bool) -> list[Reading] | None:
    """SciPy's method of order eight, to the tolerances of Partita's run."""
    chain = Chain(known, kind, REGULARISATION)
    n = chain.model.nv

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate((y[n:], chain.acceleration(y[:n], y[n:])))

    t = known.run.t
    start = np.concatenate((chain.q, chain.v))
    found = solve_ivp(rate, (0.0, float(t[-1])), start, "DOP853", t, rtol=1e-10, atol=1e-12)
    if not found.success:
        return None
    return [chain.seen(y[:n], y[n:]) for y in found.y.T] if look else []


if __name__ == "__main__":
    main()
