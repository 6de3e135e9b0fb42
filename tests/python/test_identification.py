"""Identification: exact ranks, derivatives against other evaluations, estimates against the numbers behind the data."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from identified import five_bar, four_bar, log_of, other_numbers, sines, slider_crank
from numpy.typing import NDArray

import partita as pt
from partita.builder.regression import least_squares, regressor
from partita.errors import ArgumentError, DescriptionError, FileFormatError, MissingFileError, UnknownNameError
from partita.mechanism.identified import Parameters, parameters_of

Array = NDArray[np.float64]
ROOT = Path(__file__).parents[2]


def _example() -> Any:
    found = importlib.util.spec_from_file_location("identification_example", ROOT / "examples" / "identification.py")
    assert found is not None and found.loader is not None
    example = importlib.util.module_from_spec(found)
    found.loader.exec_module(example)
    return example


EXAMPLE = _example()
leg = EXAMPLE.mechanism
GROUND = ["ground.force.x", "ground.force.y"]
FOUR_BAR_UNSEEN = {"crank.mass", "rocker.mass"}
INERTIAS = {"crank.inertia_about_A.zz", "coupler.inertia_about_B.zz", "rocker.inertia_about_D.zz"}
ON_LINES = [
    f"{body}.{word}"
    for body, pin in (("crank", "A"), ("coupler", "B"), ("rocker", "D"))
    for word in ("mass", "first_moment.x", f"inertia_about_{pin}.zz")
]

# Computed beside this project from the equations of motion in 70 digits, by the rank of regressors at random states.
RANKS: dict[str, tuple[Any, dict[str, Any], int, int, set[str]]] = {
    "torque": (four_bar, {}, 12, 8, FOUR_BAR_UNSEEN),
    "without gravity": (
        lambda: four_bar(gravity=None),
        {},
        12,
        4,
        FOUR_BAR_UNSEEN | {f"{body}.first_moment.{axis}" for body in ("crank", "rocker") for axis in "xy"},
    ),
    "force of the ground": (four_bar, {"measured": ["effort.A", *GROUND]}, 12, 9, set()),
    "statics": (four_bar, {"motion": "rest"}, 12, 4, FOUR_BAR_UNSEEN | INERTIAS),
    "centres on the lines": (four_bar, {"by": ON_LINES}, 9, 5, FOUR_BAR_UNSEEN),
    "five-bar": (five_bar, {"actuators": ["A", "E"]}, 16, 11, {"left.mass", "right.mass"}),
    "five-bar, ground": (
        five_bar,
        {"actuators": ["A", "E"], "measured": ["effort.A", "effort.E", *GROUND]},
        16,
        12,
        set(),
    ),
    "slider-crank": (
        slider_crank,
        {},
        12,
        6,
        {"crank.mass", "slider.first_moment.x", "slider.first_moment.y", "slider.inertia_about_S.zz"},
    ),
    "leg": (leg, {"actuators": ["hip", "motor"]}, 24, 16, {"thigh.mass", "lever.mass"}),
    "leg, ground": (
        leg,
        {"actuators": ["hip", "motor"], "measured": ["effort.hip", "effort.motor", *GROUND]},
        24,
        17,
        set(),
    ),
    "leg, statics": (
        leg,
        {"actuators": ["hip", "motor"], "motion": "rest"},
        24,
        8,
        {"thigh.mass", "lever.mass"}
        | {
            f"{body}.inertia_about_{pin}.zz"
            for body, pin in (
                ("thigh", "hip"),
                ("lever", "motor"),
                ("rod", "pin"),
                ("shank", "knee"),
                ("foot", "ankle"),
                ("link", "guide"),
            )
        },
    ),
}


@pytest.mark.parametrize("case", RANKS)
def test_ranks_are_those_of_seventy_digits(case: str) -> None:
    make, arguments, numbers, rank, unseen = RANKS[case]
    found = make().identifiability(**{"actuators": ["A"], **arguments})
    assert (len(found.labels), found.rank, set(found.never)) == (numbers, rank, unseen)
    assert len(found.combinations) == rank and found.gap > 1e6 and not found.notes
    assert set(found.labels) == {*found.never, *found.together, *found.alone}


def test_a_parallelogram_determines_three_combinations() -> None:
    """Its coupler does not turn, so the torque is (J1 + J3 + l^2 m2) a'' + g (X cos a - Y sin a) with
    X = x1 + x3 + l m2 and Y = y1 + y3, in axes of the links: three independent functions of the motion."""
    m = four_bar(0.4, 0.9, 0.4, 0.9)
    found = m.identifiability(actuators=["A"])
    assert found.rank == 3 and found.gap > 1e6
    assert set(found.never) >= {"coupler.first_moment.x", "coupler.first_moment.y", "coupler.inertia_about_B.zz"}
    terms = {frozenset((label, round(factor, 9)) for label, factor in one.terms.items()) for one in found.combinations}
    assert terms == {
        frozenset({("crank.inertia_about_A.zz", 1.0), ("rocker.inertia_about_D.zz", 1.0), ("coupler.mass", 0.16)}),
        frozenset({("crank.first_moment.x", 1.0), ("rocker.first_moment.x", 1.0), ("coupler.mass", 0.4)}),
        frozenset({("crank.first_moment.y", 1.0), ("rocker.first_moment.y", 1.0)}),
    }


def derivatives(m: pt.Mechanism, p: Parameters, path: Any, channels: list[Any], actuators: list[str], held: list[str]):
    """By the core, with the given coordinates held."""
    model = m.compile()
    names = [*actuators, *(name for name in held if name not in actuators)]
    seen = model._with_actuators(names)[0], [names.index(name) for name in held]
    inverse = model._with_actuators(actuators)[0]
    return regressor(inverse, seen, path, dict(p.numbers), p.directions(), channels)


def evaluated(m: pt.Mechanism, p: Parameters, levels: list[dict[str, Array]], actuators: list[str], joints: list[str]):
    """Efforts, force of the ground through these joints, and reaction of the first joint, by inverse dynamics."""
    k = m.kinematics(*levels, parameters=p.numbers)
    motion = SimpleNamespace(t=k.t, q=k.q, v=k.v, vdot=k.vdot, names=k.names)
    d = m.inverse_dynamics(motion, actuators, parameters=p.numbers)
    force = sum(d.joint(joint).force for joint in joints)
    arms = [np.cross(d.joint(joint).point, d.joint(joint).force) + d.joint(joint).moment for joint in joints]
    columns = [d.effort(name)[:, None] for name in actuators]
    return np.hstack([*columns, force, sum(arms), d.joint(joints[0]).force]), (k.t, k.q, k.v, k.vdot)


def sprung() -> pt.Mechanism:
    m = four_bar()
    m.add_spring("s", "coupler", (0.5, 0.1, 0.0), m.ground, (0.4, 0.9, 0.0), stiffness=40.0, damping=3.0, length=0.2)
    return m


GEOMETRY = ["B.point.x", "C.point", "D.point", "s.stiffness", "s.damping", "s.length", "coupler.com.x", "crank.mass"]


@pytest.mark.parametrize(("actuators", "held"), [(["A"], ["A"]), (["A"], ["C"]), (["C"], ["B"])])
def test_derivatives_are_those_of_inverse_dynamics(actuators: list[str], held: list[str]) -> None:
    """Central differences of another evaluation, positions closed anew with each number: lengths, springs, dampings,
    masses; measured coordinates in the tree and across the cut."""
    m = sprung()
    p = parameters_of(m.compile(), GEOMETRY)
    t = np.linspace(0.0, 2.0, 9)
    course = sines(t, [0.08, 0.04], [0.4, 1.0], [0.3, 1.0])
    levels = [{held[0]: course[i]} for i in range(3)]
    joints = ["A", "D"]
    values, path = evaluated(m, p, levels, actuators, joints)
    channels = [{"effort": 0}, *({"ground": i} for i in range(6)), *({"joint": [0, i]} for i in range(3))]
    found, slopes, gaps = derivatives(m, p, path, channels, actuators, held)
    assert not any(gaps)
    np.testing.assert_allclose(found, values, rtol=1e-9, atol=1e-9)
    for i, label in enumerate(p.labels):
        # where the errors of a central difference meet: h^2 of the third derivative, rounding / h
        h = 1e-5 * p.scales[i]
        shifted = [p.values + x * np.eye(len(p.labels))[i] for x in (h, -h)]
        ahead, behind = (evaluated(m, p.changed(x), levels, actuators, joints)[0] for x in shifted)
        expected = (ahead - behind) / (2.0 * h)
        np.testing.assert_allclose(
            slopes[:, :, i], expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max(), err_msg=label
        )


def test_inertial_derivatives_of_a_spatial_mechanism_are_exact() -> None:
    """Forces are linear in (m, m c, J about a point): a difference over any step is the derivative."""
    m = pt.Mechanism("wrist", gravity="-z")
    arm = m.add_body("arm", mass=2.0, com=(0.1, 0.2, 0.3), inertia=(0.5, 0.6, 0.7))
    palm = m.add_body("palm", mass=1.0, com=(0.0, 0.1, 0.5), inertia=(0.3, 0.2, 0.4), position=(0, 0, 0.6))
    m.add_revolute("A", m.ground, arm, axis=(0, 0, 1), point=(0, 0, 0))
    m.add_revolute("B", arm, palm, axis=(0.6, 0.8, 0), point=(0, 0.1, 0.6))
    p = parameters_of(m.compile(), None)
    assert len(p.labels) == 20
    t = np.linspace(0.0, 1.0, 7)
    courses = {"A": sines(t, [0.8], [0.7], [0.1]), "B": sines(t, [0.9], [0.9], [1.0])}
    levels = [{name: course[i] for name, course in courses.items()} for i in range(3)]
    values, path = evaluated(m, p, levels, ["A", "B"], ["A"])
    channels = [
        {"effort": 0},
        {"effort": 1},
        *({"ground": i} for i in range(6)),
        *({"joint": [0, i]} for i in range(3)),
    ]
    found, slopes, _ = derivatives(m, p, path, channels, ["A", "B"], [])
    np.testing.assert_allclose(found, values, atol=1e-11)
    for i, label in enumerate(p.labels):
        step = 0.02 * p.scales[i]
        other = p.changed(p.values + step * np.eye(20)[i])
        expected = (evaluated(m, other, levels, ["A", "B"], ["A"])[0] - values) / step
        np.testing.assert_allclose(slopes[:, :, i], expected, atol=1e-9 * np.abs(slopes).max(), err_msg=label)
    # ten numbers of a first body that turns about a fixed vertical axis: its moment of inertia about the axis alone
    assert m.identifiability(actuators=["A", "B"]).rank == 8


def test_a_rod_that_spins_about_itself_needs_no_actuator() -> None:
    """Its spin goes on as it will; numbers by which it stays round, by inverse dynamics, which lets it spin as well."""
    m = pt.catalogue.load("rssr")
    round_rod = ["coupler.mass", "coupler.first_moment.x", "coupler.inertia_about_P.xx"]
    p = parameters_of(m.compile(), [*round_rod, "rocker.mass", "crank.com.y"])
    t = np.linspace(0.0, 1.0, 5)
    course = sines(t, [0.3], [0.9], [0.2])
    levels = [{"A": course[i]} for i in range(3)]
    values, path = evaluated(m, p, levels, ["A"], ["A", "D"])
    channels = [{"effort": 0}, *({"ground": i} for i in range(6)), *({"joint": [0, i]} for i in range(3))]
    found, slopes, gaps = derivatives(m, p, path, channels, ["A"], ["A"])
    assert not any(gaps)
    np.testing.assert_allclose(found, values, atol=1e-9)
    for i, label in enumerate(p.labels):
        h = 1e-6 * p.scales[i]
        shifted = [p.changed(p.values + x * np.eye(len(p.labels))[i]) for x in (h, -h)]
        ahead, behind = (evaluated(m, x, levels, ["A"], ["A", "D"])[0] for x in shifted)
        expected = (ahead - behind) / (2.0 * h)
        np.testing.assert_allclose(slopes[:, :, i], expected, atol=1e-6 * np.abs(slopes).max(), err_msg=label)
    known = m.identifiability(actuators=["A"])
    assert 0 < known.rank < 30 and known.gap > 1e3


def test_what_is_not_determined_changes_no_torque() -> None:
    """Along a change of parameters that keeps every combination the torques stay, by inverse dynamics with them."""
    m = leg()
    found = m.identifiability(actuators=["hip", "motor"])
    p = parameters_of(m.compile(), None)
    rows = np.zeros((found.rank, len(found.labels)))
    for row, one in enumerate(found.combinations):
        for label, factor in one.terms.items():
            rows[row, found.labels.index(label)] = factor
    null = np.linalg.svd(rows * p.scales)[2][found.rank :]
    t = np.linspace(0.0, 3.0, 40)
    courses = {"hip": sines(t, [0.1], [0.5], [0.0]), "motor": sines(t, [0.1], [0.7], [1.0])}
    before = log_of(m, t, courses)
    for direction in (null[0], null[-1], null.sum(axis=0)):
        other = p.changed(p.values + 0.05 * p.scales * direction)
        after = log_of(m, t, courses, dict(other.numbers))
        for name in ("effort.hip", "effort.motor"):
            np.testing.assert_allclose(after[name], before[name], atol=1e-9 * np.abs(before[name]).max())
        assert any(abs(after_x - x).max() > 1e-3 for after_x, x in zip(other.values, p.values, strict=True))


def true_values(m: pt.Mechanism, numbers: Any, combinations: Any) -> Array:
    """The combinations by the numbers that made the data."""
    p = parameters_of(m.compile().with_parameters(numbers), None)
    values = dict(zip(p.labels, p.values, strict=True))
    return np.array([sum(x * values[label] for label, x in one.terms.items()) for one in combinations])


TIMES = np.linspace(0.0, 4.0, 401)
COURSE = {"A": sines(TIMES, [0.4, 0.2], [0.5, 1.3], [0.0, 1.0])}


def test_exact_data_give_exact_combinations_and_the_same_torques_elsewhere() -> None:
    m = four_bar()
    numbers = other_numbers(m, 3)
    found = m.identify(log_of(m, TIMES, COURSE, numbers))
    estimates = np.array([one.estimate for one in found.combinations])
    np.testing.assert_allclose(estimates, true_values(m, numbers, found.combinations), atol=1e-8)
    assert found.rank == 8 and not found.warnings and not found.drowned and found.iterations == 1
    # another motion
    other = {"A": sines(TIMES, [0.5], [0.8], [2.0])}
    np.testing.assert_allclose(
        log_of(m, TIMES, other, found.estimates)["effort.A"],
        log_of(m, TIMES, other, numbers)["effort.A"],
        atol=1e-7,
    )
    applied = found.apply()
    assert applied.parameters["coupler.mass"] == found.estimates["coupler.mass"][0]
    # the mass of the crank is never seen, and stays; that of the coupler shares what is not determined
    assert found.values["crank.mass"] == found.priors["crank.mass"] == 1.0
    assert np.isinf(found.sd["coupler.mass"]) and np.isfinite(found.sd["rocker.first_moment.y"])


def test_a_leg_with_two_loops_is_identified_from_noisy_efforts() -> None:
    """24 parameters, ten seconds at 1 kHz: 16 combinations, each within three standard deviations."""
    m = leg()
    numbers = other_numbers(m, 7)
    t = np.linspace(0.0, 10.0, 10001)
    courses = {
        "hip": sines(t, [0.08, 0.05, 0.03], [0.4, 1.1, 2.3], [0.0, 1.0, 2.0]),
        "motor": sines(t, [0.07, 0.05, 0.03], [0.5, 0.9, 2.9], [0.5, 2.0, 0.0]),
    }
    data = log_of(m, t, courses, numbers)
    rng = np.random.default_rng(11)
    for name, noise in (("effort.hip", 0.05), ("effort.motor", 0.1)):
        data[name] = data[name] + noise * rng.standard_normal(len(t))
    found = m.identify(data)
    assert (found.rank, len(found.values), len(found.combinations)) == (16, 24, 16)
    estimates = np.array([one.estimate for one in found.combinations])
    deviations = np.array([one.sd for one in found.combinations])
    scaled = (estimates - true_values(m, numbers, found.combinations)) / deviations
    assert np.abs(scaled).max() < 3.0 and np.sqrt(np.mean(scaled**2)) > 0.3
    assert found.noise["effort.hip"] == pytest.approx(0.05, rel=0.03)
    assert found.noise["effort.motor"] == pytest.approx(0.1, rel=0.03)
    assert not found.drowned and found.hints[0].startswith("the force of the ground as well determines 17")


def test_the_example_meets_its_combinations(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """From 20-bit encoders alone, and the picture of docs/identification.md is the one that it draws."""
    pytest.importorskip("matplotlib")
    assert EXAMPLE.main(tmp_path) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "24 parameters, 16 combinations" and len(lines) == 20
    drawn, shown = (
        (folder / "identification.svg").read_text("utf-8") for folder in (tmp_path, ROOT / "docs" / "pictures")
    )
    assert 0.8 < len(drawn) / len(shown) < 1.25 and len(shown) < 150_000
    for danger in ("<script", "http://localhost", "foreignObject", "onload"):
        assert danger not in shown


def test_standard_deviations_are_those_of_repeated_data() -> None:
    """The mean square of (estimate - truth) / sd over 8 combinations of 40 logs is 1 up to 0.2: three deviations of 320
    squares, of which those of one log are correlated."""
    m = four_bar()
    numbers = other_numbers(m, 3)
    data = log_of(m, TIMES, COURSE, numbers)
    squares = []
    for seed in range(40):
        noise = 0.01 * np.random.default_rng(seed).standard_normal(len(TIMES))
        found = m.identify(
            {**data, "effort.A": data["effort.A"] + noise}, noise={"effort.A": 0.01} if seed % 2 else None
        )
        truth = true_values(m, numbers, found.combinations)
        squares.append([((one.estimate - x) / one.sd) ** 2 for one, x in zip(found.combinations, truth, strict=True)])
    assert np.mean(squares) == pytest.approx(1.0, abs=0.25)


def test_lengths_and_springs_are_found_by_gauss_newton() -> None:
    m = sprung()
    by = ["B.point.x", "s.stiffness", "s.length", "s.damping", "coupler.com.y", "rocker.mass"]
    numbers = {
        "B.point": (np.array(m.compile().parameters["B.point"]) + np.array([0.01, 0.0, 0.0])).tolist(),
        "s.stiffness": 55.0,
        "s.length": 0.25,
        "s.damping": 5.0,
        "coupler.com": [0.45, 0.05, 0.0],
        "rocker.mass": 1.4,
    }
    data = log_of(m, TIMES, COURSE, numbers)
    found = m.identify(data, by=by, positions=["A"])
    assert found.rank == 6 and found.iterations > 2 and found.rms["effort.A"] < 1e-8
    for name, wanted in numbers.items():
        np.testing.assert_allclose(np.ravel(found.estimates[name]), np.ravel(wanted), atol=1e-6)


def test_positions_alone_are_differentiated_with_a_filter() -> None:
    """Encoders with noise of 1e-5 rad at 1 kHz: the acceleration of unfiltered positions would be noise."""
    m = four_bar()
    numbers = other_numbers(m, 5)
    t = np.linspace(0.0, 5.0, 5001)
    exact = log_of(m, t, {"A": sines(t, [0.4, 0.2], [0.5, 1.3], [0.0, 1.0])}, numbers)
    rng = np.random.default_rng(2)
    data = {
        "t": t,
        "q.A": exact["joint.A.position"] + 1e-5 * rng.standard_normal(len(t)),
        "effort.A": exact["effort.A"] + 0.02 * rng.standard_normal(len(t)),
    }
    found = m.identify(data, cutoff="12 Hz")
    truth = true_values(m, numbers, found.combinations)
    scaled = [(one.estimate - x) / one.sd for one, x in zip(found.combinations, truth, strict=True)]
    assert np.abs(scaled).max() < 3.0
    assert "filtered positions" in found.notes[0] and len(found.t) < 300
    rough = m.identify(data)
    assert rough.noise["effort.A"] > 10.0 * found.noise["effort.A"]


def test_logs_of_any_kind_say_the_same(tmp_path: Path) -> None:
    pandas, xarray = pytest.importorskip("pandas"), pytest.importorskip("xarray")
    m = four_bar()
    m.add_drive("A", position=(TIMES, COURSE["A"][0]))
    numbers = {"coupler.mass": 1.5, "coupler.inertia": [0, 0, 0, 0, 0.1, 0, 0, 0, 0.1]}
    run = m.simulate(2.0, parameters=numbers)
    run.save(tmp_path / "run.csv")
    by = ["coupler.inertia.zz"]
    wanted = m.identify(run.to_pandas(), by=by, measured=["joint.A.drive"], parameters={"coupler.mass": 1.5})
    assert wanted.estimates["coupler.inertia"][8] == pytest.approx(0.1, rel=1e-5)
    applied = wanted.apply()
    assert applied.summary["drives"] and applied.parameters["coupler.mass"] == 1.5
    stored = m.identify(tmp_path / "run.csv", by=by, measured=["joint.A.drive"], parameters={"coupler.mass": 1.5})
    assert stored.values == pytest.approx(wanted.values, rel=1e-12)
    data = {
        "time": run.t,
        "A": run.joint("A").position[:, 0],
        "v.A": run.joint("A").velocity[:, 0],
        "vdot.A": run.joint("A").acceleration[:, 0],
        "effort.A": run.joint("A").drive[:, 0],
    }
    table = "time [ms],A [deg],v.A [deg/s],vdot.A [rad/s^2],effort.A [N m]\n" + "\n".join(
        ",".join(map(repr, row))
        for row in np.column_stack(
            [1e3 * run.t, np.rad2deg(data["A"]), np.rad2deg(data["v.A"]), data["vdot.A"], data["effort.A"]]
        ).tolist()
    )
    (tmp_path / "log.csv").write_text(table)
    dataset = xarray.Dataset(
        {
            "joint_position": (("t", "joint"), data["A"][:, None]),
            "joint_velocity": (("t", "joint"), data["v.A"][:, None]),
            "joint_acceleration": (("t", "joint"), data["vdot.A"][:, None]),
            "effort": (("t", "actuator"), data["effort.A"][:, None]),
        },
        coords={"t": run.t, "joint": ["A"], "actuator": ["A"]},
    )
    frame = pandas.DataFrame({name: x for name, x in data.items() if name != "time"}, index=run.t)
    for given in (data, tmp_path / "log.csv", dataset, frame):
        found = m.identify(given, by=by, parameters={"coupler.mass": 1.5})
        assert found.values == pytest.approx(wanted.values, rel=1e-9)


def test_forces_count_by_their_noise() -> None:
    """A force with noise a hundred times larger says less, and both are better than one."""
    m = four_bar()
    numbers = other_numbers(m, 3)
    data = log_of(m, TIMES, COURSE, numbers, forces=("C",))
    rng = np.random.default_rng(4)
    data["effort.A"] = data["effort.A"] + 0.01 * rng.standard_normal(len(TIMES))
    for axis in "xy":
        data[f"joint.C.force.{axis}"] = data[f"joint.C.force.{axis}"] + 1.0 * rng.standard_normal(len(TIMES))
    del data["joint.C.force.z"]
    found = m.identify(data)
    assert found.noise["joint.C.force.x"] == pytest.approx(1.0, rel=0.15)
    truth = true_values(m, numbers, found.combinations)
    assert all(abs(one.estimate - x) < 4.0 * one.sd for one, x in zip(found.combinations, truth, strict=True))
    alone = m.identify(data, measured=["effort.A"])
    assert found.rank > alone.rank
    for label, sd in alone.sd.items():
        assert found.sd[label] <= sd * 1.2 or np.isinf(sd)


def test_drowned_directions_keep_the_prior_and_are_named() -> None:
    """A slow motion says nothing of inertias through noise: they stay, and the first moments are found."""
    m = four_bar()
    t = np.linspace(0.0, 100.0, 301)
    data = log_of(m, t, {"A": sines(t, [0.6], [0.02], [0.0])}, other_numbers(m, 3))
    data["effort.A"] = data["effort.A"] + 0.02 * np.random.default_rng(1).standard_normal(len(t))
    found = m.identify(data)
    assert found.rank == 8 and 0 < len(found.drowned) < 8
    assert any("inertia_about" in words for words in found.drowned)
    drowned = [one for one in found.combinations if one.drowned]
    assert drowned and all(one.sd > one.size for one in drowned)
    rest = m.identifiability({**data, "joint.A.velocity": 0.0, "joint.A.acceleration": 0.0}, actuators=["A"])
    assert rest.rank == 4 and rest.attainable == 8
    assert rest.hints[0] == (
        "a richer motion with the same channels (other positions, rates and accelerations) determines 8 combinations "
        "instead of 4"
    )


def test_gravity_is_a_candidate_where_there_is_none() -> None:
    found = four_bar(gravity=None).identifiability(actuators=["A"])
    assert found.candidates["gravity"] == 8
    assert any("gravity" in hint and "8" in hint for hint in found.hints)


def test_bodies_that_cannot_exist_are_named() -> None:
    """A friction that nobody asked for is taken for inertia."""
    m = four_bar()
    data = log_of(m, TIMES, COURSE)
    data["effort.A"] = data["effort.A"] + 3.0 * np.sign(data["joint.A.velocity"]) - 8.0 * data["joint.A.acceleration"]
    found = m.identify(data, noise={"effort.A": 0.01})
    assert any("cannot exist" in words for words in found.warnings)
    assert any("exceed the given noise" in words for words in found.warnings)
    assert any("correlated" in words for words in found.notes)
    with pytest.raises(DescriptionError):
        found.apply()


def test_results_are_shown() -> None:
    m = four_bar()
    data = log_of(m, TIMES, COURSE)
    data["effort.A"] = data["effort.A"] + 0.01 * np.random.default_rng(1).standard_normal(len(TIMES))
    found = m.identify(data)
    assert repr(found).startswith(
        "<Identification of 'four-bar': 8 combinations of 12 parameters; residuals of effort.A"
    )
    assert "rocker.first_moment.y" in found._repr_html_() and "never" in found.identifiability._repr_html_()
    assert len(found.plot().axes) == 2 and len(found.identifiability.plot().axes) == 1
    pytest.importorskip("pandas")
    frame = found.to_pandas()
    assert list(frame.columns) == ["unit", "prior", "estimate", "sd", "drowned", "combination"] and len(frame) == 8
    assert found.combination("rocker.first_moment.y").unit == "kg m"


def test_least_squares_of_nothing_determine_nothing() -> None:
    found = least_squares(np.zeros((5, 1, 2)), np.ones((5, 1)), *(np.ones(1),) * 2, *(np.ones(2),) * 2)
    assert found["rank"] == 0 and not found["changes"].any() and np.isinf(found["deviations"]).all()


def bad(change: dict[str, Any]) -> dict[str, Any]:
    data: dict[str, Any] = {**log_of(four_bar(), TIMES[:40], {"A": tuple(x[:40] for x in COURSE["A"])}), **change}
    return {name: values for name, values in data.items() if values is not None}


ERRORS: dict[str, tuple[dict[str, Any], dict[str, Any], type[Exception], str]] = {
    "no effort": ({"effort.A": None}, {}, ArgumentError, "no effort and no force"),
    "no position": ({"joint.A.position": None}, {}, ArgumentError, "0 measured positions"),
    "too few times": ({"joint.A.velocity": None, "t": None}, {}, ArgumentError, "times that increase"),
    "not finite": ({"joint.A.position": np.full(40, np.nan)}, {}, ArgumentError, "not finite at sample 0"),
    "a length": ({"joint.A.position": np.ones(7)}, {}, ArgumentError, "7 values, other columns have 40"),
    "words": ({"effort.A": ["a"] * 40}, {}, ArgumentError, "array of numbers"),
    "not reached": (
        {"joint.A.position": None, "joint.D.position": np.full(40, 3.0)},
        {},
        ArgumentError,
        "reaches no measured position",
    ),
    "unknown parameter": ({}, {"by": ["crank.weight"]}, UnknownNameError, "there is no parameter 'crank.weight'"),
    "twice": ({}, {"by": ["crank", "crank.mass"]}, ArgumentError, "twice"),
    "both forms": ({}, {"by": ["crank", "crank.com.x"]}, ArgumentError, "reference point"),
    "no list": ({}, {"by": "crank"}, ArgumentError, "by must be a list"),
    "empty": ({}, {"by": []}, ArgumentError, "by is empty"),
    "too many actuators": ({}, {"actuators": ["A", "D"]}, ArgumentError, "2 actuators"),
    "unknown channel": ({}, {"measured": ["effort.D"]}, UnknownNameError, "no effort and no force"),
    "no column": ({}, {"measured": ["joint.C.force.x"]}, UnknownNameError, "no column of the data"),
    "elastic": ({"joint.C.force.z": np.zeros(40)}, {}, ArgumentError, "not determined by the motion"),
    "unknown position": ({}, {"positions": ["Z"]}, UnknownNameError, "'Z' is no measured position"),
    "noise of nothing": ({}, {"noise": {"effort.D": 1.0}}, ArgumentError, "not fitted"),
    "no noise": ({}, {"noise": {"effort.A": 0.0}}, ArgumentError, "positive number"),
    "cutoff": ({}, {"cutoff": 500.0}, ArgumentError, "have nothing above"),
    "too short": ({}, {"cutoff": 1.0}, ArgumentError, "nothing is left"),
    "uneven": ({"t": np.sort(np.r_[TIMES[:39], 9.0])}, {"cutoff": 5.0}, ArgumentError, "even steps"),
    "few samples": (
        {"effort.A": np.r_[np.ones(5), np.full(35, np.nan)]},
        {},
        ArgumentError,
        "5 samples for 12 parameters",
    ),
}


@pytest.mark.parametrize("case", ERRORS)
def test_bad_input_is_refused_with_a_reason(case: str) -> None:
    change, arguments, kind, words = ERRORS[case]
    with pytest.raises(kind, match=words):
        four_bar().identify(bad(change), **arguments)


def test_files_that_are_no_logs_are_refused(tmp_path: Path) -> None:
    m = four_bar()
    with pytest.raises(MissingFileError, match="no file"):
        m.identify(tmp_path / "log.csv")
    (tmp_path / "log.csv").write_text("t,A\n0.0,x\n")
    with pytest.raises(FileFormatError, match="no number"):
        m.identify(tmp_path / "log.csv")
    with pytest.raises(ArgumentError, match="must be a dict of columns"):
        m.identify(3.0)
    with pytest.raises(ArgumentError, match="no drives"):
        m.identifiability()
