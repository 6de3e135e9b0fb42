"""What is kept with a model makes later runs cheaper and changes none: each equals that of a model of its own."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita import options as run_options
from partita.errors import Interrupted, PartitaError

Run = Callable[[pt.Mechanism], pt.Result]
ARRAYS = ("t", "q", "v", "vdot", "multipliers", "closure", "sigma", "sqrt_mu", "measure")


def driven() -> pt.Mechanism:
    """A four-bar turned at a rate that changes with time, with a torque that does."""
    m = pt.Mechanism("driven")
    points = [(0, 0, 0), (0, 0.3, 0), (0.8, 0.7, 0), (1, 0, 0)]
    bars = [m.add_rod(f"bar {i}", start=points[i], end=points[i + 1], mass=1.0) for i in range(3)]
    m.add_revolute("A", m.ground, bars[0], point=points[0])
    m.add_revolute("B", bars[0], bars[1], point=points[1])
    m.add_revolute("C", bars[1], bars[2], point=points[2])
    m.add_revolute("D", m.ground, bars[2], point=points[3])
    times = np.linspace(0.0, 3.0, 61)
    m.add_drive("A", (times, 0.4 * np.sin(2.0 * times)))
    m.add_torque("D", lambda t, state: 0.3 * math.cos(5.0 * t) - 0.1 * state.velocity("D"))
    return m


def reported(run: pt.Result) -> dict[str, Any]:
    """All of a run, to the last bit. Whether an evaluation ran by code depends on earlier runs, as its time does."""
    arrays = {name: np.asarray(getattr(run, name)).tobytes() for name in ARRAYS}
    counters = {name: count for name, count in run.counters.items() if name != "compiled_evaluations"}
    plain = (run.status, run.message, run.notes, counters, run.options, [vars(x) for x in run.partitions])
    force = b"" if not run.has_energy else b"".join(a.tobytes() for a in run.at_once.reactions.values())
    return {**arrays, "plain": repr(plain), "force": force}


def start(m: pt.Mechanism, name: str) -> pt.State | None:
    return pt.catalogue.entry(name).initial(m) if name in pt.catalogue.names() else None


def other_state(m: pt.Mechanism, name: str) -> pt.State:
    """A state of the motion itself, some way from the start."""
    run = m.simulate(SPANS.get(name, 0.7), initial=start(m, name), t_eval=[SPANS.get(name, 0.7)])
    return run.state()


SPANS = {"andrews-squeezer": 0.004}
NAMES = ("four-bar", "slider-crank", "andrews-squeezer", "double-four-bar", "bricard", "heavy-top", "driven")
MADE: dict[str, Callable[[], pt.Mechanism]] = {"driven": driven}


def made(name: str) -> pt.Mechanism:
    return MADE[name]() if name in MADE else pt.catalogue.load(name)


def runs_of(name: str) -> dict[str, Run]:
    """Different questions to one model."""
    span = SPANS.get(name, 0.3)

    def run(m: pt.Mechanism, **asked: Any) -> pt.Result:
        asked.setdefault("initial", start(m, name))
        return m.simulate(asked.pop("duration", span), t_eval=asked.pop("t_eval", None), **asked)

    found: dict[str, Run] = {
        "as usual": run,
        "short, fixed": lambda m: run(m, duration=0.01 * span, step=0.01 * span, method="rk4"),
        "from another state": lambda m: run(m, initial=other_state(m, name)),
        "multipliers": lambda m: run(m, solver=pt.Solver("multipliers")),
        "gram-schmidt": lambda m: run(m, solver=pt.Solver("gram-schmidt")),
        "persistence": lambda m: run(m, solver=pt.Solver(selection="persistence", window=span)),
        "absolute": lambda m: run(m, coordinates="absolute", duration=0.1 * span),
        "tight": lambda m: run(m, rtol=1e-11, atol=1e-12, duration=0.2 * span),
    }
    if name == "four-bar":
        found["heavier"] = lambda m: run(m, parameters={"coupler.mass": 5.0})
        found["on the moon"] = lambda m: run(m, parameters={"gravity": (0.0, -1.62, 0.0)})
    if name == "driven":
        late = {"t": 1.5}
        found["later"] = lambda m: run(m, initial=m.assemble(**late))
    return found


@pytest.mark.parametrize("name", NAMES)
def test_a_run_is_what_it_is_on_a_fresh_model(name: str) -> None:
    """Each question to a model that answers all of them, forwards and back again, and to a model of its own."""
    runs = runs_of(name)
    alone = {title: reported(run(made(name))) for title, run in runs.items()}
    used = made(name)
    for title in [*runs, *reversed(list(runs))]:
        found = reported(runs[title](used))
        differs = [key for key, value in alone[title].items() if found[key] != value]
        assert not differs, f"{title}: {differs}"


def test_no_verdict_is_kept_for_another_state() -> None:
    """A start off the constraints is refused as before after runs that went well, and those go well
    after the refusals."""
    m = made("double-four-bar")
    first = reported(m.simulate(0.1, initial=start(m, "double-four-bar")))
    state = start(m, "double-four-bar")
    assert state is not None
    inconsistent = state.copy()
    inconsistent.q[0] += 0.3
    opened = state.copy()
    opened.v[0] += 0.3
    fresh = made("double-four-bar")
    noted = reported(fresh.simulate(0.1, initial=opened))
    for _ in range(2):
        with pytest.raises(PartitaError, match="violates the constraints"):
            m.simulate(0.1, initial=inconsistent)
        assert reported(m.simulate(0.1, initial=opened)) == noted
        assert reported(m.simulate(0.1, initial=state)) == first
    assert "violates the constraints" in noted["plain"] and "violates the constraints" not in first["plain"]


@pytest.mark.parametrize("name", ["four-bar", "andrews-squeezer", "bricard"])
def test_threads_that_share_a_model_get_what_one_gets(name: str) -> None:
    """Runs at the same time on one compiled model, of different starts and forms."""
    m = made(name)
    model, span = m.compile(), SPANS.get(name, 0.3)
    states = [start(m, name), other_state(m, name)]
    forms = ["projective", "multipliers", "gram-schmidt"]

    def run(i: int) -> tuple[bytes, bytes]:
        state = states[i % 2]
        assert state is not None
        times = state.t + np.linspace(0.0, span, 11)
        asked = run_options.options(state.t, span, model.velocity_names, solver=pt.Solver(forms[i % 3]))
        raw = run_options.run(model.core, asked, np.clip(times, state.t, asked["t_end"]), state.q, state.v, False)
        assert raw["success"]
        return raw["arrays"]["q"].tobytes(), raw["arrays"]["v"].tobytes()

    wanted = [run(i) for i in range(6)]
    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(run, [*range(6)] * 8)) == wanted * 8


class Stopped(Exception):
    """Raised by a function of the user."""


@pytest.mark.parametrize("error", [Stopped, KeyboardInterrupt])
def test_a_run_that_was_stopped_leaves_nothing_behind(error: type[BaseException]) -> None:
    """A function that raises in the middle of a run, in one thread and in several: later runs are as on a new model."""
    now = threading.local()

    def torque(t: float, state: pt.state.StateView) -> float:
        if getattr(now, "fails", False) and t > 0.15:
            raise error("enough")
        return 0.3 * math.cos(5.0 * t) - 0.1 * state.velocity("D")

    def built() -> pt.Mechanism:
        m = pt.catalogue.load("four-bar")
        m.add_torque("D", torque)
        return m

    fresh = reported(built().simulate(0.3))
    m = built()

    def stopped(_: int) -> bool:
        now.fails = True
        try:
            run = m.simulate(0.3)
        except Interrupted as stop:
            run = stop.result
        finally:
            now.fails = False
        return not run.success and 0.0 < run.t[-1] < 0.3 and reported(m.simulate(0.3)) == fresh

    assert stopped(0)
    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(stopped, range(16)))


def test_a_run_interrupted_between_steps_leaves_nothing_behind() -> None:
    """Ctrl-C while no function of the user is at work arrives in `progress`."""
    m, fresh = made("four-bar"), made("four-bar")
    asked: dict[str, Any] = {"initial": start(m, "four-bar"), "rtol": 1e-10}
    first = reported(fresh.simulate(0.3, **asked))

    def interrupt(done: float) -> None:
        raise KeyboardInterrupt

    for _ in range(2):
        with pytest.raises(Interrupted):
            m.simulate(3000.0, t_eval=[3000.0], progress=interrupt, **asked)
        assert reported(m.simulate(0.3, **asked)) == first


def test_what_is_changed_between_runs_is_seen() -> None:
    """Options, states, parameters and the description itself, back and forth on one mechanism."""
    m = made("four-bar")

    def changes(of: pt.Mechanism) -> list[Callable[[], pt.Result]]:
        state, end = start(of, "four-bar"), {"t_eval": [0.2]}
        assert state is not None
        other = state.copy()
        other.v *= 1.5
        return [
            lambda: of.simulate(0.2, initial=state, **end),
            lambda: of.simulate(0.2, initial=other, **end),
            lambda: of.simulate(0.2, initial=state, rtol=1e-6, **end),
            lambda: of.simulate(0.2, initial=state, method="tsit5", **end),
            lambda: of.simulate(0.2, initial=state, parameters={"coupler.mass": 3.0}, **end),
            lambda: of.simulate(0.2, initial=state, solver=pt.Solver(selection="greedy"), **end),
        ]

    alone = [reported(changes(made("four-bar"))[i]()) for i in range(6)]
    assert len({repr(x) for x in alone}) == 6, "each of them changes something"
    for order in (range(6), reversed(range(6))):
        for i in order:
            assert reported(changes(m)[i]()) == alone[i], i
    m.gravity = (0.0, -1.62, 0.0)
    moon = made("four-bar")
    moon.gravity = (0.0, -1.62, 0.0)
    assert reported(changes(m)[0]()) == reported(changes(moon)[0]()) != alone[0]
