"""All assemblies of a mechanism, and placing by closed forms instead of walking."""

from __future__ import annotations

import numpy as np
import pytest

import partita as pt
from partita.errors import ArgumentError, AssemblyError, UnknownNameError

GROUND, CRANK, COUPLER, ROCKER = 1.0, 0.5, 1.2, 0.8


def four_bar(crank: float = CRANK) -> pt.Mechanism:
    """Drawn with the crank at a right angle, the coupler's far end above."""
    a, d, b = np.zeros(3), np.array([GROUND, 0.0, 0.0]), np.array([0.0, crank, 0.0])
    c = meet(b, COUPLER, d, ROCKER, 1.0)
    m = pt.Mechanism("four-bar")
    bodies = [m.add_rod(name, start=s, end=e, mass=1.0) for name, s, e in (("1", a, b), ("2", b, c), ("3", d, c))]
    m.add_revolute("A", m.ground, bodies[0], point=a)
    m.add_revolute("B", bodies[0], bodies[1], point=b)
    m.add_revolute("C", bodies[1], bodies[2], point=c)
    m.add_revolute("D", m.ground, bodies[2], point=d)
    return m


def meet(p: np.ndarray, r: float, q: np.ndarray, s: float, side: float) -> np.ndarray:
    """Where the circles about p and q meet, left or right of the way from p to q."""
    way = q - p
    far = np.linalg.norm(way)
    along = (far**2 + r**2 - s**2) / (2 * far)
    across = side * np.sqrt(r**2 - along**2)
    return p + (along * way + across * np.array([-way[1], way[0], 0.0])) / far


def pin(m: pt.Mechanism, state: pt.State) -> np.ndarray:
    return m.simulate(1e-3, initial=state, t_eval=[0.0]).body("2").point((COUPLER, 0, 0))[0]


@pytest.mark.parametrize("angle", [0.1, 1.0, 3.0])
def test_both_assemblies_of_a_four_bar(angle: float) -> None:
    m = four_bar()
    both = m.assemblies(targets={"A": angle}, rates={"A": 2.0}, inputs=["A"])
    assert len(both) == 2
    assert "RRR dyad" in both.blocks[0]
    b = CRANK * np.array([-np.sin(angle), np.cos(angle), 0.0])
    d = np.array([GROUND, 0.0, 0.0])
    signs = [next(iter(one.branches.values())) for one in both]
    assert sorted(signs) == [-1, 1]
    for one, side in zip(both, (1.0, -1.0), strict=True):
        assert one.residual < 4e-15
        assert one.state.position("A") == angle
        assert one.state.velocity("A") == pytest.approx(2.0, abs=1e-12)
        assert pin(m, one.state) == pytest.approx(meet(b, COUPLER, d, ROCKER, side), abs=1e-14)
    assert "2 assemblies" in str(both)


def test_a_branch_is_kept_through_full_turns() -> None:
    """The Grashof crank turns three times; each motion stays on the side where it began."""
    m = four_bar()
    for one in m.assemblies(rates={"A": 4.0}, inputs=["A"]):
        side = next(iter(one.branches.values()))
        for formulation in ("projective", "explicit-closing", "wehage-haug"):
            run = m.simulate(5.0, initial=one.state, formulation=formulation, rtol=1e-9)
            assert run.success, run.message
            assert np.ptp(run.joint("A").position) > 6 * np.pi
            b, c = run.body("2").point((0, 0, 0)), run.body("2").point((COUPLER, 0, 0))
            way, link = np.array([GROUND, 0.0, 0.0]) - b, c - b
            turn = way[:, 0] * link[:, 1] - way[:, 1] * link[:, 0]
            assert np.all(np.sign(turn) == np.sign(turn[0]))
            assert run.closure.max() < 1e-14
        assert side in (-1, 1)


def test_inputs_are_chosen_where_none_are_named() -> None:
    both = four_bar().assemblies()
    assert len(both) == 2
    assert both[0].state.position("A") == pytest.approx(0.0, abs=1e-15)


def test_what_cannot_be_is_said() -> None:
    m = four_bar()
    with pytest.raises(ArgumentError, match="degrees of freedom"):
        m.assemblies(inputs=["A", "D"])
    with pytest.raises(UnknownNameError, match="no velocity"):
        m.assemblies(inputs=["X"])
    # a crank that cannot turn round: at 2 rad past the drawing its end is 1.98 m from D, as near as the links allow
    long = four_bar(1.05)
    with pytest.raises(AssemblyError) as caught:
        long.assemblies(targets={"A": 1.5})
    assert caught.value.residual > 1e-3


def test_placing_finds_what_walking_finds() -> None:
    """Closed forms serve where all loops have them; the answer is that of the walk, on the same branch."""
    m = pt.catalogue.load("watt-six-bar")
    joint = m.assemblies().blocks
    assert len(joint) == 2
    for angle in (0.4, -0.7, 2.5, 9.0):
        there = m.assemble(targets={"A": angle})
        assert there.assembly is not None and there.assembly["explicit"]
        # the same in small steps, each from the last
        state = None
        for part in np.linspace(0.0, angle, 40)[1:]:
            state = m.assemble(targets={"A": part}, near=state)
        assert state is not None
        assert there.q == pytest.approx(state.q, abs=1e-12)


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_axes_do_not_close_pointing_backwards(coordinates: str) -> None:
    """Perpendicular to the same two axes is an axis and its opposite: a body drawn upside down is turned over."""
    m = pt.Mechanism("upside down")
    m.add_body("b", mass=1.0, inertia=(1, 2, 2.5), com=(0.1, 0.2, 0.3))
    m.add_spherical("ball", m.ground, "b", point=(0, 0, 0), cut="never")
    m.add_revolute("hinge", m.ground, "b", point=(0, 0, 1), axis=(0, 0, 1), cut="always",
                   child_point=(0, 0, -1), child_axis=(0, 0, -1))  # fmt: skip
    state = m.assemble(coordinates=coordinates)
    run = m.simulate(0.1, initial=state, coordinates=coordinates)
    axis = run.body("b").rotation @ [0.0, 0.0, -1.0]
    assert axis == pytest.approx(np.tile([0.0, 0.0, 1.0], (len(run.t), 1)), abs=1e-11)


def test_what_closes_backwards_only_is_refused() -> None:
    """A bar held by a slide along its own axis cannot be turned over."""
    m = pt.Mechanism("backwards")
    m.add_body("b", mass=1.0, inertia=(1, 2, 2.5))
    m.add_prismatic("slide", m.ground, "b", point=(0, 0, 0), axis=(0, 0, 1), cut="never")
    m.add_cylindrical("guide", m.ground, "b", point=(0, 0, 1), axis=(0, 0, 1), cut="always", child_axis=(0, 0, -1))
    with pytest.raises(pt.errors.AssemblyError, match=r"guide.* the wrong way round"):
        m.assemble()


def test_turned_drawings_convert_there_and_back() -> None:
    """A ball beyond a hinge that the drawing shows askew: the same poses and turns in all coordinates."""
    m = pt.Mechanism("askew", gravity=(1, 2, -9))
    m.add_body("a", mass=1.0, inertia=(1, 2, 2.5), com=(0.1, 0.2, 0.3))
    m.add_body("b", mass=2.0, inertia=(1, 1.5, 2), com=(0.3, 0.1, 0.2), position=(1, 0, 0))
    m.add_revolute("hinge", m.ground, "a", point=(0, 0, 0), axis=(0, 0, 1), child_axis=(0.5, 0.2, 1))
    m.add_spherical("ball", "a", "b", point=(1, 0, 0))
    state = m.assemble(rates={"hinge": 1.0, "ball": (0.3, -0.4, 0.5)})
    moving = m.simulate(0.5, initial=state, rtol=1e-11, atol=1e-12)
    model = m.compile()
    last = pt.State(0.5, moving.q[-1], moving.v[-1], model.names, model.velocity_names)
    there = m.convert(last, "absolute")
    back = m.convert(there, "relative")
    assert back.q == pytest.approx(moving.q[-1], abs=1e-12) and back.v == pytest.approx(moving.v[-1], abs=1e-11)
    same = m.simulate(0.5, initial=m.convert(state, "absolute"), rtol=1e-11, atol=1e-12, coordinates="absolute")
    for name in ("position", "velocity"):
        one, other = (getattr(run.joint("ball"), name) for run in (moving, same))
        assert one == pytest.approx(other, abs=1e-8), name


def test_what_is_not_given_stays_as_near_as_the_loops_allow() -> None:
    m = pt.catalogue.load("three-rrr")
    moving = m.assemble(rates={"A1": 1.0, "A2": -0.5, "A3": 0.25})
    # a closed moving state is its own nearest
    np.testing.assert_allclose(m.assemble(near=moving).v, moving.v, rtol=0, atol=1e-12)
    # v + D^T x of least energy: M (v' - v) is orthogonal to all that the loops allow and the rates leave
    model = m.compile()
    changed = m.assemble(near=moving, rates={"A1": 2.0})
    i = model.at(changed.q, changed.v)
    rest = np.linalg.svd(i.D[:, model.velocity_names.index("A1")][None])[2][1:] @ i.D
    assert changed.velocity("A1") == pytest.approx(2.0, abs=1e-12)
    np.testing.assert_allclose(rest @ i.M @ (changed.v - moving.v), 0.0, atol=1e-12)
    assert np.abs(changed.v - m.assemble(rates={"A1": 2.0}).v).max() > 0.1


def test_equations_by_hand_start_as_near_as_they_can_to_the_velocities_given() -> None:
    ring = pt.System(
        n=2,
        mass=[[2.0, 0.0], [0.0, 1.0]],
        forces=(0.0, 0.0),
        constraints=lambda t, q: [q @ q - 1],
        jacobian=lambda t, q: [2 * q],
        bias=lambda t, q, v: [2 * v @ v],
    )
    assert ring.assemble([0.6, 0.8], [-0.8, 0.6]).v.tolist() == pytest.approx([-0.8, 0.6], abs=1e-12)
    v = ring.assemble([0.6, 0.8], [1.0, 0.0]).v
    # along the ring, and nearest in the mass metric: M (v - v0) is normal to the ring
    tangent = np.array([-0.8, 0.6])
    assert abs(v @ [0.6, 0.8]) < 1e-12 and abs(tangent @ [2.0 * (v[0] - 1.0), v[1]]) < 1e-12
