"""All assemblies of a mechanism, and poses in closed form instead of by continuation."""

from __future__ import annotations

import numpy as np
import pytest
from test_assemble_many import five_bar

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
    offset = q - p
    far = np.linalg.norm(offset)
    along = (far**2 + r**2 - s**2) / (2 * far)
    across = side * np.sqrt(r**2 - along**2)
    return p + (along * offset + across * np.array([-offset[1], offset[0], 0.0])) / far


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


@pytest.mark.parametrize("rate", [5.0, 15.0, 30.0, 40.0])
def test_long_steps_keep_whole_turns(rate: float) -> None:
    """A fast crank at a loose tolerance: a step turns the coupler against it by more than half a turn."""
    m = four_bar()
    start = m.assemble(rates={"A": rate})
    runs = [
        m.simulate(3.0, initial=start, solver=pt.Solver(formulation), independent=["A"], rtol=1e-3, atol=1e-4)
        for formulation in ("explicit-closing", "wehage-haug")
    ]
    assert all(run.success for run in runs)
    turned, other = (run.joint("B").position[:, 0] for run in runs)
    # between outputs it turns by at most 1.2 rad; both within the tolerance, far from half a turn
    assert np.abs(np.diff(turned)).max() < 1.3
    assert np.abs(turned - other).max() < 0.5


def test_a_branch_is_kept_through_full_turns() -> None:
    """The Grashof crank turns three times; each motion stays on the side where it began."""
    m = four_bar()
    for one in m.assemblies(rates={"A": 4.0}, inputs=["A"]):
        side = next(iter(one.branches.values()))
        for formulation in ("projective", "explicit-closing", "wehage-haug"):
            run = m.simulate(5.0, initial=one.state, solver=pt.Solver(formulation), rtol=1e-9)
            assert run.success, run.message
            assert np.ptp(run.joint("A").position) > 6 * np.pi
            b, c = run.body("2").point((0, 0, 0)), run.body("2").point((COUPLER, 0, 0))
            offset, link = np.array([GROUND, 0.0, 0.0]) - b, c - b
            turn = offset[:, 0] * link[:, 1] - offset[:, 1] * link[:, 0]
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
    with pytest.raises(pt.errors.AssemblyError, match=r"guide.* with opposed axes"):
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


def test_user_systems_start_nearest_to_the_velocities_given() -> None:
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


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_any_joint_has_targets_and_rates(coordinates: str) -> None:
    """Those of the tree, those that close loops, and all in absolute coordinates: the same bodies, moving alike."""
    m = four_bar()
    reference = m.assemble({"A": 0.7}, rates={"A": 1.5})
    run = m.simulate(0.01, initial=reference, t_eval=[0.0])
    for joint in "ABCD":
        at, rate = run.joint(joint).position[0, 0], run.joint(joint).velocity[0, 0]
        state = m.assemble({joint: at}, rates={joint: rate}, coordinates=coordinates)
        again = m.simulate(0.01, initial=state, t_eval=[0.0], coordinates=coordinates)
        for other in "ABCD":
            assert again.joint(other).position == pytest.approx(run.joint(other).position, abs=1e-10)
            assert again.joint(other).velocity == pytest.approx(run.joint(other).velocity, abs=1e-10)
    # with degrees of freedom left the motion has the least energy: that which rates of the tree give
    three = pt.catalogue.load("three-rrr")
    outside = next(j["name"] for j in three.compile().summary["joints"] if not j["tree"])
    state = three.assemble(rates={outside: 1.0, "A1": 0.3}, coordinates=coordinates)
    run = three.simulate(0.01, initial=state, t_eval=[0.0], coordinates=coordinates)
    assert run.joint(outside).velocity[0, 0] == pytest.approx(1.0, abs=1e-12)
    assert run.joint("A1").velocity[0, 0] == pytest.approx(0.3, abs=1e-12)
    rest = three.assemble(rates={outside: 1.0, "A1": 0.3, "A2": run.joint("A2").velocity[0, 0] + 0.05})
    more = three.simulate(0.01, initial=rest, t_eval=[0.0])
    assert run.energy.kinetic[0] < more.energy.kinetic[0]
    with pytest.raises(ArgumentError, match="are incompatible"):
        m.assemble(rates={"C": 1.0, "A": 5.0}, coordinates=coordinates)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e3])
def test_points_are_targets(scale: float) -> None:
    m = two_links(scale)
    for goal in ((1.2, 0.9), (0.4, -1.1)):
        target = {("2", (scale, 0, 0), "xy"): scale * np.array(goal)}
        for coordinates in ("relative", "absolute"):
            state = m.assemble(target, coordinates=coordinates)
            run = m.simulate(1e-3, initial=state, t_eval=[0.0], coordinates=coordinates)
            assert run.body("2").point((scale, 0, 0))[0, :2] / scale == pytest.approx(goal, abs=1e-11)
    with pytest.raises(AssemblyError, match=r"point .* of 2 in x ends at .* no configuration reaches the target"):
        m.assemble({("2", (scale, 0, 0), "xy"): (2.5 * scale, 0.0)})


def two_links(scale: float = 1.0) -> pt.Mechanism:
    """An arm of two links of length 1, its elbow bent."""
    m = pt.Mechanism("arm")
    a, b, c = (scale * np.array(p) for p in ((0.0, 0, 0), (0.8, 0.6, 0), (1.4, 1.4, 0)))
    one, two = m.add_rod("1", start=a, end=b, mass=1.0), m.add_rod("2", start=b, end=c, mass=1.0)
    m.add_revolute("shoulder", m.ground, one, point=a)
    m.add_revolute("elbow", one, two, point=b)
    return m


def test_targets_in_order_of_priority() -> None:
    """The first are met; the next come as near as those let them: the nearest point of a circle, in closed form."""
    m = two_links()
    shoulder, wish = 0.3, np.array([2.0, 2.5])
    state = m.assemble([{"shoulder": shoulder}, {("2", (1, 0, 0), "xy"): wish}])
    assert state.position("shoulder") == pytest.approx(shoulder, abs=1e-15)
    b = np.array([0.8 * np.cos(shoulder) - 0.6 * np.sin(shoulder), 0.8 * np.sin(shoulder) + 0.6 * np.cos(shoulder)])
    nearest = b + (wish - b) / np.linalg.norm(wish - b)
    run = m.simulate(1e-3, initial=state, t_eval=[0.0])
    assert run.body("2").point((1, 0, 0))[0, :2] == pytest.approx(nearest, abs=1e-7)
    assert state.assembly is not None
    reported = {entry["target"]: entry for entry in state.assembly["targets"]}
    assert reported["shoulder"]["priority"] == 0 and reported["shoulder"]["reached"] == reported["shoulder"]["asked"]
    x = reported["point (1, 0, 0) of 2 in x"]
    assert (x["priority"], x["asked"]) == (1, 2.0) and x["reached"] == pytest.approx(nearest[0], abs=1e-7)
    # the other way round: the point is met, and the shoulder wherever that leaves it
    swapped = m.assemble([{("2", (1, 0, 0), "xy"): (1.2, 0.9)}, {"shoulder": 1.0}])
    alone = m.assemble({("2", (1, 0, 0), "xy"): (1.2, 0.9)})
    assert swapped.q == pytest.approx(alone.q, abs=1e-9)
    # what can be had is had exactly, level after level
    both = m.assemble([{}, {"shoulder": 0.2}, {"elbow": -0.3}, {"elbow": 5.0}])
    assert both.q == pytest.approx([0.2, -0.3], abs=1e-12)
    # in a loop: one degree of freedom goes to the first
    bar = four_bar()
    assert bar.assemble([{"A": 0.5}, {"D": 2.0}]).q == pytest.approx(bar.assemble({"A": 0.5}).q, abs=1e-12)
    # nothing asked for with force: the crank goes to where the rocker's end is
    limit = four_bar(1.05).assemble([{}, {"A": 1.5}])
    assert limit.position("A") == pytest.approx(1.128032, abs=2e-6)


def test_joints_that_are_held() -> None:
    """A drawing left open closes around what is held, and targets move the rest."""
    m = four_bar()
    rough = pt.Mechanism("rough")
    a, b, c, d = (0.0, 0, 0), (0.0, CRANK, 0), (1.1, 1.0, 0), (GROUND, 0, 0)
    for name, s, e in (("1", a, b), ("2", b, c), ("3", d, c)):
        rough.add_rod(name, start=s, end=e, mass=1.0)
    rough.add_revolute("A", rough.ground, "1", point=a)
    rough.add_revolute("B", "1", "2", point=b)
    rough.add_revolute("C", "2", "3", point=c, child_point=(1.02, 0.8, 0))
    rough.add_revolute("D", rough.ground, "3", point=d)
    free, held = rough.assemble(), rough.assemble(fixed=["A"])
    assert abs(free.position("A")) > 1e-3 and held.position("A") == 0.0
    # two motors, one of which stays where it is
    five = five_bar()
    assert five.assemble({"A": 0.3}, fixed=["E"]).position("E") == 0.0
    assert five.assemble({"A": 0.3}, fixed=["C"]).position("E") != 0.0
    poses = five.assemble_many({"A": [0.3], "E": [five.assemble({"A": 0.3}, fixed=["C"]).position("E")]})
    assert poses.joint("C") == pytest.approx([0.0], abs=1e-11)
    with pytest.raises(AssemblyError, match="contradict each other"):
        m.assemble({"D": 0.5}, fixed=["A"])
    with pytest.raises(ArgumentError, match="list of joints"):
        m.assemble(fixed="A")
    with pytest.raises(UnknownNameError, match="neither a joint"):
        m.assemble(fixed=["Q"])


def test_a_guess_is_a_start_by_names() -> None:
    """Near the other assembly it leads to that one, whether its joints are in the state or not."""
    m = four_bar()
    here, there = (one.state for one in m.assemblies(inputs=["A"]))
    other = {name: there.position(name) for name in there.names}
    assert m.assemble(guess=other).q == pytest.approx(there.q, abs=1e-12)
    rough = {name: value + 0.05 for name, value in other.items()}
    assert np.linalg.norm(m.assemble(guess=rough).q - there.q) < 0.2 * np.linalg.norm(here.q - there.q)
    c = m.assemble_many({"A": [0.0]}, near=there).joint("C")[0]
    by_cut = m.assemble(guess={"C": c, "B": there.position("B")})
    assert np.linalg.norm(by_cut.q - there.q) < 0.5 * np.linalg.norm(here.q - there.q)
    with pytest.raises(ArgumentError, match="guess must be a dict"):
        m.assemble(guess=[1.0])  # type: ignore[arg-type]


def test_targets_that_contradict_each_other_are_reported() -> None:
    m = four_bar()
    with pytest.raises(AssemblyError) as caught:
        m.assemble({"A": 0.5, "D": 2.0})
    words = str(caught.value)
    assert "A = 0.500000 and D = 2.000000 contradict each other: with A = 0.500000 D can be" in words
    for one in m.assemblies({"A": 0.5}, inputs=["A"]):
        assert f"{one.state.position('D'):.6f}" in words


def test_where_a_joint_ends_and_what_is_missing() -> None:
    """A crank too long to turn round ends where coupler and rocker just reach; beyond, they miss by so much."""
    crank = 1.05
    m = four_bar(crank)
    with pytest.raises(AssemblyError) as caught:
        m.assemble({"A": 1.5})

    def far(angle: float) -> float:
        return float(np.hypot(-crank * np.sin(angle) - GROUND, crank * np.cos(angle)))

    # where B is as far from D as the links reach
    stretched = COUPLER + ROCKER
    end = np.arcsin((stretched**2 - crank**2 - GROUND**2) / (2 * crank * GROUND))
    assert f"A ends at {end:.5f}" in str(caught.value)[: str(caught.value).index(" rad")]
    assert caught.value.residual == pytest.approx(far(1.5) - stretched, rel=1e-6)
    assert "the loop through A, D, B closed by joint" in caught.value.loops


def test_a_free_joint_may_have_the_name_of_its_body() -> None:
    """Names of relative and absolute coordinates are then the same; the contents of a state are those of its model."""
    m = pt.Mechanism("thrown", gravity=None)
    m.add_body("ball", mass=1.0, inertia=(1, 2, 3), com=(0.3, 0.1, 0.2), position=(1, 2, 3))
    m.add_free("ball", m.ground, "ball", point=(1, 2, 3))
    model = m.compile()
    assert model.names == m.compile(coordinates="absolute").names
    velocity = (0.5, -0.3, 0.8)
    state = m.assemble(rates={"ball": (*velocity, 1.0, 2.0, -1.0)})
    for start in (state, m.convert(state, "absolute")):
        for coordinates in ("relative", "absolute"):
            run = m.simulate(0.1, initial=start, coordinates=coordinates)
            assert run.body("ball").velocity[0] == pytest.approx(velocity, abs=1e-14)
    assert m.convert(m.convert(state, "absolute"), "relative").v == pytest.approx(state.v, abs=1e-14)
    with pytest.raises(ArgumentError, match="names of relative and of absolute"):
        m.convert(pt.State(0.0, state.q, state.v, model.names, model.velocity_names), "absolute")
