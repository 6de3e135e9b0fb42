"""Every problem of the catalogue against its known answer, and against what holds for every mechanism."""

import numpy as np
import pytest
from catalogue_runs import column, entry_of, extent, run_of

import partita as pt
from partita.catalogue import spring_four_bar, three_rrr

NAMES = [name for name in pt.catalogue.names() if pt.catalogue.entry(name).truth is None]
"""Those with known answers; `test_zoo` has the others."""


@pytest.mark.parametrize("name", NAMES)
def test_motion_and_known_answer(name: str) -> None:
    found = entry_of(name).measure(run_of(name))
    assert not [str(m) for m in found if not m.passed]


@pytest.mark.parametrize("name", NAMES)
def test_reactions_and_newton_euler(name: str) -> None:
    # Reactions come by linear solves from the same forces: round-off 1e-16, condition up to 1e5 near singularities.
    residual = run_of(name).certificate.newton_euler
    assert residual is not None and residual <= 1e-9


@pytest.mark.parametrize("name", NAMES)
def test_loops_and_closure(name: str) -> None:
    # Round-off 1e-16 of a position times its size, over the few Newton steps and sums that make up a loop; a chain of
    # 40 m carries 40 times the round-off of 1 m.
    result = run_of(name)
    assert float(result.closure.max(initial=0.0)) <= 1e-12 * max(1.0, extent(result) / 10.0)


@pytest.mark.parametrize("name", NAMES)
def test_energy_and_work(name: str) -> None:
    # Errors of integration at rtol 1e-10, not growing in energy; the second term is the round-off of a potential much
    # larger than the energy that moves (the spring's four-bar hardly does).
    energy = run_of(name).energy
    limit = 1e-8 * energy.scale + 1e-13 * float(np.max(np.abs(energy.potential)))
    assert float(np.max(np.abs(energy.balance))) <= limit


@pytest.mark.parametrize(
    ("name", "rows", "rank", "mobility"),
    [
        ("planar-pendulum", 5, 5, 1),
        ("four-bar", 20, 17, 1),
        ("reference-four-bar", 20, 17, 1),
        ("double-four-bar", 35, 29, 1),
        ("n-four-bar", 605, 485, 1),
        ("andrews-squeezer", 50, 41, 1),
        ("bricard", 30, 29, 1),
        ("watt-six-bar", 35, 29, 1),
        ("stephenson-six-bar", 35, 29, 1),
        ("three-rrr", 45, 39, 3),
        ("rssr", 16, 16, 2),
        ("spatial-slider-crank", 17, 17, 1),
    ],
)
def test_joint_rows_and_their_rank(name: str, rows: int, rank: int, mobility: int) -> None:
    summary = run_of(name).summary
    assert (summary["joint_rows"], summary["joint_rank"], summary["mobility"]) == (rows, rank, mobility)


def test_andrews_start_and_its_tangent() -> None:
    """From rest only the torque moves it: accelerations lie along the tangent (0.8, -0.6, 0, 0, 0, 0, 0)."""
    result = run_of("andrews-squeezer")
    columns = {joint: column(result, joint) for joint in ("O", "F")}
    assert [result.names.velocities[i] for i in result.independent[0]] in (["O"], ["F"])
    vdot = result.vdot[0]
    assert vdot[columns["F"]] / vdot[columns["O"]] == pytest.approx(-0.75, abs=1e-10)
    others = np.delete(vdot, list(columns.values()))
    assert float(np.max(np.abs(others))) <= 1e-8 * abs(vdot[columns["O"]])  # beta'' = 1e4 from sums of 1e-16


def test_spring_four_bar_and_its_linearisation() -> None:
    """M, C and K of the rocker's motion near equilibrium, by central differences of the accelerations."""
    m = pt.catalogue.load("four-bar-spring")
    model = m.compile()
    rocker = model.velocity_names.index("D")

    def acceleration(angle: float, rate: float) -> float:
        state = m.assemble(targets={"D": angle}, rates={"D": rate})
        return float(model.acceleration(state.q, state.v)[0][rocker])

    rest = m.assemble()
    tangent = np.linalg.svd(model.jacobian(rest.q))[2][-1]
    tangent = tangent / tangent[rocker]
    mass = float(tangent @ model.mass_matrix(rest.q) @ tangent)
    h = 1e-4  # differences of order h^2 = 1e-8 relative, round-off 1e-15 / h = 1e-11
    stiffness = -mass * (acceleration(h, 0.0) - acceleration(-h, 0.0)) / (2.0 * h)
    damping = -mass * (acceleration(0.0, h) - acceleration(0.0, -h)) / (2.0 * h)
    assert acceleration(0.0, 0.0) == pytest.approx(0.0, abs=1e-12)
    assert mass == pytest.approx(spring_four_bar.MASS, rel=1e-12)
    assert damping == pytest.approx(spring_four_bar.DAMPING, rel=1e-6)
    assert stiffness == pytest.approx(spring_four_bar.STIFFNESS, rel=1e-6)


def test_three_rrr_and_its_parallel_singularity() -> None:
    """The inner links are the three most mobile coordinates, and together they move nothing (known to 3 digits)."""
    m = pt.catalogue.load("three-rrr")
    pose = np.array([0.44480746107270663, -0.28272813748931336, -0.2492938366933924])
    model = m.compile()
    inner = [f"A{i + 1}" for i in range(3)]
    q = three_rrr.joints(pose)
    assert float(np.max(np.abs(model.constraints(q)))) < 1e-12
    rho = dict(zip(model.velocity_names, model.measure(q), strict=True))
    assert sorted(rho[name] for name in inner) == pytest.approx([0.643, 0.709, 0.837], abs=1e-3)
    assert set(sorted(rho, key=rho.__getitem__)[-3:]) == set(inner)
    columns = [i for i, name in enumerate(model.velocity_names) if name not in inner]
    block = np.linalg.svd(model.jacobian(q)[:, columns], compute_uv=False)
    whole = np.linalg.svd(model.jacobian(q), compute_uv=False)
    assert block[-1] < 1e-3 * whole[-1]
    choice = pt.partition.choose(model.mass_matrix(q), model.jacobian(q))
    assert choice.sigma >= 0.46


def test_names_are_sorted_and_loadable() -> None:
    names = pt.catalogue.names()
    assert sorted(names) == names
    assert all(pt.catalogue.load(name).bodies for name in names)
    assert len(pt.catalogue.load("n-four-bar", loops=3).bodies) == 7
    double, chain = pt.catalogue.load("double-four-bar"), pt.catalogue.load("n-four-bar", loops=2)
    assert list(double.bodies) == list(chain.bodies)


@pytest.mark.parametrize("name", pt.catalogue.names())
def test_about_reports_title_source_and_reasons(name: str) -> None:
    entry, text = entry_of(name), pt.catalogue.about(name)
    assert entry.title in text and entry.source in text
    assert all(check.name in text and check.reason in text for check in entry.checks)


def test_a_chain_of_three_meets_its_equation_of_motion() -> None:
    entry = entry_of("n-four-bar", loops=3)
    assert not [str(m) for m in entry.measure(run_of("n-four-bar", loops=3)) if not m.passed]


def test_unknown_entry_reports_the_nearest_name() -> None:
    with pytest.raises(pt.errors.UnknownNameError, match="andrews-squeezer"):
        pt.catalogue.load("andrew-squeezer")


def test_first_words_of_a_name_are_enough() -> None:
    assert pt.catalogue.entry("scissor").name == "scissor-lift"
    assert pt.catalogue.entry("bricard").name == "bricard"  # itself, though another one begins with it
    with pytest.raises(pt.errors.UnknownNameError, match="stewart-sps"):
        pt.catalogue.load("stewart")
    with pytest.raises(pt.errors.UnknownNameError):
        pt.catalogue.load("scis")


def test_unknown_parameter_is_refused() -> None:
    with pytest.raises(pt.errors.ArgumentError, match="loops"):
        pt.catalogue.load("bricard", loops=2)
    with pytest.raises(pt.errors.ArgumentError, match="takes loops"):
        pt.catalogue.load("n-four-bar", links=2)


@pytest.mark.parametrize("loops", [0, -1, 2.0, "2", True, float("nan")])
def test_impossible_number_of_loops_is_refused(loops: object) -> None:
    with pytest.raises(pt.errors.ArgumentError, match="whole number"):
        pt.catalogue.load("n-four-bar", loops=loops)


def test_a_check_without_its_output_says_what_to_do() -> None:
    entry = entry_of("four-bar")
    short = entry.simulate(t_eval=[0.0, 0.5])
    with pytest.raises(pt.errors.ArgumentError, match="t_eval"):
        entry.measure(short)
