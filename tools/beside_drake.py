"""`python tools/beside_drake.py`: mechanisms by Partita and by Drake, rows of docs/others.md.

Drake is asked for by itself (`pip install drake`); no test needs it.
"""

from __future__ import annotations

from functools import partial
from importlib.metadata import version
from typing import Any

import numpy as np
from beside import BENNETT, FOUR_BAR, Hinge, Known, Reading, asked, reported, tree
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import DiscreteContactApproximation, MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    LinearBushingRollPitchYaw,
    RevoluteJoint,
    RotationalInertia,
    SpatialInertia,
)
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator

SETTLING = (1e-2, 1e-3)  # times [s] that the documentation of its bushing calls negligible


def main() -> None:
    """Run and print."""
    print(f"Drake {version('drake')}")
    for known in asked("mechanisms by Partita and by Drake", (FOUR_BAR, BENNETT)):
        reported(known, "Drake", "a loop of four joints", partial(run, known, "loop", 0.0))
        for step in (1e-2, 1e-3, 1e-4):
            reported(known, "Drake", f"link cut and welded, SAP, {1e3 * step:g} ms", partial(run, known, "weld", step))
        for settling in SETTLING:
            reported(known, "Drake", f"bushing, settling in {1e3 * settling:g} ms, accuracy 1e-6",
                 partial(run, known, "bushing", settling))  # fmt: skip


class Plant:
    """A single loop of hinges in Drake."""

    def __init__(self, known: Known, kind: str, number: float) -> None:
        """`kind`: "loop", all hinges as joints; "weld", a link cut in two halves that a constraint holds, stepping by
        `number` [s]; "bushing", one hinge as a bushing that settles in `number` [s]."""
        self.known = known
        hinges, (cut,) = tree(known)
        self.plant = plant = MultibodyPlant(number if kind == "weld" else 0.0)
        if kind == "weld":
            plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
        plant.mutable_gravity_field().set_gravity_vector(known.mechanism.gravity)
        self.halved = cut.child if cut.child != "ground" else cut.parent
        parts = {name: 0.5 if kind == "weld" and name == self.halved else 1.0 for name in known.mechanism.bodies}
        self.bodies = {
            "ground": plant.world_body(),
            **{name: self.body(name, name, part) for name, part in parts.items()},
        }
        self.joints: dict[str, tuple[Any, float]] = {}
        self.rates: list[tuple[Any, float]] = []
        for h in hinges:
            self.joint(h, h.child)
        if kind == "loop":
            self.joint(cut, cut.child)
        if kind == "weld":
            self.bodies["shadow"] = self.body("shadow", self.halved, 0.5)
            turned = cut.child == "ground"
            shadow = cut._replace(parent=cut.child, child=cut.parent, rate=-cut.rate) if turned else cut
            self.joint(shadow, "shadow")
            whole = RigidTransform()
            plant.AddWeldConstraint(self.bodies[self.halved], whole, self.bodies["shadow"], whole)
        if kind == "bushing":
            self.bushing(cut, number)
        plant.Finalize()

    def body(self, name: str, like: str, part: float) -> Any:
        """A body with the frame, and a part of the mass, of one of the mechanism."""
        b = self.known.mechanism.bodies[like]
        i = part * np.array(b.inertia)
        inertia = RotationalInertia(i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2])
        return self.plant.AddRigidBody(
            name, SpatialInertia.MakeFromCentralInertia(part * b.mass, np.array(b.com), inertia)
        )

    def frame(self, name: str, on: str, h: Hinge, axes: np.ndarray) -> Any:
        """A frame on a body, at a hinge, along `axes` at the start."""
        position, turn = np.zeros(3), np.eye(3)
        if on != "ground":
            at = self.known.run.body(self.halved if on == "shadow" else on)
            position, turn = at.position[0], at.rotation[0]
        pose = RigidTransform(RotationMatrix(turn.T @ axes), turn.T @ (h.point - position))
        return self.plant.AddFrame(FixedOffsetFrame(name, self.bodies[on].body_frame(), pose))

    def joint(self, h: Hinge, child: str) -> None:
        """A hinge to the body `child`; all are at zero at the start."""
        frames = [self.frame(f"{h.name} {end}", body, h, np.eye(3)) for end, body in (("p", h.parent), ("c", child))]
        made = self.plant.AddJoint(RevoluteJoint(h.name, frames[0], frames[1], h.axis, damping=0.0))
        self.joints[h.name] = (made, 1.0 if self.known.mechanism.joints[h.name].child == h.child else -1.0)
        self.rates.append((made, h.rate))

    def bushing(self, h: Hinge, settling: float) -> None:
        """A hinge as a bushing, by its documentation's rules: critically damped, settling to a hundredth in time."""
        across = np.cross(h.axis, np.eye(3)[np.abs(h.axis).argmin()])
        across /= np.linalg.norm(across)
        axes = np.column_stack((across, np.cross(h.axis, across), h.axis))
        body = self.known.mechanism.bodies[self.halved]
        frequency = -np.log(0.01) / settling
        along, about = np.ones(3), np.array([1.0, 1.0, 0.0])
        mass, inertia = body.mass, float(np.linalg.eigvalsh(body.inertia).max())
        self.plant.AddForceElement(LinearBushingRollPitchYaw(
            self.frame("bushing p", h.parent, h, axes), self.frame("bushing c", h.child, h, axes),
            inertia * frequency**2 * about, 2.0 * inertia * frequency * about,
            mass * frequency**2 * along, 2.0 * mass * frequency * along,
        ))  # fmt: skip

    def start(self, simulator: Any) -> Any:
        """The context of the plant at the start."""
        context = simulator.get_mutable_context()
        for made, rate in self.rates:
            made.set_angle(context, 0.0)
            made.set_angular_rate(context, rate)
        return context

    def seen(self, context: Any) -> Reading:
        """Bodies and forces at a state."""
        plant, m = self.plant, self.known.mechanism
        bodies: dict[str, Any] = {}
        for name in m.bodies:
            pose = plant.EvalBodyPoseInWorld(context, self.bodies[name])
            speed = plant.EvalBodySpatialVelocityInWorld(context, self.bodies[name])
            rotation = pose.rotation().matrix()
            arm = rotation @ np.array(m.bodies[name].com)
            spin = speed.rotational()
            bodies[name] = (pose.translation(), rotation, speed.translational() + np.cross(spin, arm), spin)
        reported = plant.get_reaction_forces_output_port().Eval(context)
        forces = {}
        for name, (made, sign) in self.joints.items():
            turn = made.frame_on_child().CalcPoseInWorld(context).rotation().matrix()
            forces[name] = sign * turn @ reported[int(made.index())].translational()
        return Reading(bodies, forces)


def run(known: Known, kind: str, number: float, look: bool) -> list[Reading] | None:
    """A run to the end of Partita's; None where Drake refuses it."""
    try:
        made = Plant(known, kind, number)
        simulator = Simulator(made.plant)
        if kind == "bushing":
            ResetIntegratorFromFlags(simulator, "runge_kutta3", 0.01)
            simulator.get_mutable_integrator().set_target_accuracy(1e-6)
        context = made.start(simulator)
        simulator.Initialize()
        if not look:
            simulator.AdvanceTo(known.case.seconds)
            return []
        seen = []
        for t in known.run.t:
            simulator.AdvanceTo(float(t))
            seen.append(made.seen(context))
        return seen
    except RuntimeError as error:
        print(f"  {' '.join(str(error).split())[:300]}")
        return None


if __name__ == "__main__":
    main()
