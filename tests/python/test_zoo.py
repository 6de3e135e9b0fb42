"""Every mechanism of the zoo for a moment: theory, the independent program and Partita agree at the start and later.

`python -m zoo`, a part of `make trust`, runs them for ten seconds.
"""

import moved_drawings
import numpy as np
import pytest
from zoo.judging import judge

import partita as pt
from partita.catalogue import Truth, zoo
from partita.catalogue.truth import EVERYTHING, planar
from partita.catalogue.zoo.six_bars_and_legs import jansen

NAMES = sorted(zoo.ENTRIES)
OTHERS = {
    "andrews-squeezer": planar(7, 10, ""),
    "four-bar": planar(3, 4, ""),
    "watt-six-bar": planar(5, 7, ""),
    "stephenson-six-bar": planar(5, 7, ""),
    "three-rrr": planar(7, 9, ""),
    "spatial-four-bar": Truth(1, 3, {"*": "fx fy mz"}, axes="joint", why="a four-bar in a tilted plane", source=""),
    "rssr": Truth(2, 0, EVERYTHING, why="1 + 3 + 3 + 1 - 6 = 2", source="", idle=("coupler",)),
    "spatial-slider-crank": Truth(1, 0, EVERYTHING, why="1 + 3 + 2 + 1 - 6 = 1", source=""),
}
"""Mechanisms of the catalogue with known paths, and what theory says of them."""


@pytest.mark.parametrize("name", NAMES)
def test_theory_the_independent_program_and_partita_agree(name: str) -> None:
    entry = pt.catalogue.entry(name)
    m = entry.mechanism()
    result = m.simulate(0.3, initial=entry.initial(m), t_eval=[0.0, 0.3], **entry.options)
    assert not [str(m) for m in entry.measure(result) if not m.passed]
    assert judge(name, result).wrong == []


@pytest.mark.parametrize("name", sorted(OTHERS))
def test_theory_of_mechanisms_with_known_paths(name: str) -> None:
    entry = pt.catalogue.entry(name)
    m = entry.mechanism()
    end = min(0.3, entry.duration)
    result = m.simulate(end, initial=entry.initial(m), t_eval=[0.0, end])
    assert [check.run(result).passed for check in zoo.checks(OTHERS[name])][:2] == [True, True]
    assert judge(name, result, OTHERS[name]).wrong == []


def test_the_zoo_is_as_large_as_it_says() -> None:
    assert len(NAMES) >= 50
    assert sum(len(theme) for theme in zoo.THEMES.values()) == len(NAMES)
    assert set(NAMES) <= set(pt.catalogue.names())


@pytest.mark.parametrize("name", NAMES)
def test_drawings_are_closed_to_round_off(name: str) -> None:
    """Drawn by closed forms, nothing is left for `assemble` to do but what rounding left open."""
    found = pt.catalogue.load(name).assemble().assembly
    assert found is not None and found["iterations"] <= (moved_drawings.SEED is not None)
    assert found["residual"] <= 1e-14


def test_jansens_leg_stands_on_its_foot() -> None:
    """Jansen's numbers make the path of the foot flat at its lower end, below everything else: for 40 % of a turn of
    the crank it stays within a hundredth of the height of the leg."""
    feet = []
    for angle in np.linspace(0.0, 2.0 * np.pi, 73)[:-1]:
        points = {"P": complex(0.15 * np.cos(angle), 0.15 * np.sin(angle))}
        jansen(points, {}, "", mirrored=False)
        feet.append(points["F"])
        assert all(points["F"].imag < points[name].imag for name in "PBTLSK")
    heights = np.array([foot.imag for foot in feet])
    down = heights < heights.min() + 0.01 * abs(heights.min())
    assert down.mean() >= 0.4
    assert np.ptp(np.array(feet).real[down]) > 0.6 * np.ptp(np.array(feet).real)


@pytest.mark.parametrize("name", ["bennett", "goldberg", "myard", "bricard-plane-symmetric"])
@pytest.mark.parametrize("formulation", ["projective", "explicit-closing"])
def test_loops_of_special_lengths_pass_no_singular_position(name: str, formulation: str) -> None:
    """Rows kept of redundant ones lose rank on the way, the loop does not: by the independent program it is sound."""
    entry = pt.catalogue.entry(name)
    result = entry.simulate(t_eval=np.linspace(0.0, 10.0, 21), solver=pt.Solver(formulation))
    assert result.success and result.certificate.verdict == "valid"
    assert not [note for note in result.certificate.notes if "singular positions" in note]
    assert result.energy.relative_balance < 100 * 1e-9
    assert zoo.closure(result) < 1e-12


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("samples", [19, 37, 361])
def test_cams_by_tables_keep_their_energy(samples: int, coordinates: str) -> None:
    """The third derivative of the curve jumps at each sample: steps end there, or thousands of tolerances are lost."""
    m, rtol = pt.Mechanism("cam", gravity=(0.0, -9.81, 0.0)), 1e-11
    m.add_body("cam", mass=2.0, inertia=(0.01, 0.01, 0.01))
    m.add_body("tappet", mass=0.5, inertia=(0.01, 0.01, 0.01), position=(0.0, 0.3, 0.0))
    m.add_revolute("shaft", "ground", "cam", point=(0, 0, 0))
    m.add_prismatic("guide", "ground", "tappet", point=(0, 0.2, 0), axis=(0, 1, 0))
    angles = np.linspace(0.0, 2.0 * np.pi, samples)
    m.add_cam("guide", "shaft", (angles, 0.03 * np.sin(angles / 2.0) ** 4), periodic=True)
    start = m.assemble(rates={"shaft": -6.0})
    start = start if coordinates == "relative" else m.convert(start, "absolute")
    run = m.simulate(2.0, initial=start, t_eval=[0.0, 1.0, 2.0], rtol=rtol, atol=1e-13, coordinates=coordinates)
    assert run.certificate.verdict == "valid"
    # a few hundred steps, the estimate of each below a tolerance
    assert run.energy.relative_balance < 100 * rtol
    # one polynomial, one step, and some more where a turn is not seen to end on a sample at once
    turned = 6.0 * 2.0 / (2.0 * np.pi) * samples
    assert run.counters["steps"] < 3.0 * turned + 200


def test_a_drive_by_a_table_does_the_work_it_should() -> None:
    """Without gravity what the drive has done is what the rod has in motion."""
    m = pt.Mechanism("rod", gravity=(0.0, 0.0, 0.0))
    m.add_body("rod", mass=1.0, inertia=(0.1, 0.1, 0.1), com=(0.5, 0.0, 0.0))
    m.add_revolute("A", "ground", "rod", point=(0, 0, 0))
    times = np.linspace(0.0, 5.0, 91)
    m.add_drive("A", position=(times, np.sin(2.0 * times)))
    run = m.simulate(5.0, t_eval=np.linspace(0.0, 5.0, 11), rtol=1e-11, atol=1e-13)
    assert run.success and run.energy.relative_balance < 10 * 1e-11
    # the torque jumps at each sample: a step an interval at the least
    assert 90 <= run.counters["steps"] <= 400


def test_the_self_stress_of_the_plane_symmetric_loop_is_a_force_in_its_plane() -> None:
    """As drawn, along the plane's normal the force is unique, and at hinges in the plane moments in it are."""
    entry = pt.catalogue.entry("bricard-plane-symmetric")
    result = entry.simulate(t_eval=[0.0])
    m = entry.mechanism()
    at = {joint["name"]: np.array(joint["point"]) for joint in m.to_spec()["joints"]}
    normal = at["B"] - at["F"]
    normal /= np.linalg.norm(normal)
    along = np.linalg.qr(np.column_stack([normal, at["D"] - at["A"], at["B"] + at["F"] - 2 * at["A"]]))[0]
    along *= np.linalg.det(along)
    for name in "ABCDEF":
        flags = result.joint(name).in_frame(along).determined_at[0]
        in_plane = name in "AD"
        assert flags.tolist() == [True, False, False, False, in_plane, in_plane], name


def test_reports_say_nothing_false_of_what_rolls_or_meshes() -> None:
    """A bicycle is locked sideways as it stands, not in any position; tooth forces go around without a joint."""
    assert "in any position" not in str(pt.catalogue.load("whipple-bicycle").report())
    words = " ".join(str(pt.catalogue.load("planetary-gear").report()).split())
    assert "the efforts of couplings can balance one another" in words and "nothing can" not in words


def test_truth_says_what_is_unique() -> None:
    truth = Truth(1, 3, {"hook": "fx fy fz mx my mz", "*": "fx fy mz"}, why="a reason", source="a book", idle=("rod",))
    assert truth.flags("hook").all()
    assert truth.flags("A").tolist() == [True, True, False, False, False, True]
    assert not Truth(0, 0, {"A": "fx"}, why="", source="").flags("B").any()
    assert "1 degree of freedom, 3 redundant constraints (a reason). Idle: rod." in str(truth)


def test_a_wrong_statement_is_found() -> None:
    """The checks of an entry and the judge would see theory err."""
    entry = pt.catalogue.entry("bennett")
    result = entry.simulate(t_eval=[0.0, 0.1])
    assert entry.truth is not None
    for wrong in (
        Truth(2, 3, entry.truth.determined, why="", source="", axes="joint"),
        Truth(1, 2, entry.truth.determined, why="", source="", axes="joint"),
        Truth(1, 3, {"*": "fx mz"}, why="", source="", axes="joint"),
    ):
        assert [check.run(result).passed for check in zoo.checks(wrong)].count(False) == 1


def test_the_eigenvalues_of_the_bicycle_are_those_of_the_paper() -> None:
    """Accelerations next to straight running at 5 m/s, by central differences in roll, steer and their rates."""
    m, speed, step = pt.catalogue.load("whipple-bicycle"), 5.0, 1e-4
    names = m.compile().velocity_names
    roll, steer = names.index("frame.wx"), names.index("steer")

    def accelerations(x: np.ndarray) -> np.ndarray:
        upright = {("rear frame", (0, 0, 0), "xy"): (0.0, 0.0), ("rear frame", (1, 0, 0), "y"): 0.0}
        targets = {**upright, ("rear frame", (0, 0, -1), "y"): float(np.sin(x[0])), "steer": float(x[1])}
        rates = {"frame.wx": float(x[2]), "steer": float(x[3]), "rear axle": -speed / 0.3}
        run = m.simulate(0.1, initial=m.assemble(targets=targets, rates=rates), t_eval=[0.0])
        return np.array([run.vdot[0, roll], run.vdot[0, steer]])

    moved = step * np.eye(4)
    below = np.column_stack([(accelerations(x) - accelerations(-x)) / (2.0 * step) for x in moved])
    found = np.sort_complex(np.linalg.eigvals(np.vstack([np.eye(4)[2:], below])))
    weave = complex(-0.775341882195845, 4.46486771378823)
    paper = np.sort_complex([weave, weave.conjugate(), -0.322866429004087, -14.0783896927982])
    # third derivatives times the step squared
    assert np.abs(found - paper).max() < 1e-6


def test_the_bicycle_stays_up_and_keeps_its_energy() -> None:
    """Between 4.29 and 6.02 m/s it is stable: the roll rate of the start dies out."""
    result = pt.catalogue.entry("whipple-bicycle").simulate(t_eval=np.linspace(0.0, 10.0, 201))
    assert result.success and result.energy.relative_balance < 1e-9
    lean = result.body("rear frame").rotation[:, 1, 2]
    assert np.abs(lean).max() > 5e-3
    assert np.abs(lean[-40:]).max() < 0.2 * np.abs(lean).max()
