"""Faulty and unusual models, each with its message: the cases of docs/messages.md.

Every message on that page is what came out when the case was run.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import partita as pt

ORIGIN, X = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)
A, B, C, D = (0.0, 0.0, 0.0), (0.15, 0.26, 0.0), (0.84, 0.68, 0.0), (1.0, 0.0, 0.0)
WIDTH = 110


@dataclass(frozen=True)
class Said:
    """A model or a call that goes wrong, why, what to do, and how to do the same without."""

    room: str
    title: str
    ask: Callable[[], Any]
    cause: str
    remedy: str
    cured: Callable[[], Any] | None = None

    def words(self) -> str:
        """The type of the error, or of what else says it, and the sentence, as printed."""
        with warnings.catch_warnings(record=True) as heard:
            warnings.simplefilter("always")
            try:
                found = self.ask()
            except pt.errors.PartitaError as error:
                return f"{type(error).__name__}: {error}"
        reported = [f"{type(w.message).__name__}: {w.message}" for w in heard if issubclass(w.category, Warning)]
        if isinstance(found, str):
            return found
        if not found.success:
            return f"success is False, status {found.status!r}: {found.message}"
        return "\n".join(reported)


def four_bar(**change: Any) -> pt.Mechanism:
    """A four-bar linkage; `C` may be drawn elsewhere on the rocker, `axis` of C otherwise, the crank otherwise."""
    m = pt.Mechanism("four-bar")
    m.add_rod("crank", start=A, end=B, mass=change.get("mass", 0.3))
    m.add_rod("coupler", start=B, end=C, mass=0.8)
    m.add_rod("rocker", start=D, end=change.get("end", C), mass=0.7)
    m.add_revolute("A", m.ground, "crank", point=A)
    m.add_revolute("B", "crank", "coupler", point=B)
    m.add_revolute("C", "coupler", "rocker", point=C, child_point=change.get("end"), axis=change.get("axis", (0, 0, 1)))
    m.add_revolute("D", m.ground, "rocker", point=D)
    return m


def rod() -> pt.Mechanism:
    m = pt.Mechanism("pendulum")
    m.add_rod("rod", start=ORIGIN, end=X, mass=1.0)
    m.add_revolute("A", m.ground, "rod", point=ORIGIN)
    return m


def driven(*motions: tuple[str, Any], m: pt.Mechanism | None = None) -> pt.Mechanism:
    m = four_bar() if m is None else m
    for joint, motion in motions:
        m.add_drive(joint, position=motion)
    return m


def body(**change: Any) -> Any:
    return pt.Mechanism("m").add_body("box", **{"mass": 1.0, "inertia": (1.0, 1.0, 1.0), **change})


def pushed(force: Callable[..., Any]) -> pt.Mechanism:
    m = rod()
    m.add_force("rod", force, point=X)
    return m


def file(text: str) -> Any:
    """A model file with this text, by a name that is the same everywhere."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.toml"
        path.write_text(text, encoding="utf-8")
        try:
            return pt.load(path)
        except pt.errors.PartitaError as error:
            raise type(error)(error.message.replace(str(path), "model.toml"), **error.fields) from None


def truss() -> pt.Mechanism:
    m = pt.Mechanism("truss")
    for name, start in (("left", ORIGIN), ("right", X)):
        m.add_rod(name, start=start, end=(0.3, 0.8, 0), mass=1.0)
        m.add_revolute(f"foot of {name}", m.ground, name, point=start)
    m.add_revolute("top", "left", "right", point=(0.3, 0.8, 0))
    return m


def thin() -> pt.Mechanism:
    """A rod without thickness between two balls."""
    m = pt.Mechanism("thin rod")
    m.add_body("crank", mass=1.0, inertia=(0.1, 0.1, 0.1), position=A)
    m.add_rod("coupler", start=B, end=C, mass=1.0)
    m.add_body("rocker", mass=1.0, inertia=(0.1, 0.1, 0.1), position=D)
    m.add_revolute("A", m.ground, "crank", point=A)
    m.add_spherical("B", "crank", "coupler", point=B)
    m.add_spherical("C", "coupler", "rocker", point=C)
    m.add_revolute("D", m.ground, "rocker", point=D)
    return m


def pushed_aside() -> pt.Mechanism:
    """The same, with a force beside its line."""
    m = thin()
    m.add_force("coupler", (0, 0, 1), point=(1, 0.1, 0), name="push")
    return m


def flagged() -> pt.Mechanism:
    """A flag without mass on a pin of a crank."""
    m = pt.Mechanism("flag")
    m.add_rod("crank", start=ORIGIN, end=X, mass=1.0)
    m.add_rod("flag", start=X, end=(2, 1, 0), mass=0.0)
    m.add_revolute("A", m.ground, "crank", point=ORIGIN)
    m.add_revolute("B", "crank", "flag", point=X)
    return m


def loose() -> pt.Mechanism:
    m = four_bar()
    m.add_body("stone", mass=1.0, inertia=(1, 1, 1))
    return m


def masted() -> pt.Mechanism:
    m = four_bar()
    m.add_rod("mast", start=ORIGIN, end=(0, 300, 0), mass=1.0)
    m.add_revolute("foot", m.ground, "mast", point=ORIGIN)
    m.add_rod("flag", start=(0, 300, 0), end=(0.5, 300, 0), mass=1.0)
    m.add_revolute("top", "mast", "flag", point=(0, 300, 0))
    return m


def sprung() -> pt.Mechanism:
    m = four_bar()
    m.add_torsion_spring("A", stiffness=1.0, angle=90.0)
    return m


def part(text: str, title: str) -> str:
    """One section of a report, on one line."""
    lines = text.split(f"{title}\n{'-' * len(title)}\n")[1].split("\n\n")[0]
    return " ".join(lines.split())


def flat_parallelogram() -> pt.Mechanism:
    m = pt.Mechanism("parallelogram")
    points = {"A": ORIGIN, "B": (1.0, 0, 0), "C": (3.0, 0, 0), "D": (2.0, 0, 0)}
    for name, ends in (("crank", "AB"), ("coupler", "BC"), ("rocker", "DC")):
        m.add_rod(name, start=points[ends[0]], end=points[ends[1]], mass=1.0)
    for name, parent, child in (("A", "ground", "crank"), ("B", "crank", "coupler"), ("C", "coupler", "rocker")):
        m.add_revolute(name, parent, child, point=points[name])
    m.add_revolute("D", "ground", "rocker", point=points["D"])
    return m


NAMES, LOOPS, DRIVES = "Names and numbers", "Loops that do not close", "Drives and structures"
MOVES, FUNCTIONS, FILES = "What moves and what is redundant", "Functions, loads and runs", "Files, states and results"

CASES = (
    Said(NAMES, "a body that was not added", lambda: rod().add_revolute("B", "rodd", "ground", point=X),
         "The name is misspelt, or the body is added later.",
         "Use the suggested name, or add the body before its joints.",
         lambda: rod().add_revolute("B", "rod", "ground", point=X)),
    Said(NAMES, "two joints with the same name", lambda: rod().add_revolute("A", "rod", "ground", point=X),
         "Results are read by name, so joint names must be unique.", "Rename one."),
    Said(NAMES, "a joint from a body to itself", lambda: rod().add_revolute("B", "rod", "rod", point=X),
         "Parent and child are the same body.", "Name the other body, or `m.ground`."),
    Said(NAMES, "a zero axis", lambda: rod().add_revolute("B", "ground", "rod", point=X, axis=ORIGIN),
         "All three numbers are 0.", "Give any vector along the axis; its length does not matter."),
    Said(NAMES, "parallel axes of a universal joint",
         lambda: rod().add_universal("U", "ground", "rod", point=X, axis1=(0, 0, 1), axis2=(0, 0, 1)),
         "Two rotations about parallel axes are one.", "Give axes at an angle, or use a revolute joint."),
    Said(NAMES, "a negative mass", lambda: body(mass=-1.0), "Wrong sign.", "Give the mass [kg], 0 or more."),
    Said(NAMES, "an impossible inertia", lambda: body(inertia=(1.0, 1.0, 3.0)),
         "For any distribution of mass the largest principal moment is at most the sum of the others.",
         "Check the order of the entries and the unit; give moments about the centre of mass.",
         lambda: body(inertia=(1.0, 1.0, 2.0))),
    Said(NAMES, "NaN in a point", lambda: rod().add_revolute("B", "ground", "rod", point=(np.nan, 0, 0)),
         "An earlier computation failed.", "Print its inputs."),
    Said(NAMES, "two numbers for a point", lambda: rod().add_revolute("B", "ground", "rod", point=(1, 0)),
         "Points have three coordinates, also those of planar mechanisms.", "Add a 0."),
    Said(NAMES, "an unknown direction",
         lambda: rod().add_joint("J", "ground", "rod", free=("x", "rotz")),
         "The directions are x, y, z, rx, ry, rz.", "Use the suggested one."),
    Said(LOOPS, "bars that are too short", lambda: short().assemble(),
         "One side of the loop is longer than all others together.",
         "Check the lengths of the bodies named and their unit."),
    Said(LOOPS, "an angle that the linkage cannot reach", lambda: four_bar().assemble(targets={"D": 3.0}),
         "A rocker reaches only part of the circle.", "Choose an angle in its range, or drive the crank."),
    Said(LOOPS, "degrees instead of radians", lambda: driven(("D", 90.0)).assemble(),
         "Angles are in radians.", "`pt.units.convert(90, \"deg\", \"rad\")`, or `np.radians(90)`.",
         lambda: driven(("D", np.radians(5.0))).assemble()),
    Said(LOOPS, "two targets that contradict each other",
         lambda: four_bar().assemble(targets={"A": 0.1, "D": 2.0}),
         "One degree of freedom takes one target; the other follows.",
         "Give one of them, or a list of targets in order of priority.",
         lambda: four_bar().assemble(targets=[{"A": 0.1}, {"D": 2.0}])),
    Said(LOOPS, "a target for an unknown joint", lambda: four_bar().assemble(targets={"E": 0.1}),
         "Unknown name.", "Use one of the names listed."),
    Said(LOOPS, "rates that the loop does not allow", lambda: four_bar().assemble(rates={"A": 1.0, "D": 5.0}),
         "One degree of freedom takes one rate; the other follows.", "Give one of them.",
         lambda: four_bar().assemble(rates={"A": 1.0})),
    Said(LOOPS, "a start in a position where branches meet", lambda: flat_parallelogram().simulate(0.1),
         "All links lie on one line: from here the linkage can continue as a parallelogram or as an antiparallelogram.",
         "Give rates that belong to one branch only, or start a little away, on the branch you want.",
         lambda: flat_parallelogram().simulate(0.1, initial=flat_parallelogram().assemble(rates={"A": 1.0, "D": 1.0}))),
    Said(DRIVES, "a drive of a truss", lambda: driven(("foot of left", lambda t: t), m=truss()).simulate(0.1),
         "Three bars with three pins are a structure.", "Free a joint, or remove the drive."),
    Said(DRIVES, "two motors that contradict each other",
         lambda: driven(("A", lambda t: 2 * t), ("D", lambda t: t)).simulate(0.1),
         "One degree of freedom follows one motor.", "Remove one, or prescribe compatible motions.",
         lambda: driven(("A", lambda t: t)).simulate(0.1)),
    Said(DRIVES, "two drives on one coordinate", lambda: driven(("A", 0.0), ("A", 1.0)),
         "The second drive contradicts the first, or repeats it.", "Add the motions and use one drive."),
    Said(DRIVES, "a drive of a ball joint",
         lambda: driven(("B", 0.0), m=thin()),
         "The coordinates of a ball joint are a quaternion, of which no part moves alone.",
         "Draw three hinges instead, or drive another joint."),
    Said(DRIVES, "a drive table that ends before the run",
         lambda: driven(("A", ([0.0, 0.1, 0.2, 0.3], [0.0, 0.01, 0.02, 0.03]))).simulate(1.0),
         "The motion after the last entry is undefined.", "Lengthen the table, or shorten the run."),
    Said(DRIVES, "everything welded", lambda: welded().compile(), "There is no coordinate left.", "Free a joint."),
    Said(DRIVES, "a fully driven mechanism",
         lambda: part(driven(("A", lambda t: t)).report(), "Mobility"),
         "Nothing is wrong: all of the motion is prescribed.", "None; `run.joint(\"A\").drive` is the torque."),
    Said(MOVES, "hinges in one plane", lambda: part(four_bar().report(), "Redundancy"),
         "Each spatial hinge constrains the links to the plane again.",
         "None for the motion. For reactions across the plane, replace the joints named, or `add_compliance`."),
    Said(MOVES, "a thin rod between two balls", lambda: part(thin().report(), "Notes"),
         "The rod can spin about its own line, and has no inertia about it. Nothing is wrong: the spin is held.",
         "None; where the spin matters, draw the rod with `add_body` and its axial inertia."),
    Said(MOVES, "a thin rod between two balls, pushed beside its line", lambda: pushed_aside().simulate(0.1),
         "The force turns the rod about its own line, where it has no inertia.",
         "Draw it with `add_body` and its axial inertia, or with a universal joint at one end."),
    Said(MOVES, "the report of that rod", lambda: part(pushed_aside().report(), "Notes"),
         "The same, found before the run.", "The same."),
    Said(MOVES, "a flag without mass on a pin", lambda: flagged().simulate(0.1),
         "Nothing that moves with the flag has mass, so its rotation is indeterminate.",
         "Give it mass or inertia, fix it, or drive it."),
    Said(MOVES, "a body without a joint", lambda: part(loose().report(), "Notes"),
         "A joint is missing, or connects another body.",
         "Connect it; a body that should move freely needs `add_free`."),
    Said(MOVES, "a structure", lambda: part(truss().report(), "Mobility"),
         "The joints leave no degree of freedom.", "Free a joint; the static reactions are correct."),
    Said(MOVES, "a body in another unit", lambda: part(masted().report(), "Suspicious data"),
         "A length in millimetres among lengths in metres, or a typing error.",
         "`pt.units.convert(300, \"mm\", \"m\")`."),
    Said(MOVES, "a spring at 90 radians", lambda: part(sprung().report(), "Suspicious data"),
         "The angle is in degrees.", "`np.radians(90)`."),
    Said(MOVES, "a compliance of zero", lambda: rod().add_compliance("A"),
         "No compliance was given.", "Give the compliance of the joint, or omit it."),
    Said(FUNCTIONS, "a force of two numbers", lambda: pushed(lambda t, state: (1.0, 0.0)).simulate(0.1),
         "A force has three components.", "Return three numbers."),
    Said(FUNCTIONS, "a force that becomes NaN",
         lambda: pushed(lambda t, state: (np.sqrt(0.5 - t), 0, 0)).simulate(1.0, step=0.1),
         "The root of a negative number.", "Restrict the argument of the function."),
    Said(FUNCTIONS, "a drive with a wrong velocity",
         lambda: rod().add_drive("A", lambda t: np.sin(t), lambda t: np.sin(t), lambda t: -np.sin(t)),
         "The derivative given is not that of the position.", "Omit it: it is computed exactly."),
    Said(FUNCTIONS, "a formulation that does not exist", lambda: rod().simulate(1.0, solver=pt.Solver("projektive")),
         "Unknown name.", "Use the suggested one."),
    Said(FUNCTIONS, "a negative tolerance", lambda: rod().simulate(1.0, rtol=-1e-8), "Wrong sign.", "Give 1e-8, say."),
    Said(FUNCTIONS, "too few steps allowed", lambda: four_bar().simulate(10.0, max_steps=5),
         "The run needs more steps than `max_steps`.", "Allow more, or loosen `rtol`."),
    Said(FUNCTIONS, "an independent coordinate that does not exist",
         lambda: four_bar().simulate(1.0, solver=pt.Solver("fixed"), independent=["Q"]),
         "Unknown name.", "Use one of the names listed, or the default."),
    Said(FILES, "an unknown key in a model file",
         lambda: file('[mechanism]\npartita = 1\nname = "m"\n[[body]]\nname = "b"\nmas = 1.0\ninertia = [1, 1, 1]\n'),
         "A key is misspelt.", "Use the suggested one; the message names the line."),
    Said(FILES, "a file that is not TOML", lambda: file('[mechanism\nname = "m"\n'),
         "A bracket is missing.", "Close it; the line is named."),
    Said(FILES, "a state of another mechanism",
         lambda: four_bar().simulate(0.1, initial=rod().assemble()),
         "A state belongs to the mechanism, and the coordinates, that it was assembled in.",
         "Assemble it again; `m.convert` takes a state from one kind of coordinates to the other."),
    Said(FILES, "a joint that the result does not have", lambda: rod().simulate(0.1).joint("B"),
         "Unknown name.", "Use one of the names listed."),
    Said(FILES, "a frame that is not a rotation", lambda: rod().simulate(0.1).joint("A").in_frame(2 * np.eye(3)),
         "Its columns are not unit vectors.", "Divide them by their length."),
    Said(FILES, "self-stresses at a nonexistent output", lambda: rod().simulate(0.1).self_stresses(1000),
         "Outputs are numbered from 0.", "Use an existing one; -1 is the last."),
)  # fmt: skip


def welded() -> pt.Mechanism:
    m = pt.Mechanism("block")
    m.add_rod("rod", start=ORIGIN, end=X, mass=1.0)
    m.add_fixed("weld", m.ground, "rod")
    return m


def short() -> pt.Mechanism:
    """A loop whose ground is longer than its other links together."""
    m = pt.Mechanism("short")
    m.add_rod("crank", start=(0, 0, 0), end=(0.3, 0, 0), mass=1.0)
    m.add_rod("rocker", start=(2, 0, 0), end=(1.5, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, "crank", point=(0, 0, 0))
    m.add_revolute("B", "crank", "rocker", point=(0.3, 0, 0), child_point=(1.5, 0, 0))
    m.add_revolute("C", m.ground, "rocker", point=(2, 0, 0))
    return m


def page() -> str:
    """The generated part of docs/messages.md."""
    lines = [f"{len(CASES)} cases."]
    room = None
    for case in CASES:
        if case.room != room:
            room = case.room
            lines += ["", f"## {room}"]
        title = case.title[0].upper() + case.title[1:]
        lines += ["", f"### {title}", "", "```text", *wrapped(case.words()), "```", ""]
        remedy = case.remedy[0].lower() + case.remedy[1:] if case.remedy[:2].istitle() else case.remedy
        lines += [f"{case.cause} *Remedy:* {remedy}"]
    return "\n".join([*lines, ""])


def wrapped(words: str) -> list[str]:
    """Lines of a page's width, broken between words."""
    found: list[str] = []
    for line in words.splitlines():
        current = ""
        for word in line.split(" "):
            if current and len(current) + 1 + len(word) > WIDTH:
                found.append(current)
                current = word
            else:
                current = f"{current} {word}" if current else word
        found.append(current)
    return found
