"""A first guess of a free periodic motion: when a run comes near to where it was."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..builder.compiled import CompiledModel
from ..errors import ArgumentError
from ..results import Result
from ..state import State
from ..tolerance import NEGLIGIBLE, SUM_ROUNDING
from .monodromy import Chart, Setting, angles_of, chart, ran

Array = NDArray[np.float64]
TAU = 2.0 * np.pi

LEFT = 0.3
"""A motion that is farther away than this has left the place to which it may return. Scale: fraction of its extent.
Reason: a return is not the start itself."""
COMES_NEAR = 0.2
"""A motion that comes nearer than this may be periodic. Scale: fraction of its extent. Reason: Newton's method does the
rest."""
ABOUT_AS_NEAR = 3.0
"""A return is about as near as the nearest if it is at most this far. Scale: distance of the nearest. Reason: the
first of several is the period, the others are its multiples."""
BETWEEN_OUTPUTS = 1e-2
"""Returns that differ by less are equally near. Scale: fraction of the extent of the motion. Reason: the arc between
two outputs."""
RESTS = 1e-6
"""A run whose last part moves less than this comes to rest. Scale: fraction of its first part. Reason: a motion that
dies out, and not one that is small beside its beginning."""
SEEKING = 1e-9
"""Relative tolerance of runs in which a guess is sought. Scale: fraction of what is integrated. Reason: a guess needs
four digits."""
CYCLES, OUTPUTS, LONGER, TRIES = 24.0, 4000, 4.0, 4
"""Length of the first run in natural periods, outputs of it, how much longer the next one is, and how many there
are."""


def guessed(setting: Setting, start: State, time: float | None) -> tuple[State, float, bool]:
    """A state near a free periodic motion, its period, and whether energy is kept: the motion through the start itself
    then, else the one in which a run ends. `time`: about the period, if it is known."""
    model = setting.model_at(0.0)
    variables = chart(model, start)
    length = CYCLES * (_natural(model, start) if time is None else time)
    for _ in range(TRIES):
        run = ran(setting._replace(t_eval=OUTPUTS - 2), start, 0.0, length, SEEKING)
        if not np.any(np.abs(run.v) > SUM_ROUNDING):
            raise ArgumentError(
                "it begins at rest in an equilibrium and stays there; begin with a motion, by "
                "initial=m.assemble(rates=...) or initial=m.assemble(targets=...)",
                argument="initial",
            )
        kept = conserves(run)
        rows = _rows(model, variables, run, 0 if kept else len(run.t) - 1)
        if not kept and _rests(run):
            raise ArgumentError(
                f"the motion from there dies out: after {length:.4g} s it is at rest, so it leads to no periodic one; "
                "begin with a larger motion by initial=m.assemble(rates=...), or add what keeps it going",
                argument="initial",
            )
        found = _first_return(rows if kept else rows[::-1], time, run.t[1] - run.t[0])
        if found is not None:
            at = start if kept else State(start.t, run.q[-1], run.v[-1], layout=start._layout)
            return at, found * float(run.t[1] - run.t[0]), kept
        length *= LONGER
    raise ArgumentError(
        f"the motion did not come near to where it was within {length / LONGER:.4g} s, so there is no guess of a "
        "period; give about its period by guess=, or begin nearer to it by initial=",
        argument="initial",
    )


def conserves(run: Result) -> bool:
    """Whether nothing dissipates or drives along a run."""
    energy = run.energy
    return bool(np.abs(energy.work).max(initial=0.0) <= NEGLIGIBLE * energy.scale and not len(run.events))


def _natural(model: CompiledModel, start: State) -> float:
    """A natural period: of the fastest motion about the start."""
    found = model.core.linearized(start.t, start.q, start.v, np.zeros((0, model.core.nv)), None, [], False)
    fastest = float(np.abs(np.linalg.eigvals(found["A"])).max(initial=0.0))
    if fastest == 0.0:
        raise ArgumentError(
            "no natural time of the motion is known, because nothing pushes it back; give about its period by guess=",
            argument="guess",
        )
    return 2.0 * np.pi / fastest


def _rows(model: CompiledModel, variables: Chart, run: Result, to: int) -> Array:
    """Difference of each output from one of them, in fractions of the extent of the motion."""
    core, count = model.core, len(variables.positions)
    angles = angles_of(run.summary)
    positions = run.q.copy()
    positions[:, angles] -= TAU * np.round((positions[:, angles] - positions[to, angles]) / TAU)
    moved = np.array([core.displacement_between(positions[to], q) for q in positions])[:, variables.positions]
    rates = run.v[:, variables.velocities] - run.v[to, variables.velocities]
    rows = np.hstack([moved, rates])
    settled = rows if to == 0 else rows[len(rows) // 2 :]
    extents = np.ptp(settled, axis=0)
    # what hardly moves beside the others says nothing
    for part in (slice(0, count), slice(count, None)):
        extents[part] = np.maximum(extents[part], RESTS * extents[part].max(initial=0.0))
    scaled: Array = rows / np.where(extents > 0.0, extents, np.inf)
    return scaled


def _rests(run: Result) -> bool:
    speeds = np.abs(run.v).max(axis=1)
    tenth = max(1, len(speeds) // 10)
    return bool(speeds[-tenth:].max() <= RESTS * speeds.max())


def _first_return(rows: Array, time: float | None, step: float) -> float | None:
    """The number of outputs after which it is near again, between two of them; with a known time the nearest to it."""
    starts, along = rows[:-1], np.diff(rows, axis=0)
    lengths = np.sum(along * along, axis=1)
    part = np.clip(-np.sum(starts * along, axis=1) / np.where(lengths > 0.0, lengths, 1.0), 0.0, 1.0)
    away = np.linalg.norm(starts + part[:, None] * along, axis=1)
    left = np.flatnonzero(away > LEFT)
    if not len(left):
        return None
    inner = np.arange(int(left[0]) + 1, len(away) - 1)
    lows = inner[(away[inner] <= away[inner - 1]) & (away[inner] < away[inner + 1]) & (away[inner] <= COMES_NEAR)]
    if not len(lows):
        return None
    if time is not None:
        chosen = lows[np.argmin(np.abs(lows * step - time))]
    else:
        # a nearly periodic motion passes near several times: the first that is about as near as any
        enough = ABOUT_AS_NEAR * float(away[lows].min()) + BETWEEN_OUTPUTS
        chosen = lows[np.flatnonzero(away[lows] <= enough)[0]]
    return float(chosen + part[chosen])
