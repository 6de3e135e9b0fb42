"""Methods that a mechanism does not have, by the names under which people look for them."""

from __future__ import annotations

import difflib

from ..errors import UnknownAttributeError

ELSEWHERE = {
    "add_actuator": "add_torque applies an effort, add_drive prescribes a motion",
    "add_ball": "add_spherical is the ball joint, add_body a body",
    "add_cable": "use add_rope, which pulls and goes slack; one that stays tight is add_distance",
    "add_cylinder": "add_body takes mass and inertia, add_cylindrical is the joint",
    "add_damper": "springs have a damper: damping= of add_spring and add_torsion_spring",
    "add_hinge": "use add_revolute",
    "add_joint_torque": "use add_torque",
    "add_link": "use add_rod",
    "add_motor": "add_torque applies an effort, add_drive prescribes a motion",
    "add_pin": "use add_revolute",
    "add_pulley": "use add_belt",
    "add_rotational_spring": "use add_torsion_spring",
    "add_slider": "use add_prismatic",
    "add_weld": "use add_fixed",
    "animate": "run.show() and run.to_html(path) animate a run",
    "degrees_of_freedom": "use print(m.report()), or m.compile().mobility",
    "dof": "use print(m.report()), or m.compile().mobility",
    "eigenvalues": "use m.linearize(m.equilibrium()).modes()",
    "integrate": "use m.simulate",
    "modes": "use m.linearize(m.equilibrium()).modes()",
    "natural_frequencies": "use m.linearize(m.equilibrium()).modes()",
    "run": "use m.simulate",
    "solve": "use m.simulate, m.assemble, m.equilibrium or m.inverse_dynamics",
    "view": "use m.show()",
}
"""Word -> what to use."""


def unknown(owner: type, word: str) -> UnknownAttributeError:
    """The error for an attribute that a mechanism does not have, with what was probably meant."""
    known = [name for name in dir(owner) if not name.startswith("_")]
    near = difflib.get_close_matches(word, [*known, *ELSEWHERE], n=1, cutoff=0.75)
    if word in ELSEWHERE:
        hint = ELSEWHERE[word]
    elif near:
        hint = ELSEWHERE[near[0]] if near[0] in ELSEWHERE else f"did you mean {near[0]!r}?"
    else:
        hint = "dir(m) lists what it has"
    return UnknownAttributeError(f"a mechanism has no {word!r}; {hint}", name=word, known=known)
