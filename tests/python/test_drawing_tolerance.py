"""Drawings with a small geometric error: within the tolerance the intended mechanism, beyond it a named structure."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from drawings import EVERY
from numpy.typing import NDArray
from test_contradictions import rockers
from thorough import either

import partita as pt
from partita.errors import ArgumentError, AssemblyError, ContradictionError, DescriptionError, SingularityError

Vector = NDArray[np.float64]
BOTH = ["relative", "absolute"]
Z = np.array([0.0, 0.0, 1.0])


def bar(m: pt.Mechanism, name: str, start: Vector, end: Vector, mass: float) -> None:
    """A body between two points, its inertia the same about all axes."""
    size = float(np.linalg.norm(end - start))
    m.add_body(name, mass=mass, inertia=(0.1 * mass * size**2,) * 3, position=0.5 * (start + end))


def four_bar(off: float, scale: float = 1.0, **options: float) -> pt.Mechanism:
    """Hinge C tilted by `off` rad."""
    m = pt.Mechanism("four-bar", gravity=(0, -9.81 * scale, 0), **options)
    a, b, c, d = (scale * np.array(p) for p in ((0, 0, 0), (0, 0.3, 0), (0.8, 0.7, 0), (1.0, 0, 0)))
    bar(m, "crank", a, b, 0.3)
    bar(m, "coupler", b, c, 0.9)
    bar(m, "rocker", d, c, 0.7)
    m.add_revolute("A", m.ground, "crank", point=a, axis=Z)
    m.add_revolute("B", "crank", "coupler", point=b, axis=Z)
    m.add_revolute("C", "coupler", "rocker", point=c, axis=np.array([off, 0, 1.0]))
    m.add_revolute("D", m.ground, "rocker", point=d, axis=Z)
    return m


def five_bar(off: float) -> pt.Mechanism:
    """Two degrees of freedom in the plane, as a spatial drawing with hinge C tilted."""
    m = pt.Mechanism("five-bar")
    points = [np.array(p) for p in ((0, 0, 0), (-0.3, 0.8, 0), (0.5, 1.5, 0), (1.3, 0.9, 0), (1.0, 0, 0))]
    for i in range(4):
        bar(m, f"bar{i}", points[i], points[i + 1], 1.0)
    links = [(m.ground, "bar0"), ("bar0", "bar1"), ("bar1", "bar2"), ("bar2", "bar3"), (m.ground, "bar3")]
    for i, (parent, child) in enumerate(links):
        m.add_revolute("ABCDE"[i], parent, child, point=points[i], axis=Z + off * (i == 2) * np.array([1.0, 0.3, 0]))
    return m


def three_cranks(off: float) -> pt.Mechanism:
    """Three parallel cranks, one of their hinges tilted."""
    m = pt.Mechanism("three cranks")
    pins = [np.array([x, 0, 0]) for x in (0.0, 1.0, 2.5)]
    tops = [pin + np.array([0.3, 1.0, 0]) for pin in pins]
    bar(m, "coupler", tops[0], tops[2], 1.0)
    for i, (pin, top) in enumerate(zip(pins, tops, strict=True)):
        bar(m, f"crank{i}", pin, top, 1.0)
        m.add_revolute(f"A{i}", m.ground, f"crank{i}", point=pin)
        axis = np.array([off if i == 1 else 0.0, 0, 1.0])
        m.add_revolute(f"{'C' if i == 1 else 'B'}{i}", f"crank{i}", "coupler", point=top, axis=axis)
    return m


def bennett(off: float) -> pt.Mechanism:
    """It moves by its dimensions alone: an axis and a hinge point are off."""
    a, b, alpha = 1.0, 1.6, 0.6
    beta = np.arcsin(b * np.sin(alpha) / a)

    def step(angle: float, length: float, twist: float) -> NDArray[np.float64]:
        c, s, ct, st = np.cos(angle), np.sin(angle), np.cos(twist), np.sin(twist)
        rows = [[c, -s * ct, s * st, length * c], [s, c * ct, -c * st, length * s], [0, st, ct, 0], [0, 0, 0, 1]]
        return np.array(rows)

    first = 0.9
    second = 2.0 * np.arctan2(np.sin((beta + alpha) / 2) / np.sin((beta - alpha) / 2), np.tan(first / 2))
    pose, points, axes = np.eye(4), [], []
    for angle, link in ((first, (a, alpha)), (second, (b, beta)), (-first, (a, alpha)), (-second, (b, beta))):
        points.append(pose[:3, 3].copy())
        axes.append(pose[:3, 2].copy())
        pose = pose @ step(angle, *link)
    assert np.abs(pose - np.eye(4)).max() < 1e-14
    m = pt.Mechanism("bennett", gravity=(0, 0, -9.81))
    for i in range(1, 4):
        bar(m, f"link{i}", points[i], points[(i + 1) % 4], 1.0)
    m.add_revolute("A", m.ground, "link1", point=points[1], axis=axes[1])
    m.add_revolute("B", "link1", "link2", point=points[2], axis=axes[2] + off * np.array([0.3, 0.5, -0.2]))
    m.add_revolute("C", "link2", "link3", point=points[3] + off * np.array([0.2, 0.4, 0.1]), axis=axes[3])
    m.add_revolute("D", "link3", m.ground, point=points[0], axis=axes[0])
    return m


@pytest.mark.parametrize("coordinates", BOTH)
@pytest.mark.parametrize(
    ("make", "mobility", "named"),
    [(four_bar, 1, True), (five_bar, 2, True), (three_cranks, 1, True), (bennett, 1, False)],
)
def test_within_the_tolerance_it_moves_as_repaired(
    make: Callable[[float], pt.Mechanism], mobility: int, named: bool, coordinates: str
) -> None:
    nominal = make(0.0).simulate(0.4, coordinates=coordinates, rtol=1e-9)
    joint = next(name for name in make(0.0).joints if name.startswith("C"))
    force, known = nominal.joint(joint).force, nominal.joint(joint).determined
    for off in (1e-14, 1e-9, 1e-8, 1e-6, 1e-5, 1e-4):
        m = make(off)
        assert m.compile(coordinates=coordinates).mobility == mobility, off
        run = m.simulate(0.4, coordinates=coordinates, rtol=1e-9)
        certificate = run.certificate
        assert run.success and certificate.verdict == "valid", (off, certificate.findings)
        body = run.body(next(iter(m.bodies))).position - nominal.body(next(iter(m.bodies))).position
        # what a misfit moves others by, where rows and joints make the most of it; below, the error of the march
        assert np.abs(body).max() < 30.0 * off + 1e-7, off
        assert np.array_equal(run.joint(joint).determined, known), off
        sure = known[:3]
        assert np.abs(run.joint(joint).force - force)[:, sure].max(initial=0.0) < 1e3 * off + 1e-5, off
        assert certificate.geometric_error <= 5.0 * off + 1e-11
        if off >= 1e-9:
            assert certificate.geometric_error > 0.0 and "geometric error" in str(certificate)
            report = str(m.report(coordinates=coordinates))
            words = (
                f"{joint} is {np.degrees(off * (1.044 if make is five_bar else 1.0)):.3f} deg out of parallel with A"
            )
            assert "the geometry is inexact" in report
            if named and off == 1e-4:
                assert words in report and any(words in note for note in certificate.notes)


@pytest.mark.parametrize("coordinates", BOTH)
def test_beyond_the_tolerance_it_is_a_structure_that_is_named(coordinates: str) -> None:
    for off in (1e-3, 1e-2):
        model = four_bar(off).compile(coordinates=coordinates)
        assert model.mobility == 0
        report = " ".join(four_bar(off).report(coordinates=coordinates).split())
        assert "a structure only because of a geometric error" in report
        assert f"C is {np.degrees(off):.3f} deg out of parallel with A, B and D" in report
        assert "1 degree of freedom" in report and "drawing_tolerance" in report
    # the hinge that is tilted locks; the others go on
    assert five_bar(1e-3).compile(coordinates=coordinates).mobility == 1
    report = " ".join(five_bar(1e-3).report(coordinates=coordinates).split())
    assert "less mobile only because of a geometric error" in report
    assert four_bar(1e-3, drawing_tolerance=1e-3).compile(coordinates=coordinates).mobility == 1


@pytest.mark.parametrize("coordinates", BOTH)
@pytest.mark.parametrize("off", [1e-6, 1e-5])
def test_a_tolerance_of_nothing_means_every_digit(off: float, coordinates: str) -> None:
    exact = four_bar(off, drawing_tolerance=1e-9)
    assert exact.compile(coordinates=coordinates).mobility == 0
    if off == 1e-5:  # weaker ones cannot be distinguished from a singular position by numbers of sixteen digits
        assert "out of parallel" in " ".join(exact.report(coordinates=coordinates).split())


@pytest.mark.parametrize("coordinates", BOTH)
def test_a_structure_too_weak_for_its_reactions_is_reported_as_one(coordinates: str) -> None:
    """Held by a condition that adds 1e-6 to the others: the report knows; what cannot be computed is refused."""
    m = four_bar(1e-6, drawing_tolerance=1e-9)
    found = m.report(coordinates=coordinates).to_dict()
    assert found["mobility"] == 0 and found["singular"] is None
    assert any("out of parallel" in words for words in found["geometric_errors"])
    assert "give a larger drawing_tolerance" in " ".join(m.report(coordinates=coordinates).split())
    try:
        run = m.simulate(0.1, coordinates=coordinates)
    except ArgumentError as error:
        assert error.argument == "drawing_tolerance" and "cannot move" in str(error)
    else:
        assert any("cannot move" in note for note in run.notes)


@pytest.mark.parametrize("coordinates", BOTH)
def test_a_run_of_a_structure_says_that_it_cannot_move(coordinates: str) -> None:
    run = four_bar(1e-3).simulate(0.1, coordinates=coordinates)
    assert run.success and any("cannot move" in note for note in run.notes)
    assert any("C is 0.057 deg out of parallel" in note for note in run.notes)
    assert "cannot move" in str(run.certificate)
    driven = four_bar(1e-5)
    driven.add_drive("A", position=lambda t: 0.1 * t)
    assert not any("cannot move" in note for note in driven.simulate(0.1, coordinates=coordinates).notes)


@pytest.mark.parametrize("make", [four_bar, five_bar, three_cranks, bennett])
def test_one_verdict_in_both_kinds_of_coordinates(make: Callable[[float], pt.Mechanism]) -> None:
    """Up to the tolerance, beyond it and in between, where the verdict changes."""
    for off in either((1e-4, 2e-4, 5e-4, 1e-3, 1e-2), (1e-4, 1.5e-4, 2e-4, 3e-4, 5e-4, 7e-4, 1e-3, 3e-3, 1e-2)):
        found = [make(off).report(coordinates=c).to_dict() for c in BOTH]
        assert found[0]["mobility"] == found[1]["mobility"], off
        assert found[0]["geometric_error"] == pytest.approx(found[1]["geometric_error"], rel=1e-6), off
        assert found[0]["geometric_error"] > 0.0 and found[0]["geometric_errors"], off
    nominal = make(0.0).compile().mobility
    assert make(1e-4).compile().mobility == nominal and make(1e-3).compile().mobility == nominal - 1


@pytest.mark.parametrize("scale", [1e-6, 1e3])
def test_of_any_size(scale: float) -> None:
    run = four_bar(1e-5, scale).simulate(0.3)
    one = four_bar(1e-5).simulate(0.3)
    assert run.success and run.certificate.verdict == "valid"
    assert run.certificate.geometric_error == pytest.approx(one.certificate.geometric_error, rel=1e-3)


@pytest.mark.parametrize("formulation", EVERY)
def test_every_formulation(formulation: str) -> None:
    nominal = four_bar(0.0).simulate(0.3, solver=pt.Solver(formulation))
    run = four_bar(1e-5).simulate(0.3, solver=pt.Solver(formulation))
    assert run.success and run.certificate.verdict == "valid", run.certificate.findings
    assert np.abs(run.body("rocker").position - nominal.body("rocker").position).max() < 1e-4


def rounded(digits: int) -> pt.Mechanism:
    """A four-bar in a tilted plane, where each joint sits on either body rounded by itself."""
    rng = np.random.default_rng(5)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    a, b, c, d = (turn @ p for p in ((0, 0, 0), (0, 0.3, 0), (0.8, 0.7, 0), (1.0, 0, 0)))
    m = pt.Mechanism("rounded")
    bar(m, "crank", a, b, 0.3)
    bar(m, "coupler", b, c, 0.9)
    bar(m, "rocker", d, c, 0.7)

    def cut(x: Vector) -> Vector:
        return np.round(x + 0.5 * 10.0**-digits * rng.uniform(-1, 1, 3), digits)

    pairs = [(m.ground, "crank", a), ("crank", "coupler", b), ("coupler", "rocker", c), (m.ground, "rocker", d)]
    for name, (parent, child, point) in zip("ABCD", pairs, strict=True):
        sides = [cut(x) for x in (point, turn @ Z, point, turn @ Z)]
        m.add_revolute(name, parent, child, point=sides[0], axis=sides[1], child_point=sides[2], child_axis=sides[3])
    return m


@pytest.mark.parametrize("coordinates", BOTH)
def test_rounded_drawings_assemble_and_run(coordinates: str) -> None:
    """Rounded to four digits no position closes all conditions; the motion is the exact one within that."""
    exact = rounded(14).simulate(0.5, coordinates=coordinates).body("coupler").position
    for digits in (12, 8, 6, 5, 4):
        m = rounded(digits)
        assert m.compile(coordinates=coordinates).mobility == 1, digits
        run = m.simulate(0.5, coordinates=coordinates)
        assert run.success and run.certificate.verdict == "valid", (digits, run.certificate.findings)
        assert np.abs(run.body("coupler").position - exact).max() < 20.0 * 10.0**-digits + 1e-7, digits
        assert m.report(coordinates=coordinates)
        if coordinates == "relative":
            assert m.assemble({"A": 0.3}).q[0] == pytest.approx(0.3)


@pytest.mark.parametrize("coordinates", BOTH)
def test_a_rocker_of_slightly_wrong_length(coordinates: str) -> None:
    run = rockers(1e-6, 1e-4).simulate(0.4, coordinates=coordinates)
    assert run.success and run.certificate.verdict == "valid" and run.certificate.geometric_error <= 1e-6
    try:
        run = rockers(2e-2, 1e-4).simulate(0.4, coordinates=coordinates)
    except SingularityError as error:
        assert "it is a structure" in str(error)
    else:
        assert not run.success or np.ptp(run.q, axis=0).max() < 1e-9  # stopped by what it misfits, or a structure


@pytest.mark.parametrize("coordinates", BOTH)
def test_a_geometric_error_beyond_the_tolerance_ends_the_run(coordinates: str) -> None:
    """As drawn, where it hardly shows; farther on the third rocker contradicts the others."""
    run = rockers(5e-3, 1e-4).simulate(2.0, coordinates=coordinates)
    assert run.status == "contradiction" and not run.success and "no motion satisfies them all" in run.message


def test_drives_are_never_relaxed() -> None:
    m = four_bar(1e-5)
    m.add_drive("A", position=lambda t: 0.1 * t)
    m.add_drive("D", position=lambda t: 0.1 * t)
    with pytest.raises(ContradictionError):
        m.simulate(0.5)
    m = four_bar(1e-5)
    m.add_drive("A", position=lambda t: 0.5 * t)
    run = m.simulate(0.5)
    assert run.success and run.certificate.verdict == "valid" and run.certificate.geometric_error > 0.0


def test_the_tolerance_is_kept_in_files(tmp_path: Path) -> None:
    m = four_bar(1e-6, drawing_tolerance=3e-5)
    m.save(tmp_path / "four-bar.toml")
    assert pt.load(tmp_path / "four-bar.toml").drawing_tolerance == 3e-5
    four_bar(1e-6).save(tmp_path / "usual.toml")
    assert pt.load(tmp_path / "usual.toml").drawing_tolerance == 1e-4
    for wrong in (-1.0, 0.1, float("nan"), "fine"):
        with pytest.raises(DescriptionError, match="drawing_tolerance"):
            pt.Mechanism("m", drawing_tolerance=wrong)  # type: ignore[arg-type]


def cranks_to_lie_flat(off: float, tilted: int, driven: bool) -> pt.Mechanism:
    """Three equal cranks at unequal distances, a hinge of one of them tilted, on their way through flat positions."""
    m = pt.Mechanism("cranks")
    turned = np.array([np.cos(0.5), np.sin(0.5), 0.0])
    pins = [np.array([x, 0.0, 0.0]) for x in (0.0, 1.0, 2.5)]
    bar(m, "coupler", pins[0] + turned, pins[2] + turned, 1.0)
    for i, pin in enumerate(pins):
        bar(m, f"crank{i}", pin, pin + turned, 1.0)
        m.add_revolute(f"A{i}", m.ground, f"crank{i}", point=pin)
        axis = Z + off * (i == tilted) * np.array([1.0, 0.3, 0.0])
        m.add_revolute(f"B{i}", f"crank{i}", "coupler", point=pin + turned, axis=axis)
    if driven:
        m.add_drive("A0", position=lambda t: -t)
    return m


@pytest.mark.parametrize("coordinates", BOTH)
@pytest.mark.parametrize(("tilted", "driven"), [(0, False), (1, False), (2, True)])
def test_cranks_pass_their_flat_positions_on_their_branch(tilted: int, driven: bool, coordinates: str) -> None:
    """Next to them the tilt says more than what closes the mechanism as it was meant: neither may it be taken for a
    condition, nor followed into the branch that nearly meets the one in use."""
    options = {"coordinates": coordinates, "t_eval": np.linspace(0.0, 2.0, 21)}
    nominal = cranks_to_lie_flat(0.0, tilted, driven).simulate(2.0, **options)
    path = np.stack([nominal.body(f"crank{i}").position for i in range(3)])
    assert np.abs(path[1] - path[0] - [1.0, 0.0, 0.0]).max() < 1e-7  # a parallelogram still
    assert path[0, :, 1].min() < -0.1  # through the flat position
    for off in (1e-14, 1e-8, 1e-6, 1e-4):
        run = cranks_to_lie_flat(off, tilted, driven).simulate(2.0, **options)
        assert run.success and run.certificate.verdict == "valid", (off, run.message, run.certificate.findings)
        there = np.stack([run.body(f"crank{i}").position for i in range(3)])
        assert np.abs(there - path).max() < 100.0 * off + 1e-5, off


def hinged_delta(off: float, **options: float) -> pt.Mechanism:
    """Clavel's robot with four hinges in each forearm, one of them tilted."""
    m = pt.Mechanism("hinged delta", gravity=(0, 0, -9.81), **options)
    under = np.array([0, 0, -0.5])
    m.add_body("platform", mass=0.4, inertia=(1e-3,) * 3, position=under)
    for leg in range(3):
        angle = 2.0 * np.pi * leg / 3.0
        out, across = np.array([np.cos(angle), np.sin(angle), 0.0]), np.array([-np.sin(angle), np.cos(angle), 0.0])
        shoulder, elbow, seat = 0.2 * out, 0.45 * out + [0, 0, -0.1], 0.05 * out + under
        normal, half = np.cross(across, (seat - elbow) / np.linalg.norm(seat - elbow)), 0.04 * across
        bar(m, f"arm{leg}", shoulder, elbow, 0.5)
        bar(m, f"upper{leg}", elbow - half, elbow + half, 0.05)
        bar(m, f"lower{leg}", seat - half, seat + half, 0.05)
        m.add_revolute(f"A{leg}", m.ground, f"arm{leg}", point=shoulder, axis=across)
        m.add_revolute(f"B{leg}", f"arm{leg}", f"upper{leg}", point=elbow, axis=across)
        for side, name in ((-1, "a"), (1, "b")):
            bar(m, f"rod{leg}{name}", elbow + side * half, seat + side * half, 0.1)
            tilt = 0.6 * across + 0.8 * np.cross(normal, across) if (leg, name) == (0, "a") else 0.0
            first, last = elbow + side * half, seat + side * half
            m.add_revolute(f"C{leg}{name}", f"upper{leg}", f"rod{leg}{name}", point=first, axis=normal + off * tilt)
            m.add_revolute(f"D{leg}{name}", f"rod{leg}{name}", f"lower{leg}", point=last, axis=normal)
        m.add_revolute(f"E{leg}", f"lower{leg}", "platform", point=seat, axis=across)
    return m


@pytest.mark.parametrize("coordinates", either(["absolute"], BOTH))
def test_shared_reactions_balance_within_the_geometric_error(coordinates: str) -> None:
    """Self-stresses are those of the intended mechanism; where nothing opens along the motion they still are."""
    for off in either((0.0, 1e-4), (0.0, 1e-7, 1e-4)):
        run = hinged_delta(off).simulate(0.2, coordinates=coordinates, t_eval=np.linspace(0.0, 0.2, 9))
        assert run.certificate.verdict == "valid", (off, run.certificate.findings)
        assert run.certificate.newton_euler <= 0.5 * off + 1e-10


@pytest.mark.parametrize("coordinates", either(["relative"], BOTH))
def test_a_geometric_error_beyond_a_fine_tolerance_is_no_self_stress(coordinates: str) -> None:
    """Too weak for the rank at one position, but a condition: what holds is not shared as if it were redundant. An
    error of which rounding leaves no more than a digit is refused, with the cure, or nothing of it was left."""
    m = hinged_delta(1e-5, drawing_tolerance=1e-9)
    assert m.compile(coordinates=coordinates).mobility == 2
    run = m.simulate(0.2, coordinates=coordinates, t_eval=np.linspace(0.0, 0.2, 9))
    assert run.certificate.verdict == "valid", run.certificate.findings
    assert run.certificate.newton_euler < 1e-9
    m = hinged_delta(1e-7, drawing_tolerance=1e-9)
    try:
        run = m.simulate(0.1, coordinates=coordinates)
    except (ArgumentError, AssemblyError) as refused:
        assert "a larger drawing_tolerance" in str(refused)
    else:  # to rounding it is the mechanism as it was meant
        assert m.compile(coordinates=coordinates).mobility == 3
        assert run.certificate.verdict == "valid", run.certificate.findings
