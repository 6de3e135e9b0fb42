"""The report: its sentences describe the mechanism, and its remedies remove what they promise to remove."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import partita as pt

A, B, C, D = (0, 0, 0), (0.15, 0.26, 0), (0.84, 0.68, 0), (1, 0, 0)


def four_bar(kinds: str = "RRRR", mass: float = 0.5) -> pt.Mechanism:
    """R: hinge, S: ball, C: cylindrical joint."""
    m = pt.Mechanism("four-bar")
    for name, start, end in (("crank", A, B), ("coupler", B, C), ("rocker", D, C)):
        middle = (np.array(start) + np.array(end)) / 2
        m.add_body(name, mass=mass, inertia=(0.02, 0.03, 0.04), position=middle)
    ends = {"A": ("ground", "crank"), "B": ("crank", "coupler"), "C": ("coupler", "rocker"), "D": ("ground", "rocker")}
    add = {"R": m.add_revolute, "S": m.add_spherical, "C": m.add_cylindrical}
    for (name, bodies), kind, point in zip(ends.items(), kinds, (A, B, C, D), strict=True):
        add[kind](name, *bodies, point=point)
    return m


def test_the_remedy_that_is_named_works() -> None:
    report = four_bar().report()
    found = report.to_dict()
    assert (found["gruebler"], found["degrees_of_freedom"], found["mobility"]) == (-2, 1, 1)
    assert "6 x 3 - 20 = -2" in report and "larger by 3 redundant constraints" in report.replace("\n", " ")
    kinds = {"A": "R", "B": "R", "C": "R", "D": "R"}
    for remedy in found["remedies"]:
        kinds[remedy["joint"]] = {"a ball joint": "S", "a cylindrical joint": "C"}[remedy["by"]]
    cured = four_bar("".join(kinds.values())).report()
    assert "all 17 constraints of the joints are independent" in cured
    assert cured.to_dict()["mobility"] == 1 and cured.to_dict()["redundancy"] == ""
    assert "All components of all reactions are determined" in cured
    # once, in one paragraph
    assert report.count("Over-constrained") == 1 and "parallel" not in report.partition("Joints\n------")[2]


def test_moves_as_driven_is_not_cannot_move() -> None:
    m = four_bar()
    m.add_drive("A", position=lambda t: t, name="motor")
    report = " ".join(m.report().split())
    assert "has 1 degree of freedom, all prescribed by motor: it moves as driven" in report
    assert "cannot move" not in report
    frame = pt.Mechanism("frame")
    for name, start, end in (("left", (0, 0, 0), (0.3, 0.8, 0)), ("right", (1, 0, 0), (0.3, 0.8, 0))):
        frame.add_rod(name, start=start, end=end, mass=1.0)
        frame.add_revolute(f"foot of {name}", "ground", name, point=start)
    frame.add_revolute("top", "left", "right", point=(0.3, 0.8, 0))
    assert "cannot move" in frame.report()


def test_idle_spin_of_a_rod_between_balls() -> None:
    m = four_bar("RSSR")
    report = " ".join(m.report().split())
    assert "1 degree of freedom is idle: coupler spins about its own line between B and C" in report
    m = pt.Mechanism("thin")
    m.add_rod("crank", start=A, end=B, mass=1.0)
    m.add_rod("coupler", start=B, end=C, mass=1.0)
    m.add_body("rocker", mass=1.0, inertia=(0.1, 0.1, 0.1), position=D)
    m.add_revolute("A", m.ground, "crank", point=A)
    m.add_spherical("B", "crank", "coupler", point=B)
    m.add_spherical("C", "coupler", "rocker", point=C)
    m.add_revolute("D", m.ground, "rocker", point=D)
    report = " ".join(m.report().split())
    assert "which moves nothing else (it is held, without inertia about that line)" in report
    assert "coupler is held from spinning" in report
    m.add_force("coupler", (0, 0, 1), point=(0, 0.1, 0))
    report = " ".join(m.report().split())
    assert "held" not in report
    assert "no inertia: coupler about its own line between B and C can spin without resistance" in report
    assert "axial inertia" in report


def test_a_chain_of_forty_loops_is_a_page() -> None:
    report = pt.catalogue.load("n-four-bar", loops=40).report()
    assert len(report.splitlines()) < 90
    found = report.to_dict()
    assert len(found["coordinates"]) == 81 and len(found["remedies"]) == 80
    assert len(report.markdown.splitlines()) < 110


def test_text_markdown_dictionary_and_copies() -> None:
    report = four_bar().report()
    assert isinstance(report, str) and report.text == str(report)
    assert max(map(len, report.splitlines())) <= 120
    assert report.markdown.startswith('# Mechanism "four-bar"\n') and "## Reactions" in report.markdown
    assert "| C | revolute | coupler | rocker | closes a loop |" in report.markdown
    again = pickle.loads(pickle.dumps(report))
    assert again == report and again.markdown == report.markdown and again.to_dict() == report.to_dict()
    report.to_dict()["notes"].append("mine")
    assert "mine" not in report.to_dict()["notes"]


def test_suspicious_data() -> None:
    m = four_bar()
    m.add_torsion_spring("A", stiffness=1.0, angle=90.0)
    assert "90 degrees would be 1.570796 rad" in " ".join(m.report().split())
    m = four_bar()
    m.add_drive("D", position=90.0)
    with pytest.raises(pt.errors.AssemblyError, match=r"90 degrees would be 1\.570796 rad"):
        m.report()
    m = four_bar()
    m.add_rod("mast", start=(0, 0, 0), end=(0, 300, 0), mass=1.0)
    m.add_spherical("foot", m.ground, "mast", point=(0, 0, 0))
    m.add_rod("flag", start=(0, 300, 0), end=(0.5, 300, 0), mass=1.0)
    m.add_revolute("top", "mast", "flag", point=(0, 300, 0))
    m.add_body("stone", mass=1.0, inertia=(1, 1, 1))
    report = " ".join(m.report().split())
    assert "mast extends over 300 m, where bodies typically measure" in report
    assert "stone is connected by no joint: it floats freely" in report


def test_what_couplings_hold_does_not_float() -> None:
    m = pt.Mechanism("platform")
    m.add_body("platform", mass=1.0, inertia=(1, 1, 1), position=(0, 0, 1))
    m.add_body("stone", mass=1.0, inertia=(1, 1, 1), position=(5, 5, 5))
    for i, x in enumerate((-1.0, 0.0, 1.0)):
        m.add_distance(f"rod {i}", m.ground, (x, 0, 0), "platform", (0.5 * x, 0, 0))
    m.add_revolute("A", m.ground, m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0), point=(0, 0, 0))
    notes = m.report().to_dict()["notes"]
    assert [note for note in notes if "float" in note] == ["stone is connected by no joint: it floats freely"]
    assert "platform" not in " ".join(m.check().remarks)


def test_dead_position_and_locked_coordinate() -> None:
    m = pt.Mechanism("slider-crank")
    b, c = (1, 0, 0), (3, 0, 0)
    m.add_rod("crank", start=A, end=b, mass=1.0)
    m.add_rod("rod", start=b, end=c, mass=1.0)
    m.add_body("slider", mass=1.0, inertia=(1, 1, 1), position=c)
    m.add_prismatic("S", m.ground, "slider", axis=(1, 0, 0))
    m.add_revolute("A", m.ground, "crank", point=A)
    m.add_revolute("B", "crank", "rod", point=b)
    m.add_revolute("C", "rod", "slider", point=c, cut="always")
    report = m.report()
    assert report.to_dict()["dead"] == ["S"] and "Dead position of S" in report
    aside = m.report(m.assemble(targets={"A": 0.5}))
    assert aside.to_dict()["dead"] == [] and aside.to_dict()["locked"] == []


def test_the_certificate_says_who_and_when() -> None:
    m = four_bar()
    run = m.simulate(1.0, initial=m.assemble(rates={"A": 2.0}), t_eval=np.linspace(0, 1, 21))
    found, model = run.certificate, m.compile()
    accelerations = [
        np.abs(model.jacobian(q, t=t) @ a + model.bias(q, v, t=t))
        for t, q, v, a in zip(run.t, run.q, run.v, run.vdot, strict=True)
    ]
    assert found.acceleration_closure == pytest.approx(np.max(accelerations), abs=1e-13)
    assert found.acceleration_row in run.names.multipliers and found.closure_row in run.names.multipliers
    assert [body[0] for body in found.bodies] == list(run.names.bodies)
    assert max(worst for _, worst, _ in found.bodies) == found.newton_euler
    assert found.worst_body in run.names.bodies and found.worst_body_t in run.t
    assert found.rank == (2,) and 0.0 < found.margin < 1.0 and found.geometric_error == 0.0
    assert run.at_once.reactions["residuals"].shape == (21, 3)
    report = str(found)
    assert f"{found.worst_body} at t = " in report and "loops' rank       2; margin" in report


def test_the_certificate_of_a_chain_and_of_a_file(tmp_path: Path) -> None:
    run = pt.catalogue.load("n-four-bar", loops=40).simulate(0.05, t_eval=[0.0, 0.05])
    assert len(str(run.certificate).splitlines()) < 40
    run.save(tmp_path / "run.json")
    again = pt.results.load_result(tmp_path / "run.json").certificate
    assert (again.rank, again.bodies, again.closure_row) == (
        run.certificate.rank,
        run.certificate.bodies,
        run.certificate.closure_row,
    )
    assert again.acceleration_closure == run.certificate.acceleration_closure
    certificate = pt.simulate(pt.System(n=1, mass=np.eye(1), forces=(0.0,)), 0.1, [0.0], [1.0]).certificate
    assert certificate.acceleration_closure is None and certificate.bodies == () and certificate.rank == ()


def test_what_drives_move_is_not_called_locked() -> None:
    """Wheels on a belt of which one is driven: the other turns; beside them a free one, and a truss that stands."""
    m = pt.Mechanism("belt and drive", gravity=None)
    for name, x in (("a", 0.0), ("b", 1.0), ("c", 3.0)):
        m.add_body(name, mass=1.0, inertia=(1, 1, 1), position=(x, 0, 0))
        m.add_revolute(f"{name}j", m.ground, name, point=(x, 0, 0))
    m.add_gear("belt", "aj", "bj", ratio=2.0)
    m.add_drive("aj", velocity=3.0)
    corners = [(5.0, 0.0, 0.0), (6.0, 0.0, 0.0), (5.5, 1.0, 0.0)]
    for name, start in zip("xy", corners, strict=False):
        m.add_rod(name, start=start, end=corners[2], mass=1.0)
        m.add_revolute(f"{name}j", m.ground, name, point=start)
    m.add_revolute("top", "x", "y", point=corners[2])
    words = str(m.report())
    assert "Prescribed by the drives as well: bj." in words
    (locked,) = [line for line in words.splitlines() if line.startswith("Locked by the loops in any position")]
    assert "bj" not in locked and "xj" in locked
