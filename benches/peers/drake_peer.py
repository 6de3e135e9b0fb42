"""Drake: hinges in a tree, loops by ball constraints, which its discrete plants have (SAP)."""

from __future__ import annotations

import sys
from importlib.metadata import version
from typing import Any

import numpy as np
from planar import Problem, Tried, report, timed
from pydrake.math import RigidTransform
from pydrake.multibody.plant import DiscreteContactApproximation as Contact
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, LinearSpringDamper, RevoluteJoint, SpatialInertia, UnitInertia
from pydrake.systems.analysis import Simulator


def built(p: Problem, step: float) -> Any:
    """The plant with all hinges at zero in the drawing."""
    plant = MultibodyPlant(step)
    plant.set_discrete_contact_approximation(Contact.kSap)
    bodies, points = {-1: plant.world_body()}, {-1: np.zeros(2)}
    for pin in p.tree:
        arm = np.array([*(p.centres[pin.child] - pin.point), 0.0])
        m, moment = p.masses[pin.child], p.inertias[pin.child]
        about = np.diag([moment / 2, moment / 2, moment]) / m + (arm @ arm) * np.eye(3) - np.outer(arm, arm)
        unit = UnitInertia(*np.diag(about), about[0, 1], about[0, 2], about[1, 2])
        body = plant.AddRigidBody(f"b{pin.child}", SpatialInertia(m, arm, unit))
        bodies[pin.child], points[pin.child] = body, pin.point
        here = RigidTransform(np.array([*(pin.point - points[pin.parent]), 0.0]))
        held = plant.AddFrame(FixedOffsetFrame(f"p{pin.child}", bodies[pin.parent].body_frame(), here))
        plant.AddJoint(RevoluteJoint(f"j{pin.child}", held, body.body_frame(), [0, 0, 1]))
    for pin in p.loops:
        ends = [np.array([*(pin.point - points[i]), 0.0]) for i in (pin.child, pin.parent)]
        plant.AddBallConstraint(bodies[pin.child], ends[0], bodies[pin.parent], ends[1])
    for s in p.springs:
        ends = [np.array([*(x - points[i]), 0.0]) for i, x in ((s.body1, s.point1), (s.body2, s.point2))]
        plant.AddForceElement(
            LinearSpringDamper(bodies[s.body1], ends[0], bodies[s.body2], ends[1], s.length, s.stiffness, 0)
        )
    plant.mutable_gravity_field().set_gravity_vector([*p.gravity, 0.0])
    plant.Finalize()
    return plant


def tried(p: Problem) -> list[Tried]:
    found = []
    for per_output in (5, 50, 500):
        steps = per_output * (len(p.times) - 1)
        if steps * len(p.bodies) > 1_000_000:
            continue
        plant = built(p, float(p.times[-1]) / steps)
        simulator = Simulator(plant)

        def call(plant: Any = plant, simulator: Any = simulator) -> float:
            context = simulator.get_mutable_context()
            context.SetTime(0.0)
            plant.SetPositions(context, np.zeros(plant.num_positions()))
            for pin in p.tree:
                plant.GetJointByName(f"j{pin.child}").set_angular_rate(context, p.relative_rate(pin))
            force = np.zeros(plant.num_velocities())
            for i, torque in p.torques.items():
                force[plant.GetJointByName(f"j{i}").velocity_start()] = torque
            plant.get_applied_generalized_force_input_port().FixValue(context, force)
            simulator.Initialize()
            for t in p.times[1:]:
                simulator.AdvanceTo(float(t))
            return float(plant.GetJointByName("j0").get_angle(context))

        seconds, angle = timed(call)
        found.append(Tried(f"SAP, {steps} steps", seconds, p.error(p.angles[0] + angle)))
    return found


if __name__ == "__main__":
    report(tried(Problem.read(sys.argv[1])), f"Drake {version('drake')}")
