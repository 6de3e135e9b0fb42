"""Rotors behind gears: a term of the mass matrix, in every form and in both kinds of coordinates."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita.errors import DescriptionError, FileFormatError, UnknownNameError

INERTIA, RATIO = 3e-4, 40.0
MOVED = INERTIA * RATIO**2
TIMES = np.linspace(0.0, 1.0, 21)
FORMS = (
    "projective", "wehage-haug", "explicit-closing", "zero-eigenvalue", "svd", "qr", "tangent-space", "multipliers",
    "sparse-multipliers", "range-space", "proximal",
)  # fmt: skip


def four_bar(rotor: str | None = "A", cut: str = "auto") -> pt.Mechanism:
    """A four-bar in its plane, turned out of the axes; the rotor is on one of its joints."""
    m = pt.Mechanism("four-bar", gravity=(0.0, -9.81, 0.0))
    crank = m.add_rod("crank", start=(0, 0, 0), end=(0.3, 0.4, 0), mass=1.0)
    coupler = m.add_rod("coupler", start=(0.3, 0.4, 0), end=(1.4, 0.9, 0), mass=2.0)
    rocker = m.add_rod("rocker", start=(1.2, 0, 0), end=(1.4, 0.9, 0), mass=1.5)
    m.add_revolute("A", m.ground, crank, point=(0, 0, 0))
    m.add_revolute("B", crank, coupler, point=(0.3, 0.4, 0), cut=cut)
    m.add_revolute("C", coupler, rocker, point=(1.4, 0.9, 0))
    m.add_revolute("D", m.ground, rocker, point=(1.2, 0, 0))
    if rotor is not None:
        m.add_rotor(rotor, INERTIA, ratio=RATIO)
    return m


def motion(m: pt.Mechanism, **options: Any) -> pt.Result:
    start = m.assemble(rates={"A": 2.0}, coordinates=options.get("coordinates", "relative"))
    run = m.simulate(1.0, t_eval=TIMES, initial=start, rtol=1e-11, atol=1e-12, **options)
    assert run.success, run.message
    return run


def test_a_geared_wheel_on_the_ground_is_the_same() -> None:
    """Beside the ground nothing distinguishes a rotor from a body on a hinge, coupled by a gear."""
    m, twin = four_bar(), four_bar(None)
    wheel = twin.add_body("wheel", mass=0.5, inertia=(2e-4, 2e-4, INERTIA), position=(-1, 0, 0))
    twin.add_revolute("W", twin.ground, wheel, point=(-1, 0, 0))
    twin.add_gear("A", "W", ratio=RATIO)
    run, other = motion(m), motion(twin)
    for name in "ABCD":
        a, b = run.joint(name), other.joint(name)
        assert np.abs(a.position - b.position).max() < 1e-8
        assert np.abs(a.acceleration - b.acceleration).max() < 1e-7
        assert np.abs(a.force - b.force).max() < 1e-6, name
    light = motion(four_bar(None))
    assert np.abs(run.joint("A").position[-1] - light.joint("A").position[-1]).max() > 0.1


@pytest.mark.parametrize("where", ["A", "C"])
@pytest.mark.parametrize("form", FORMS)
def test_every_formulation_moves_alike(where: str, form: str) -> None:
    m = four_bar(where)
    run, other = motion(m), motion(m, solver=pt.Solver(form))
    assert np.abs(run.v - other.v).max() < 1e-7
    assert np.abs(run.vdot - other.vdot).max() < 1e-6


@pytest.mark.parametrize("where", ["A", "B", "C", "D"])
def test_absolute_coordinates_move_alike(where: str) -> None:
    m = four_bar(where)
    run, other = motion(m), motion(m, coordinates="absolute")
    assert f"rotor of {where}" in other.names.coordinates
    for name in "ABCD":
        a, b = run.joint(name), other.joint(name)
        assert np.abs(a.position - b.position).max() < 1e-8
        assert np.abs(a.acceleration - b.acceleration).max() < 1e-6
        assert np.abs(a.force - b.force).max() < 1e-6, name
    converted = m.convert(run.state(0.35), "absolute")
    here = m.compile("absolute").at(converted.q, converted.v)
    assert np.abs(here.C @ converted.v + here.a).max() < 1e-9
    assert converted.q[-1] == pytest.approx(run.joint(where).position[7, 0], abs=1e-9)


def test_the_mass_matrix_gains_one_term() -> None:
    with_rotor, without = four_bar("A").compile(), four_bar(None).compile()
    q = four_bar(None).assemble({"A": 0.3}).q
    gain = with_rotor.at(q).M - without.at(q).M
    i = with_rotor.velocity_names.index("A")
    assert gain[i, i] == pytest.approx(MOVED, rel=1e-12)
    gain[i, i] = 0.0
    assert not gain.any()


def test_energy_is_kept_and_contains_the_rotor() -> None:
    run, bare = motion(four_bar("A")), four_bar(None)
    assert np.abs(run.energy.balance).max() < 1e-9
    masses = [bare.compile().at(q).M for q in run.q]
    same = np.array([0.5 * v @ mass @ v for v, mass in zip(run.v, masses, strict=True)])
    spin = run.joint("A").velocity[:, 0]
    assert np.abs(run.energy.kinetic - same - 0.5 * MOVED * spin**2).max() < 1e-10


def test_slides_feel_a_mass() -> None:
    """A spindle of lead h under a motor: the slide weighs as much more as (2 pi / h)^2 inertia."""
    m = pt.Mechanism("spindle", gravity=None)
    table = m.add_body("table", mass=2.0, inertia=(1, 1, 1))
    m.add_prismatic("S", m.ground, table, axis=(1, 0, 0))
    m.add_rotor("S", "30 g m^2", ratio="200 rad/m", name="motor")
    m.add_torque("S", 5.0)
    for coordinates in ("relative", "absolute"):
        run = m.simulate(1.0, coordinates=coordinates)
        assert run.joint("S").acceleration[-1, 0] == pytest.approx(5.0 / (2.0 + 0.03 * 200.0**2), rel=1e-9)


@pytest.mark.parametrize("build", [four_bar, lambda: four_bar("B", "always")])
def test_parameters_and_derivatives(build: Callable[[], pt.Mechanism]) -> None:
    m = build()
    name = next(iter(m.rotors))
    again = m.compile().with_parameters({f"{name}.inertia": 2.0 * INERTIA, f"{name}.ratio": -0.5 * RATIO})
    m.rotors[name].change(inertia=0.5 * INERTIA)
    start = m.assemble(rates={"A": 2.0})
    assert np.abs(again.at(start.q, start.v).vdot - m.compile().at(start.q, start.v).vdot).max() < 1e-10
    run = m.simulate(0.2, parameters={f"{name}.inertia": 3.0 * INERTIA}, initial=start)
    m.rotors[name].inertia = 3.0 * INERTIA
    assert np.abs(run.q - m.simulate(0.2, initial=start).q).max() < 1e-12


def test_rotors_are_elements(tmp_path: Path) -> None:
    m = four_bar()
    rotor = m.add_rotor("D", 1e-4, name="brake")
    assert (rotor.kind, rotor.joint, rotor.ratio, rotor.coordinate) == ("rotor", "D", 1.0, 0)
    assert list(m.rotors) == ["rotor of A", "brake"]
    m.save(tmp_path / "m.toml")
    for other in (pt.load(tmp_path / "m.toml"), copy.deepcopy(m), pickle.loads(pickle.dumps(m))):
        assert other.to_spec() == m.to_spec()
    with pytest.raises(DescriptionError, match="brake"):
        m.joints.remove("D")
    m.joints["D"].point = (1.2, 0.0, 0.0)
    m.rotors.remove("brake")
    assert list(m.rotors) == ["rotor of A"]
    run = motion(m)
    run.save(tmp_path / "run.nc")
    assert pt.load_result(tmp_path / "run.nc").spec == run.spec


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("A", 0.0), "inertia is 0; it must be greater than 0"),
        (("A", -1.0), "greater than 0"),
        (("A", float("nan")), "finite"),
        (("A", "3 kg"), "kg"),
        (("A", 1.0, {"ratio": 0.0}), "ratio is 0"),
        (("A", 1.0, {"ratio": float("inf")}), "finite"),
        (("A", 1.0, {"coordinate": 1}), "coordinate"),
        (("A", 1.0, {"name": "rotor of A"}), "rotor of A"),
    ],
)
def test_what_is_no_rotor_is_refused(arguments: tuple[Any, ...], message: str) -> None:
    m = four_bar()
    named = arguments[2] if len(arguments) > 2 else {}
    with pytest.raises(DescriptionError, match=message):
        m.add_rotor(*arguments[:2], **named)
    assert list(m.rotors) == ["rotor of A"]


def test_unknown_joints_and_balls_are_refused(tmp_path: Path) -> None:
    m = four_bar()
    with pytest.raises(UnknownNameError, match="Z"):
        m.add_rotor("Z", 1.0)
    ball = pt.Mechanism("ball")
    ball.add_spherical("S", ball.ground, ball.add_body("b", mass=1.0, inertia=(1, 1, 1)), point=(0, 0, 0))
    with pytest.raises(DescriptionError, match="spherical joint"):
        ball.add_rotor("S", 1.0)
    m.save(tmp_path / "m.toml")
    text = (tmp_path / "m.toml").read_text(encoding="utf-8").replace("ratio = 40.0", "ratoi = 40.0")
    (tmp_path / "wrong.toml").write_text(text, encoding="utf-8")
    with pytest.raises(FileFormatError, match="ratoi"):
        pt.load(tmp_path / "wrong.toml")


def test_a_driven_needs_the_torque_of_its_rotor() -> None:
    """The effort of a drive is that without rotor plus ratio^2 inertia times the acceleration; reactions are equal."""
    runs = []
    for rotor in ("A", None):
        m = four_bar(rotor)
        m.add_drive("A", lambda t: 0.5 * np.sin(3.0 * t) ** 2)
        run = m.simulate(1.0, t_eval=TIMES, rtol=1e-10)
        assert run.success, run.message
        runs.append(run)
    heavy, light = (run.joint("A") for run in runs)
    assert np.abs(heavy.drive - light.drive - MOVED * light.acceleration).max() < 1e-7
    for name in "ABCD":
        assert np.abs(runs[0].joint(name).force - runs[1].joint(name).force).max() < 1e-7
