"""Many motions of one mechanism in one call: other initial states, other parameters."""

from __future__ import annotations

import copy
import os
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import options as run_options
from ..analyses.still import place
from ..builder.compiled import CompiledModel
from ..builder.parameter_units import parameter_unit
from ..errors import ArgumentError, Interrupted, PartitaError, UnknownNameError
from ..events import Event
from ..extras import extra
from ..numeric import floats, is_list, shown
from ..progress import reporting
from ..results import Result
from ..state import State
from ..sweep.ensemble_store import MemberStore, identity, opened
from .models import Modelled, layout_of
from .set_valued import is_set_valued
from .solve import simulate, start_of

if TYPE_CHECKING:
    import xarray

FloatArray = NDArray[np.float64]
AT_ONCE = 8192
"""Members that are in memory at once where results go to a store."""


class Ensemble:
    """Motions of many members of one mechanism, as computed by `Mechanism.ensemble`.

    Attributes:
        t: times of the outputs (nt,) [s], the same for all members.
        q: coordinates (members, nt, nq), named by `names`; NaN from the output on that a member did not reach.
        v: velocities (members, nt, nv), named by `velocity_names`.
        status: (members,) words, as in `Result.status`: "finished", "singular", "evaluation-failed", ...
        success: (members,) bool: reached its end with all loops closed.
        messages: number of a member that did not succeed -> why.
        in_lanes: (members,) bool: computed side by side with others; the rest by ordinary runs.
        steps: number of steps that those took together, each of twelve evaluations.
        parameters: name -> values (members, ...) that varied; empty if none did.
        notes: what ran how, in sentences."""

    def __init__(
        self,
        mechanism: Modelled,
        model: CompiledModel,
        t: FloatArray,
        states: list[State],
        parameters: dict[str, FloatArray],
        tolerances: dict[str, float],
        raw: dict[str, Any],
        drawn: bool,
    ) -> None:
        self._mechanism, self._model = mechanism, model
        self._states, self._tolerances, self._drawn = states, tolerances, drawn
        self.t, self.parameters = t, parameters
        self.q: FloatArray = raw["q"]
        self.v: FloatArray = raw["v"]
        self.status: NDArray[np.str_] = np.array(raw["status"], dtype="U17")
        self.success: NDArray[np.bool_] = self.status == "finished"
        self.messages: dict[int, str] = dict(raw["messages"])
        self.in_lanes: NDArray[np.bool_] = raw["in_lanes"]
        self.steps: int = raw["steps"]
        self.notes = _notes(raw, self.in_lanes)

    @property
    def names(self) -> list[str]:
        """Names of the coordinates, the last axis of `q`."""
        return list(self._model.names)

    @property
    def velocity_names(self) -> list[str]:
        """Names of the velocities, the last axis of `v`."""
        return list(self._model.velocity_names)

    def __len__(self) -> int:
        return len(self.status)

    def initial(self, index: int) -> State:
        """The state from which a member was requested to start."""
        i = place(index, len(self), "a member")
        return self._states[0 if self._drawn else i]

    def result(self, index: int, *, events: Iterable[Event | Callable[..., Any]] | None = None) -> Result:
        """The full result of one member, with its reactions, energies and certificate: its ordinary run, computed when
        it is asked for. It agrees with `q` and `v` to the tolerance. `events` are those of `Mechanism.simulate`, found
        in that run.

        Raises what `Mechanism.simulate` raises for a member that cannot start, and for events.

        >>> import partita as pt
        >>> m = pt.catalogue.load("four-bar")
        >>> states = [m.assemble(rates={"A": rate}) for rate in (4.0, 8.0)]
        >>> found = m.ensemble(states=states, t_eval=[0.0, 1.0])
        >>> back = [found.result(i, events=[pt.Event("back", "D", reads="velocity")]).events for i in range(2)]
        >>> bool(back[0][0].t > back[1][0].t)
        True
        """
        i = place(index, len(self), "a member")
        own = {name: values[i] for name, values in self.parameters.items()} or None
        start = self.initial(i)
        duration = float(self.t[-1]) - start.t
        initial = None if self._drawn else start
        given: dict[str, Any] = {"initial": initial, "parameters": own, "events": events, **self._tolerances}
        return simulate(self._mechanism, duration, t_eval=self.t, **given)

    def to_xarray(self) -> xarray.Dataset:
        """An `xarray.Dataset` with the dimensions member, t, coordinate and velocity: q, v, status, success, and the
        parameters that varied. Needs xarray."""
        xr = extra("xarray", "xarray", "to_xarray")
        data: dict[str, Any] = {
            "q": (("member", "t", "coordinate"), self.q),
            "v": (("member", "t", "velocity"), self.v),
            "status": ("member", self.status),
            "success": ("member", self.success),
        }
        for name, values in self.parameters.items():
            data[name] = (("member", f"{name}_axis0")[: values.ndim], values)
        coordinates = {"t": self.t, "coordinate": self.names, "velocity": self.velocity_names}
        return xr.Dataset(data, coords=coordinates)

    def __repr__(self) -> str:
        words, counts = np.unique(self.status, return_counts=True)
        listed = ", ".join(f"{count} {word}" for word, count in zip(words, counts, strict=True))
        return f"<ensemble of {len(self)} members, {len(self.t)} outputs: {listed}>"


def _notes(raw: dict[str, Any], in_lanes: NDArray[np.bool_]) -> list[str]:
    count, beside = len(in_lanes), int(in_lanes.sum())
    if raw["refusal"] is not None:
        return [f"all {count} members were computed by ordinary runs, one by one: {raw['refusal']}"]
    notes = [f"{beside} of {count} members were computed side by side, in {raw['steps']} steps"]
    if beside < count:
        notes.append(
            f"{count - beside} members were computed by ordinary runs: next to singular positions, with choices of "
            "coordinates that the others do not need, or because they cannot start"
        )
    return notes


def ensemble(
    self: Modelled,
    *,
    states: Iterable[State] | None = None,
    parameters: Mapping[str, ArrayLike] | None = None,
    t_eval: ArrayLike,
    rtol: float = 1e-8,
    atol: float = 1e-10,
    workers: int | None = None,
    store: Any = None,
    progress: Any = False,
) -> Ensemble:
    """Compute many motions at once: for other initial states, other parameters, or both, member by member.

    Members are integrated side by side, each with its own step size, by the method and the step control of
    `simulate` ("projective", "dop853", also where forces are stiff); what an ordinary step does not cover (singular
    positions, a choice of coordinates that becomes poor) is left to an ordinary run of that member. A member agrees
    with its ordinary run to the tolerance, and does not depend on the other members' errors or on the number of
    workers. Prefer it to a loop over `simulate` from about a hundred members on. Mechanisms with Python functions,
    prescribed motions, contacts, stops or tables run member by member, on all cores where nothing calls Python;
    `notes` says so.

    Args:
        states: initial states, one for each member, all at the same time; None: the drawing, assembled with each
            member's parameters, at rest.
        parameters: name -> values (members,) or (members, numbers), numbers that replace those of the drawing, as in
            `CompiledModel.with_parameters`.
        t_eval: increasing times of the outputs (nt,) [s]; the last one is the end.
        rtol, atol: as in `simulate`.
        workers: number of threads at most; None: the number of cores.
        store: name of a folder in which `q` and `v` are kept as NumPy's q.npy and v.npy while they come, some thousand
            members at a time: then memory does not grow with the members, and both are memory-mapped arrays. If it
            exists, the same ensemble continues: what it has is not computed again (one whose mechanism calls Python
            functions, which cannot be recognised, does not). None: in memory.
        progress: True: a progress bar on the terminal (needs tqdm); or a function of the completed fraction, 0 to 1.

    Returns:
        `Ensemble`: times, coordinates and velocities of all members, and how each ended. A member that fails is no
        error.

    Raises:
        ArgumentError: lengths differ, numbers are not finite, states have different times, or the store belongs to
        another ensemble. UnknownNameError: there is no such parameter. AssemblyError: the drawing cannot be assembled.
        FileFormatError: the store cannot be written, is damaged, or another process writes to it.

    >>> import numpy as np
    >>> import partita as pt
    >>> m = pt.catalogue.load("four-bar")
    >>> states = [m.assemble(rates={"A": rate}) for rate in np.linspace(1.0, 6.0, 100)]
    >>> found = m.ensemble(states=states, t_eval=[0.0, 0.5, 1.0])
    >>> found
    <ensemble of 100 members, 3 outputs: 100 finished>
    >>> found.q.shape
    (100, 3, 3)
    """
    model, _ = layout_of(self, "relative")
    numbers, values = _values(parameters, model)
    starts = _starts(self, states, model)
    count = _members(starts, values, states is not None)
    t0 = starts[0].t
    times = _times(t_eval, t0)
    tolerances: dict[str, Any] = {"rtol": rtol, "atol": atol}
    chosen = run_options.options(t0, float(times[-1]) - t0, model.velocity_names, rtol=rtol, atol=atol)
    if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int) or workers < 1):
        raise ArgumentError(f"workers must be a positive integer, not {shown(workers)}", argument="workers")
    threads = None if workers is None else min(workers, os.cpu_count() or 1)
    table = np.hstack([x.reshape(count, -1) for x in values.values()]) if values else np.zeros((count, 0))
    widths = (model.core.nq, model.core.nv)
    lists = [x.q for x in starts], [x.v for x in starts]
    q, v = (np.concatenate(x).reshape(len(starts), width) for x, width in zip(lists, widths, strict=True))
    shapes = [(count, len(times), width) for width in widths]
    holding = next((x.name for x in self._description.forces.values() if is_set_valued(x)), None)

    def whose() -> str | None:
        more = [rtol, atol, t0, [list(x) for x in numbers], states is None, AT_ONCE]
        return identity(self.to_spec(), [times, q, v, table], more)

    with (
        reporting(progress, count, "members") as report,
        nullcontext() if store is None else opened(store, shapes, whose) as kept,
    ):

        def part(first: int, last: int) -> dict[str, Any]:
            def forward(done: float) -> None:
                if report is not None:
                    report((first + done * (last - first)) / count)

            rows = slice(None) if states is None else slice(first, last)
            if holding is not None:
                members: list[dict[str, Any]] = [
                    {"parameters": {name: x[i] for name, x in values.items()} or None}
                    | {"initial": None if states is None else starts[i]}
                    for i in range(first, last)
                ]
                span = (t0, times)
                found = _one_by_one(self, members, span, tolerances, (widths, threads, holding, forward))
                forward(1.0)
                return found
            found = model.core.ensemble(
                chosen.core,
                times,
                q[rows],
                v[rows],
                numbers,
                np.ascontiguousarray(table[first:last]),
                states is None,
                threads,
                None if report is None else forward,
            )
            forward(1.0)
            return found

        raw = part(0, count) if kept is None else _in_parts(part, count, kept)
    return Ensemble(copy.deepcopy(self), model, times, starts, values, tolerances, raw, states is None)


def _one_by_one(
    mechanism: Modelled,
    members: Sequence[dict[str, Any]],
    span: tuple[float, FloatArray],
    tolerances: dict[str, Any],
    how: tuple[tuple[int, int], int | None, str, Callable[[float], None]],
) -> dict[str, Any]:
    """Members as ordinary runs, in which elements hold at times; of a run that ends early the rest is NaN."""
    (nq, nv), threads, name, forward = how
    (t0, times), count = span, len(members)
    nt = len(times)
    q, v = np.full((count, nt, nq), np.nan), np.full((count, nt, nv), np.nan)
    status, messages = ["finished"] * count, list[tuple[int, str]]()
    duration = float(times[-1]) - t0

    stopped = threading.Event()

    def look(_: float) -> None:
        if stopped.is_set():
            raise CancelledError

    def run(member: dict[str, Any]) -> Result | PartitaError:
        try:
            return simulate(mechanism, duration, t_eval=times, progress=look, **member, **tolerances)
        except Interrupted:
            raise
        except PartitaError as error:
            return error

    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        try:
            for i, found in enumerate(pool.map(run, members)):
                if isinstance(found, PartitaError):
                    status[i] = "evaluation-failed"
                    messages.append((i, str(found)))
                else:
                    q[i, : len(found.t)], v[i, : len(found.t)] = found.q, found.v
                    status[i] = found.status
                    if not found.success:
                        messages.append((i, found.message))
                forward((i + 1) / count)
        except BaseException:
            # an interrupt reaches this thread alone
            stopped.set()
            pool.shutdown(cancel_futures=True)
            raise
    refusal = f'"{name}" holds at times, which each run finds by its own steps'
    ended = {"status": status, "messages": messages, "steps": 0, "refusal": refusal}
    return {**ended, "q": q, "v": v, "in_lanes": np.zeros(count, dtype=bool)}


def _in_parts(part: Callable[[int, int], dict[str, Any]], count: int, kept: MemberStore) -> dict[str, Any]:
    """All members, some thousands at a time, whose q and v go to disk; parts that are there are not computed again."""
    found: dict[str, Any] = {"status": [], "messages": [], "steps": 0}
    in_lanes = []
    for number, first in enumerate(range(0, count, AT_ONCE)):
        last = min(first + AT_ONCE, count)
        rows = slice(first, last)
        raw = kept.known(number, rows)
        if raw is None:
            raw = kept.keep(number, rows, part(first, last))
        found["status"] += raw["status"]
        found["messages"] += [(first + i, message) for i, message in raw["messages"]]
        found["steps"] += raw["steps"]
        found["refusal"] = raw["refusal"]
        in_lanes.append(raw["in_lanes"])
    q, v = kept.arrays
    return {**found, "q": q, "v": v, "in_lanes": np.concatenate(in_lanes)}


def _values(
    parameters: Mapping[str, ArrayLike] | None, model: CompiledModel
) -> tuple[list[tuple[str, int]], dict[str, FloatArray]]:
    """Names with the count of their numbers, and the values of the members."""
    if parameters is None:
        return [], {}
    if not isinstance(parameters, Mapping):
        message = f"parameters must be a dict such as {{'crank.mass': [1.0, 2.0]}}, not {shown(parameters)}"
        raise ArgumentError(message, argument="parameters")
    known = dict(model.core.parameters())
    numbers, values = [], {}
    for key, given in parameters.items():
        name = str(key)
        if name not in known:
            raise UnknownNameError(
                f"parameters: there is no parameter {name!r}; known: {', '.join(sorted(known))}",
                name=name,
                known=sorted(known),
            )
        count = len(known[name])
        try:
            found = floats(run_options.si(f"parameters[{name!r}]", given, parameter_unit(model._drawn, name)))
        except TypeError as error:
            message = f"parameters[{name!r}] must be an array of numbers, not {shown(given)}"
            raise ArgumentError(message, argument="parameters") from error
        if found.ndim == 0 or found.size != len(found) * count:
            shape = f"(members, {count})" if count > 1 else "(members,)"
            raise ArgumentError(
                f"parameters[{name!r}] has shape {found.shape}; it must be {shape}, a value for each member",
                argument="parameters",
            )
        if not np.isfinite(found).all():
            bad = int(np.argmin(np.isfinite(found.reshape(len(found), -1)).all(axis=1)))
            message = f"parameters[{name!r}] of member {bad} is not finite; give finite numbers"
            raise ArgumentError(message, argument="parameters")
        numbers.append((name, count))
        values[name] = found.reshape(len(found), count) if count > 1 else found.ravel()
    return numbers, values


def _starts(self: Modelled, states: Any, model: CompiledModel) -> list[State]:
    """The given states in the coordinates of the model, or the drawing, assembled, at rest."""
    if states is None:
        return [start_of(self, None, model, "relative", None)]
    if isinstance(states, State) or not is_list(states):
        raise ArgumentError(f"states must be a list of states, not {shown(states)}", argument="states")
    starts = [start_of(self, state, model, "relative", None) for state in states]
    for i, state in enumerate(starts):
        if state.t != starts[0].t:
            raise ArgumentError(
                f"states: member {i} starts at t = {state.t:g} s, member 0 at {starts[0].t:g} s; give states of one "
                "time",
                argument="states",
            )
    return starts


def _members(starts: list[State], values: dict[str, FloatArray], given: bool) -> int:
    counts = {f"parameters[{name!r}]": len(x) for name, x in values.items()}
    if given:
        counts["states"] = len(starts)
    if not counts or 0 in counts.values():
        raise ArgumentError("an ensemble needs members: give states, parameters, or both", argument="states")
    if len(set(counts.values())) > 1:
        listed = ", ".join(f"{name} has {count}" for name, count in counts.items())
        raise ArgumentError(f"the numbers of members differ: {listed}", argument="parameters")
    return next(iter(counts.values()))


def _times(t_eval: Any, t0: float) -> FloatArray:
    given = run_options.si("t_eval", t_eval, "s")
    try:
        times = floats(given)
    except TypeError as error:
        raise ArgumentError(f"t_eval must be an array of times, not {shown(t_eval)}", argument="t_eval") from error
    end = float(times[-1]) if times.ndim == 1 and times.size else t0
    if not end > t0:
        raise ArgumentError(
            f"t_eval must be a flat array of increasing times that ends after the start at {t0:g} s", argument="t_eval"
        )
    return run_options.output_times(times, t0, end)
