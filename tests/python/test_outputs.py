"""Outputs on demand: what is read is computed, nothing else, and reading one thing gives what reading all gives."""

import copy
import pickle
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita.results import Result
from partita.results.source import ModelSource

ASKED_ONE_BY_ONE = ("bodies", "joints", "joint_accelerations", "reaction")


class Counting:
    """A motion of the core that notes what it is asked for."""

    def __init__(self, motion: Any) -> None:
        self.motion, self.asked = motion, list[tuple[str, Any]]()

    def __getattr__(self, name: str) -> Any:
        def call(*arguments: Any) -> Any:
            self.asked.append((name, arguments[-1] if name in ASKED_ONE_BY_ONE else None))
            return getattr(self.motion, name)(*arguments)

        return call


def watched(m: pt.Mechanism, run: Result) -> tuple[Result, Counting]:
    """The same result, over a motion that notes what it is asked for."""
    model, source = m.compile(), run.at_once
    assert isinstance(source, ModelSource)
    counting = Counting(source.motion)
    return Result(run.record, ModelSource(model.core, counting, model.summary)), counting


def loaded(name: str) -> tuple[pt.Mechanism, dict[str, int]]:
    """A loop with a user's torque in A and a user's force on the last body, and how often each was called."""
    m, calls = pt.catalogue.load(name), {"torque": 0, "force": 0}
    end = m.to_spec()["bodies"][-1]["name"]

    def torque(t: float, state: Any) -> float:
        calls["torque"] += 1
        return 0.3

    def force(t: float, state: Any) -> tuple[float, float, float]:
        calls["force"] += 1
        return (1.0, 0.0, 0.0)

    m.add_torque("A", value=torque)
    m.add_force(end, force=force, point=(0.1, 0.0, 0.0))
    return m, calls


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("name", ["four-bar-spring", "andrews-squeezer", "rssr", "spatial-slider-crank", "bricard"])
def test_one_by_one_is_what_all_at_once_is(name: str, coordinates: str) -> None:
    m = pt.catalogue.load(name)
    span = 0.02 if name == "andrews-squeezer" else 0.3
    run = m.simulate(span, t_eval=np.linspace(0.0, span, 9), coordinates=coordinates)
    seen, forces = run.at_once.observed, run.at_once.reactions
    for b, body in enumerate(run.names.bodies):
        one = run.body(body)
        for key in ("position", "rotation", "velocity", "angular_velocity"):
            assert np.array_equal(getattr(one, key), seen[f"body_{key}"][:, b]), (body, key)
    for j, name in enumerate(run.names.joints):
        joint, about = run.joint(name), run.summary["joints"][j]
        (q0, nq), (v0, nv) = about["q"], about["v"]
        assert np.array_equal(joint.position, seen["joint_position"][:, q0 : q0 + nq]), name
        assert np.array_equal(joint.velocity, seen["joint_velocity"][:, v0 : v0 + nv]), name
        assert np.array_equal(joint.acceleration, run.at_once.joint_accelerations[:, v0 : v0 + nv]), name
        assert np.array_equal(joint.drive, forces["drive"][:, v0 : v0 + nv]), name
        assert np.array_equal(joint.point, seen["joint_point"][:, j]), name
        assert np.array_equal(joint.force, forces["force"][:, j]), name
        assert np.array_equal(joint.moment, forces["moment"][:, j]), name
        turn = forces["joint_rotation"][:, j]
        assert np.allclose(joint.in_frame("joint").force, np.einsum("tij,ti->tj", turn, joint.force), rtol=1e-14)


def test_what_is_not_read_is_not_computed() -> None:
    m = pt.catalogue.load("rssr")  # nothing is redundant
    run, model = watched(m, m.simulate(0.5))
    assert model.asked == []
    first = run.names.joints[1]
    joint = run.joint(first)
    assert model.asked == []
    for _ in range(2):
        assert joint.force.shape == (201, 3) and run.joint(first).moment.shape == (201, 3)
    assert model.asked == [("shares_loads", None), ("reaction", 1)]
    assert run.joint(first).position.shape[0] == 201 and run.joint(first).point.shape == (201, 3)
    assert model.asked[2:] == [("joints", [1])]
    assert run.body(run.names.bodies[2]).position.shape == (201, 3)
    assert model.asked[3:] == [("bodies", [2])]
    assert run.energy.total.shape == (201,) and run.energy.kinetic.shape == (201,)
    assert model.asked[4:] == [("energies", None)]
    assert run.joint(first).acceleration.shape == run.joint(first).acceleration.shape == (201, joint.velocity.shape[1])
    assert model.asked[5:] == [("joint_accelerations", [1])]


@pytest.mark.parametrize("name", ["four-bar", "bricard"])
def test_a_run_asks_the_motion_that_the_core_keeps(name: str) -> None:
    """The same to the bit as of given states, however these lie in memory, and at some outputs as at all."""
    m = pt.catalogue.load(name)
    run = m.simulate(0.3, t_eval=np.linspace(0.0, 0.3, 9))
    source, core = run.at_once, m.compile().core
    assert isinstance(source, ModelSource) and source.motion.multipliers is run.multipliers
    tables = (run.q, run.v, run.vdot, run.multipliers)
    for order in ("C", "F"):
        given = core.motion(run.t, *(np.asarray(table, order=order) for table in tables))
        for key, values in {**given.reactions(), **given.bodies(), **given.checks(), **given.energies()}.items():
            reported = {**source.reactions, **source.observed, **source.checks, **source.energies}
            assert np.array_equal(values, reported[key], equal_nan=True), key
    some = source.motion.reactions([0, 7, 2])  # of what is shared the first says which joints share it
    assert all(np.array_equal(some[key], source.reactions[key][[0, 7, 2]]) for key in some)
    with pytest.raises(pt.errors.ArgumentError, match="there is no output 9"):
        source.motion.reactions([9])
    with pytest.raises(pt.errors.ArgumentError, match="this motion has no vdot"):
        core.motion(run.t, run.q, run.v).reaction(0)


def test_redundant_joints_share_loads_so_that_all_are_asked_at_once() -> None:
    m, calls = loaded("four-bar")
    run, model = watched(m, m.simulate(0.2, t_eval=np.linspace(0.0, 0.2, 11)))
    assert run.multipliers.shape[0] == 11
    calls.update(torque=0, force=0)
    for name in run.names.joints:
        assert run.joint(name).force.shape == (11, 3)
    assert model.asked == [("shares_loads", None), ("reactions", None)]
    assert calls == {"torque": 11, "force": 11}


def test_a_reaction_asks_only_what_acts_on_the_bodies_it_holds() -> None:
    m, calls = loaded("rssr")
    run = m.simulate(0.2, t_eval=np.linspace(0.0, 0.2, 11))
    cut = next(j["name"] for j in run.summary["joints"] if not j["tree"])
    assert calls["torque"] == calls["force"]
    calls.update(torque=0, force=0)
    assert run.multipliers.shape[0] == 11
    assert calls == {"torque": 11, "force": 11}  # evaluations of the equations call it once for each output
    calls.update(torque=0, force=0)
    assert run.joint("A").position.shape[0] == 11 and run.body("crank").position.shape == (11, 3)
    assert np.isfinite(run.joint(cut).force).all()
    assert calls == {"torque": 0, "force": 0}  # a pose needs no force, a cut joint its multipliers alone
    for name in run.names.joints:
        before = calls["force"]
        assert np.isfinite(run.joint(name).force).all()
        assert run.joint(name).moment.shape == (11, 3)
        assert calls["torque"] == 0  # what acts along a degree of freedom is no reaction
        assert calls["force"] - before in (0, 11)


def test_an_exception_of_the_user_comes_out_of_the_reading() -> None:
    m = pt.catalogue.load("four-bar")
    armed = {"on": False}

    def force(t: float, state: Any) -> tuple[float, float, float]:
        if armed["on"]:
            raise RuntimeError("no force today")
        return (0.0, 0.0, 0.0)

    end = m.to_spec()["bodies"][-1]["name"]
    m.add_force(end, force=force, point=(0.0, 0.0, 0.0))
    run = m.simulate(0.1, t_eval=[0.0, 0.1])
    armed["on"] = True
    with pytest.raises(RuntimeError, match="no force today"):
        run.at_once.reactions  # noqa: B018
    armed["on"] = False
    assert np.isfinite(run.at_once.reactions["force"]).all()


@pytest.mark.parametrize("stored", [False, True])
def test_results_and_their_parts_are_pickled_and_copied(stored: bool, tmp_path: Any) -> None:
    m = pt.catalogue.load("four-bar")
    run = m.simulate(0.3, t_eval=np.linspace(0.0, 0.3, 7))
    if stored:
        run = pt.results.load_result(run.save(tmp_path / "run.json"))
    for other in (pickle.loads(pickle.dumps(run)), copy.deepcopy(run), copy.copy(run)):
        assert other.names == run.names and other.summary == run.summary and other.spec == run.spec
        assert other.counters == run.counters and other.options == run.options and other.notes == run.notes
        assert other.partitions == run.partitions and repr(other) == repr(run)
        for key, values in run.arrays.items():
            assert np.array_equal(other.arrays[key], values, equal_nan=True), key
        assert np.array_equal(other.joint("A").force, run.joint("A").force)
        assert np.array_equal(other.body("coupler").position, run.body("coupler").position)
        assert np.array_equal(other.energy.total, run.energy.total)
        assert str(other.certificate) == str(run.certificate)
    for part in (run.joint("A").in_frame("joint"), run.body("crank"), run.energy, run.certificate, run.partitions[0]):
        for other in (pickle.loads(pickle.dumps(part)), copy.deepcopy(part)):
            assert repr(other) == repr(part)
    again = pickle.loads(pickle.dumps(run.joint("A").in_frame("joint")))
    assert np.array_equal(again.force, run.joint("A").in_frame("joint").force)
    assert np.array_equal(again.determined, run.joint("A").determined)


def test_a_result_with_functions_is_pickled_without_them() -> None:
    m, _ = loaded("four-bar")
    run = m.simulate(0.1, t_eval=[0.0, 0.1])
    other = pickle.loads(pickle.dumps(run))
    assert np.array_equal(other.joint("A").force, run.joint("A").force)


def test_a_run_of_a_system_is_pickled_and_copied() -> None:
    spring = pt.System(1, mass=[[1.0]], forces=lambda t, q, v: -4.0 * q)
    run = pt.simulate(spring, 1.0, [1.0], [0.0])
    for other in (pickle.loads(pickle.dumps(run)), copy.deepcopy(run)):
        assert np.array_equal(other.q, run.q) and not other.is_mechanism and not other.has_energy


def test_states_are_pickled_and_copied() -> None:
    m = pt.catalogue.load("four-bar")
    state = m.assemble(rates={"A": 1.0})
    for other in (pickle.loads(pickle.dumps(state)), copy.deepcopy(state), state.copy()):
        assert repr(other) == repr(state) and other.assembly == state.assembly
        assert other.position("A") == state.position("A") and other.velocity("A") == state.velocity("A")
        other.q[0] += 1.0
        assert other.q[0] != state.q[0]
    assert np.array_equal(
        m.simulate(0.1, initial=pickle.loads(pickle.dumps(state))).q, m.simulate(0.1, initial=state).q
    )


def test_an_output_asks_for_no_force_and_reading_asks_once() -> None:
    calls = {"mass": 0, "forces": 0}

    def counted(name: str, value: Any) -> Any:
        def call(*arguments: Any) -> Any:
            calls[name] += 1
            return value

        return call

    pendulum = pt.System(
        n=2,
        mass=counted("mass", np.eye(2)),
        forces=counted("forces", np.array([0.0, -9.81])),
        constraints=lambda t, q: [0.5 * (q @ q - 1.0)],
        jacobian=lambda t, q: [q],
        bias=lambda t, q, v: [v @ v],
    )

    def run(outputs: int) -> tuple[Result, int]:
        calls.update(mass=0, forces=0)
        found = pt.simulate(pendulum, 1.0, [1.0, 0.0], [0.0, 0.0], t_eval=np.linspace(0.0, 1.0, outputs + 1)[1:])
        return found, calls["forces"]

    # nearly every step has outputs in both; the interpolation of a step takes evaluations, outputs on it take none
    (some, fewer), (many, more) = run(100), run(200)
    interpolated = many.counters["dense_evaluations"] - some.counters["dense_evaluations"]
    assert some.counters["steps"] == many.counters["steps"] < 100 and more - fewer == interpolated <= 6
    calls.update(mass=0, forces=0)
    assert many.vdot.shape == (200, 2) and many.multipliers.shape == (200, 1) and many.closure.shape == (200,)
    described = calls["forces"]
    assert 200 <= described <= 400  # once for the accelerations, at most once more for the multipliers
    assert np.isfinite(many.vdot).all() and calls["forces"] == described
    calls.update(mass=0, forces=0)
    assert many.measure.shape == (200, 2) and many.sigma.shape == (200,)
    assert calls["forces"] <= described


@pytest.mark.parametrize("name", ["four-bar", "bricard", "three-rrr"])
def test_what_is_computed_later_does_not_depend_on_what_was_read_before(name: str) -> None:
    entry = pt.catalogue.entry(name)
    first, second = entry.simulate(), entry.simulate()
    order = ("vdot", "multipliers", "closure", "velocity_closure", "independent", "measure", "sigma", "sqrt_mu")
    one = {key: getattr(first, key) for key in order}
    other = {key: getattr(second, key) for key in reversed(order)}
    for key in order:
        assert np.array_equal(one[key], other[key], equal_nan=True), key
    residual = np.abs(first.at_once.reactions["residual"]).max()
    assert residual < 1e-8


def test_a_certificate_looks_at_every_step(tmp_path: Any) -> None:
    m = pt.catalogue.load("four-bar")
    options: dict[str, Any] = {"step": 0.01, "method": "rk4", "correction": "none", "rtol": 1e-6}
    start = m.assemble(rates={"A": 3.0})
    few, many = (
        m.simulate(2.0, t_eval=t, initial=start, **options) for t in ([0.01, 0.02], np.linspace(0.0, 2.0, 201))
    )
    drift = float(many.closure.max())
    assert drift > 1e2 * float(few.closure.max())  # the first steps do not show it
    assert few.certificate.closure == pytest.approx(drift, rel=1e-6)
    loaded = pt.results.load_result(few.save(tmp_path / "run.json"))
    assert loaded.certificate.closure == few.certificate.closure
    assert m.simulate(2.0, t_eval=[0.01], initial=start).certificate.closure < 1e-12
