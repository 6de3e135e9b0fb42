"""Methods that a mechanism does not have, by the names under which people look for them."""

from __future__ import annotations

from ..errors import UnknownAttributeError
from ..naming import missing_attribute

ELSEWHERE = {
    "add_actuator": "add_torque applies an effort, add_drive prescribes a motion",
    "add_ball": "add_spherical is the ball joint, add_body a body",
    "add_cable": "use add_rope, which pulls and goes slack; one that stays tight is add_distance",
    "add_box": "add_solid takes pt.shapes.Box(size)",
    "add_cylinder": "add_solid takes pt.shapes.Cylinder(radius, length), add_cylindrical is the joint",
    "add_disc": "add_solid takes pt.shapes.Disc(radius, thickness)",
    "add_damper": "springs have a damper: damping= of add_spring and add_torsion_spring",
    "add_extrusion": "add_solid takes pt.shapes.Extrusion(outline, length)",
    "add_gas_piston": "add_gas_strut acts between two points, add_gas_spring along a joint",
    "add_hinge": "use add_revolute",
    "add_joint_torque": "use add_torque",
    "add_link": "use add_rod",
    "add_motor": "add_torque applies an effort, add_drive prescribes a motion",
    "add_mass": "use add_body, with inertia=(0, 0, 0) for a point mass",
    "add_mesh": 'add_solid takes pt.shapes.Mesh("part.stl", "1 mm")',
    "add_moment": "use add_torque along a joint; on a body, add_force_law returns (force, moment)",
    "add_particle": "use add_body, with inertia=(0, 0, 0) for a point mass",
    "add_pin": "use add_revolute",
    "add_plate": "add_solid takes pt.shapes.Plate(outline, thickness)",
    "add_planetary_gear": "use add_coupler, whose terms are the joints of sun, carrier and planet",
    "add_point_mass": "use add_body, with inertia=(0, 0, 0) for a point mass",
    "add_pulley": "use add_belt",
    "add_rotational_spring": "use add_torsion_spring",
    "add_slider": "use add_prismatic",
    "add_sphere": "add_solid takes pt.shapes.Sphere(radius), add_spherical is the joint",
    "add_weld": "use add_fixed",
    "animate": "run.show() and run.to_html(path) animate a run",
    "degrees_of_freedom": "use print(m.report()), or m.compile().mobility",
    "dof": "use print(m.report()), or m.compile().mobility",
    "eigenfrequencies": "use m.linearize(m.equilibrium()).modes()",
    "eigenvalues": "use m.linearize(m.equilibrium()).modes()",
    "export": "use m.save, m.to_fmu, m.export_c or m.to_playground",
    "frequencies": "use m.linearize(m.equilibrium()).modes()",
    "integrate": "use m.simulate",
    "mobility": "use print(m.report()), or m.compile().mobility",
    "modes": "use m.linearize(m.equilibrium()).modes()",
    "natural_frequencies": "use m.linearize(m.equilibrium()).modes()",
    "run": "use m.simulate",
    "solve": "use m.simulate, m.assemble, m.equilibrium or m.inverse_dynamics",
    "static": "use m.equilibrium",
    "statics": "use m.equilibrium",
    "sweep": "use pt.sweep, or parameters= of m.simulate",
    "to_toml": 'use m.save("name.toml")',
    "view": "use m.show()",
}
"""Word -> what to use."""


def unknown(owner: type, word: str) -> UnknownAttributeError:
    """The error for an attribute that a mechanism does not have, with what was probably meant."""
    return missing_attribute("a mechanism", owner, word, ELSEWHERE, "dir(m) lists what it has")
