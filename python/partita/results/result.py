"""The result of a run: its interface to figures, files, pages and further runs."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from .. import options as run_options
from ..errors import ArgumentError
from ..notebook import names, table
from ..numeric import floats, is_list, shown
from ..state import Layout, State, finite_time
from ..webpage import Page, opened
from .events import Events, events_of
from .names import missing_attribute
from .partition_log import switches_of
from .run import FloatArray, Run
from .sensitivities import Sensitivities
from .source import ModelSource

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


ELSEWHERE = {
    "acceleration": "use run.joint(name).acceleration or run.body(name).acceleration",
    "angle": "use run.joint(name).angle",
    "animate": "use run.show(), run.to_html(path) or run.save_animation(path)",
    "bodies": "use run.body(name), or run.names.bodies",
    "crossings": "use run.events, with simulate(events=[...])",
    "effort": "use run.drive(name).effort, run.coupling(name).effort or run.force(name).effort",
    "event": 'use run.events[0], or run.events["name"]',
    "export": "use run.save(path): .csv, .nc, .mat, .json, .parquet or .zarr",
    "final_state": "use run.state()",
    "forces": "use run.force(name), or run.joint(name).force for reactions",
    "joints": "use run.joint(name), or run.names.joints",
    "position": "use run.joint(name).position or run.body(name).position",
    "reaction": "use run.joint(name).force and .moment",
    "t_events": 'use run.events.t, or run.events["name"].t',
    "tension": "use run.force(name).force, or run.coupling(name).tension of a distance",
    "time": "use run.t",
    "times": "use run.t",
    "to_csv": 'use run.save("run.csv")',
    "torque": "use run.drive(name).effort, or run.force(name).effort",
    "velocity": "use run.joint(name).velocity or run.body(name).velocity",
    "y_events": "use run.events[0].before: a state",
}
"""What a result does not have, by the names under which people look for it -> what to use."""


class Result(Run):
    """Motion and forces of one run, over nt outputs; SI units and radians, names in `names`.

    A run stores times, coordinates and velocities. Accelerations, multipliers and closure errors are computed together
    at the first access to one of them, and so are measures and qualities; bodies, joints and reactions are computed one
    by one; all are cached. A run that stopped early (`success` False, or Ctrl-C) has every output that it reached;
    `status` and `message` say why it ended. A pickled result contains everything that can be read from it, like a
    stored one, and needs no model where it is loaded.

    >>> result.joint("A").force[-1], result.energy.total[0]        # doctest: +SKIP
    """

    if not TYPE_CHECKING:  # a type checker knows what there is

        def __getattr__(self, name: str) -> Any:
            if name.startswith("_"):
                raise AttributeError(name)
            raise missing_attribute("a result", type(self), name, ELSEWHERE, "dir(run) lists what it has")

    @cached_property
    def events(self) -> Events:
        """Events that happened, in the order of time: `run.events[0].t`, `run.events["top"]`. See `pt.Event`."""
        return events_of(self._record.events, self._layout)

    @overload
    def state(self, t: float | None = None) -> State: ...
    @overload
    def state(self, t: Sequence[float] | FloatArray) -> list[State]: ...

    def state(self, t: float | Sequence[float] | FloatArray | None = None) -> State | list[State]:
        """The state at time `t` [s] of the run, from which another one can start (`initial=`); None: the last output.

        At the time of an output it is that output. Elsewhere it is read from the steps that the run keeps in memory, as
        an output at that time would be: their dense output, closed to round-off. It costs about as much as one or two
        evaluations. Of an array of times the states are a list, in its order.

        The memory for steps is bounded (`partita.limits`, "step_bytes"); `counters["kept_steps"]` and
        `counters["kept_step_bytes"]` say what they take. A longer run keeps every second step, or every fourth, which a
        note reports: a state between those is integrated from the last one known before it, with the method and the
        tolerances of the run. So it is in the first step out of a singular position, for results of steppers, which
        keep no steps, and for formulations whose evaluations solve for coordinates ("wehage-haug", "explicit-closing",
        "tangent-space"). A member of an ensemble keeps none either: ask its own run, `ensemble.result(i).state(t)`.

        Raises `ArgumentError` for a time outside the run and, between outputs, for a stored or pickled result and for a
        run with user-defined tangent velocities.

        >>> import numpy as np
        >>> import partita as pt
        >>> m = pt.catalogue.load("four-bar")
        >>> run = m.simulate(1.0, t_eval=[0.0, 1.0])
        >>> again = m.simulate(0.7, initial=run.state(0.3), t_eval=[1.0])
        >>> bool(abs(again.q[-1] - run.q[-1]).max() < 1e-6)
        True
        >>> [round(state.t, 1) for state in run.state(np.linspace(0.1, 0.3, 3))]
        [0.1, 0.2, 0.3]
        """
        if isinstance(t, float):  # asked many times over
            time = float(t)
        elif t is None:
            if not len(self.t):
                raise ArgumentError("the run has no outputs, so there is no state", argument="t")
            return State.computed(float(self.t[-1]), self.q[-1].copy(), self.v[-1].copy(), self._layout)
        elif is_list(t):
            times = _times(t)
            for outside in times[(times < self._known[0]) | (times > self._known[1])].tolist():
                raise self._not_inside(outside)
            return self._read(times)
        else:
            time = finite_time(t)
        begins, ends = self._known
        if not begins <= time <= ends:
            raise self._not_inside(finite_time(time))
        i = int(self.t.searchsorted(time, side="right")) - 1
        if i >= 0 and self.t[i] == time:
            return State.computed(time, self.q[i].copy(), self.v[i].copy(), self._layout)
        log = self._record.arrays.log
        read = None if log is None else log.state(time)
        if read is not None and read[0] == time:
            return State.computed(*read, self._layout)
        if i >= 0 and (read is None or read[0] < self.t[i]):
            read = float(self.t[i]), self.q[i], self.v[i]
        return self._from(read, time)

    def sensitivities(self, by: Any, *, held: Any = None) -> Sensitivities:
        """Derivatives of the run along its outputs by numbers of the mechanism and of its start.

        Every step of the run is taken again with numbers that carry derivatives, by the coefficients and for the
        coordinates by which it was taken: through exchanges of coordinates, events, impacts and locks. They are the
        derivatives of the numbers that the run computed, where the lengths of its steps are constants, and as exact as the
        run. Prefer `Mechanism.gradient` for one objective of many numbers.

        Args:
            by: numbers, one or several: a parameter of `Mechanism.compile().parameters`, such as "crank.mass", "crank.com"
                (3 derivatives) or "A.point" (moves on both bodies); the length of a body with two joints,
                "coupler.length" (the joint that is not on the ground, or the later one, moves on this body, whose centre
                of mass stays); `pt.start("A")` and `pt.start_rate("A")`, position and rate of a joint at the start;
                `pt.end_time`.
            held: joints, as many coordinates as degrees of freedom, whose positions and rates at the start stay when other
                numbers change; None: those that the start was assembled with, or the coordinates in use there.

        Raises:
            ArgumentError: the run keeps no steps, or what is held does not determine the start, or an event only touches
                zero, or two happen at once, so that there is no derivative: the message names it.
            UnknownNameError: there is no such number.

        Cost: for each eight numbers about that of the run, times six. Source: the discrete tangent of the steps; at events
        the jump of Aizerman and Gantmakher (saltation).

        >>> import partita as pt
        >>> m = pt.catalogue.load("four-bar")
        >>> run = m.simulate(0.5, initial=m.assemble({"A": 0.0}, {"A": 2.0}), t_eval=[0.0, 0.5])
        >>> s = run.sensitivities(["crank.mass", pt.start("A")])
        >>> s.position("A", by=pt.start("A")).shape, float(s.position("A", by=pt.start("A"))[0])
        ((2,), 1.0)
        """
        return Sensitivities(self, by, held)

    def _read(self, times: FloatArray) -> list[State]:
        """The states at times inside the run."""
        log = self._record.arrays.log
        t, q, v = np.full(len(times), np.nan), *(np.full((len(times), x.shape[1]), np.nan) for x in (self.q, self.v))
        if log is not None:
            t, q, v = log.states(times)
        before = self.t.searchsorted(times, side="right") - 1
        output = self.t[before] if len(self.t) else t
        # what was asked is an output, or none read is as near
        take = (before >= 0) & ((output == times) | ~(t >= output))
        t[take], q[take], v[take] = output[take], self.q[before[take]], self.v[before[take]]
        known = zip(t.tolist(), q, v, strict=True)
        return [self._from(state, time) for state, time in zip(known, times.tolist(), strict=True)]

    @cached_property
    def _known(self) -> tuple[float, float]:
        """From when to when states are known."""
        log = self._record.arrays.log
        known = [*self.t[:1].tolist(), *self.t[-1:].tolist(), *((None if log is None else log.span()) or ())]
        return min(known, default=np.inf), max(known, default=-np.inf)

    def _not_inside(self, t: float) -> ArgumentError:
        begins, ends = self._known
        where = (
            f"is outside the run, from {begins:g} to {ends:g} s" if begins <= ends else "is not known: it ended at once"
        )
        return ArgumentError(f"t = {t:g} s {where}", argument="t")

    def _from(self, known: tuple[float, FloatArray, FloatArray] | None, t: float) -> State:
        """The state at t, from the last one known until then."""
        if known is None or known[0] != t:
            known = t, *self._integrated(known, t)
        return State.computed(*known, self._layout)

    @cached_property
    def _layout(self) -> Layout:
        """The layout of its states."""
        if self._source is None:
            layout = Layout()
            layout.names, layout.velocity_names = list(self.names.coordinates), list(self.names.velocities)
            return layout
        layout = Layout(self.summary)
        if isinstance(self._source, ModelSource):
            layout = layout.reading(self._source.model, self.summary)
        return layout

    def _integrated(
        self, known: tuple[float, FloatArray, FloatArray] | None, t: float
    ) -> tuple[FloatArray, FloatArray]:
        """Coordinates and velocities at t, from the last state known before it."""
        model = self._source.model if isinstance(self._source, ModelSource) else None
        chosen = {key: value for key, value in self.options.items() if key != "coordinates"}
        if known is None or model is None or chosen.get("formulation") == "user-tangent" or not np.isfinite(known[0]):
            raise ArgumentError(
                f"t = {t:g} s lies between outputs, and the data needed to integrate up to it are not available; give "
                "the time of an output, or simulate with t there in t_eval",
                argument="t",
            )
        since, q, v = known
        chosen = run_options.Options(chosen, t0=since, t_end=t)
        raw = run_options.run(model, chosen, np.array([t]), q, v, False)
        q, v = raw["arrays"]["q"], raw["arrays"]["v"]
        if not raw["success"] or not len(q):
            raise raw["error"] or ArgumentError(
                f"the motion cannot be integrated to t = {t:g} s: {raw['message']}", argument="t"
            )
        return q[-1], v[-1]

    def to_xarray(self) -> xarray.Dataset:
        """All arrays as an `xarray.Dataset`: dimensions `time`, `joint`, `body`, `axis`, `coordinate`, ... with the
        names as coordinates, `units` and `long_name` of every array, and `model` (JSON) and `account` as text;
        attributes hold the settings and the certificate. Events that happened are `event_t`, `event_name` and
        `event_direction` along the dimension `event`. `save("x.nc")` stores this dataset. `MissingDependencyError`
        without xarray.

        >>> import partita as pt
        >>> found = pt.catalogue.load("four-bar").simulate(0.5).to_xarray()
        >>> found.force.sel(joint="A", axis="x").dims
        ('t',)
        """
        from .dataset import to_xarray

        return to_xarray(self)

    def to_pandas(self, units: Mapping[str, str] | None = None) -> pandas.DataFrame:
        """One row per output, one column per number, indexed by time; `df.attrs["units"]` has the units.

        Columns are those of `save("x.csv")`: the most used first, then rotation matrices, flags and the rest. `units`
        replaces units: `{"rad": "deg", "m": "mm"}`. `MissingDependencyError` without pandas, `ArgumentError` for a
        unit that no column has, and for one of another kind.

        >>> import partita as pt
        >>> run = pt.catalogue.load("four-bar").simulate(0.5)
        >>> frame = run.to_pandas(units={"rad": "deg"})
        >>> frame.attrs["units"]["joint.A.position"], frame.attrs["units"]["joint.A.velocity"]
        ('deg', 'rad/s')
        """
        from .table import to_pandas

        return to_pandas(self, units)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write to `path` in the format of its ending, and return the path; `partita.load_result` reads all formats.

        `.nc`: NetCDF 4, the dataset of `to_xarray`, for xarray, MATLAB and the tools of the geosciences (extra
        `netcdf`). `.zarr`: the same as a folder of chunks (extra `zarr`). `.json`: one readable text. `.mat`: for
        MATLAB and Octave. `.csv`, `.parquet` (extra `parquet`): a table, one row per output, for spreadsheets.

        Every format holds everything: arrays, names, units, model, settings, certificate, version, and a checksum that
        reveals later changes or damage. An existing file is replaced only when the new one is complete.

        Raises `FileFormatError` for another ending and if the file cannot be written, `MissingFileError` if the folder
        does not exist, `MissingDependencyError` with the name of the extra if a package is not installed. Costs the
        reactions and the certificate at all outputs, unless they have been computed before.

        >>> import os, tempfile
        >>> import partita as pt
        >>> run = pt.catalogue.load("four-bar").simulate(0.5)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = run.save(os.path.join(folder, "run.json"))
        ...     pt.load_result(path).title == run.title
        True
        """
        from .save import save

        return save(self, path)

    def plot(
        self,
        *what: str,
        path: str | os.PathLike[str] | None = None,
        x: str | None = None,
        ax: Axes | None = None,
        points: Mapping[str, Any] | None = None,
    ) -> Figure:
        """Plot `what` in a Matplotlib figure; several words give panels one below the other. `path` saves it too.

        "overview" (the default), "coordinates", "velocities", "accelerations", "reactions", "bearings" (polar: size and
        direction), "paths" (of `points`, {name: (body, point in body axes)}, or of the joints), "energy", "measure",
        "closure", or the name of a joint or of a sensor. `x` names a coordinate, joint or sensor as abscissa instead of
        time, for instance a crank angle. Angles are in degrees, reduced to one turn. `ax`: existing Matplotlib axes to
        draw a single panel into. Over time events are thin lines with their names, where there are few.

        Nothing is shown on the screen; in a notebook the figure displays itself. Raises `UnknownNameError` with the
        most similar names, and `ArgumentError` if a word cannot be combined with `x` or `ax`.

        >>> import partita as pt
        >>> run = pt.catalogue.load("four-bar").simulate(0.5)
        >>> figure = run.plot("reactions", x="A")
        >>> figure.axes[-1].get_xlabel()
        'A [deg]'
        """
        from ..plots import plot

        return plot(self, *what, path=path, x=x, ax=ax, points=points)

    def to_html(
        self,
        path: str | os.PathLike[str],
        title: str | None = None,
        *,
        shapes: Mapping[str, Any] | None = None,
        points: Mapping[str, Any] | None = None,
    ) -> Path:
        """Write one self-contained page with the animated mechanism; it opens from disk without a network.

        `shapes` draws bodies as boxes, cylinders, wheels, balls, plates, rods; None: as the file of a robot says, where
        it was read from one, {}: without. `points` marks points and traces their paths. Both are described at
        `partita.viewer.html`. Events are marked over the slider of time and listed. The
        page is light or dark, as its reader prefers.

        >>> import os, tempfile
        >>> import partita as pt
        >>> run = pt.catalogue.load("four-bar").simulate(0.5)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     page = run.to_html(
        ...         os.path.join(folder, "page.html"),
        ...         shapes={"crank": {"kind": "wheel", "radius": 0.3, "length": 0.1}},
        ...         points={"P": ("coupler", (0.5, 0.2, 0.0))},
        ...     )
        ...     page.name
        'page.html'
        """
        from ..viewer import write_html
        from ..viewer.hints import looking

        looking(shapes, self._looks, lambda x: write_html(self, path, title=title, shapes=x, points=points))
        return Path(path)

    def show(
        self,
        title: str | None = None,
        *,
        shapes: Mapping[str, Any] | None = None,
        points: Mapping[str, Any] | None = None,
    ) -> Page:
        """Show the animated mechanism: in the browser, or in a notebook below the cell.

        The page is that of `to_html`, in a temporary file, the `path` of what is returned.

        >>> import partita as pt
        >>> run = pt.catalogue.load("four-bar").simulate(0.5)
        >>> page = run.show()                                       # doctest: +SKIP
        """
        from ..viewer import html
        from ..viewer.hints import looking

        return opened(looking(shapes, self._looks, lambda x: html(self, title, shapes=x, points=points)))

    def save_animation(
        self,
        path: str | os.PathLike[str],
        *,
        fps: float = 20.0,
        speed: float | None = None,
        size: tuple[int, int] = (800, 600),
        forces: bool = True,
        shapes: Mapping[str, Any] | None = None,
        points: Mapping[str, Any] | None = None,
    ) -> Path:
        """Make a film of the motion for slides and papers: a .gif, or an .mp4 if the program ffmpeg is installed.

        The view is that of the page of `to_html`, which is preferable where readers can interact with it. Each frame
        shows the computed output nearest in time, with the forces of the joints.

        Args:
            fps: frames per second.
            speed: simulated seconds per second of film; None: 1 if the film then takes 2 to 20 s, otherwise such that
                it takes ten seconds.
            size: width and height in pixels.
            forces: draw arrows of reactions and loads.
            shapes, points: as in `to_html`.

        Needs the extra "plots". Raises `ArgumentError` for more than 900 frames and for another ending,
        `MissingDependencyError` without ffmpeg, `MissingFileError` if the folder does not exist.

        >>> import os, tempfile
        >>> import partita as pt
        >>> run = pt.catalogue.load("four-bar").simulate(0.2)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     run.save_animation(os.path.join(folder, "bar.gif"), fps=10, speed=0.2, size=(320, 240)).name
        'bar.gif'
        """
        from ..viewer.film import save_film
        from ..viewer.hints import looking

        def film(seen: Mapping[str, Any] | None) -> Path:
            return save_film(self, path, fps=fps, speed=speed, size=size, forces=forces, shapes=seen, points=points)

        return looking(shapes, self._looks, film)

    def __repr__(self) -> str:
        ended = self.status if self.success else f"{self.status.upper()}: {self.message}"
        return (
            f"<Result of {self.title!r}: {ended}; {len(self.t)} outputs, {self._span}; "
            f"closure {self._closed}, {self._switches} switches, "
            f"{self.counters.get('steps', 0)} steps>"
        )

    def _repr_html_(self) -> str:
        """A small table, in a notebook."""
        rows = [
            ("ended", self.status if self.success else f"{self.status}: {self.message}"),
            ("outputs", f"{len(self.t)}, {self._span}"),
            ("largest closure error", self._closed),
            ("steps", f"{self.counters.get('steps', 0)}, {self._switches} switches of coordinates"),
            ("coordinates", names(self.names.coordinates)),
        ]
        if self.events.names:
            rows.append(("events", names([record.name for record in self.events])))
        if self.is_mechanism:
            rows += [("joints", names(self.names.joints)), ("bodies", names(self.names.bodies))]
        if "certificate" in self.__dict__:
            rows.append(("certificate", self.certificate.verdict))
        return table(self.title, rows)

    @property
    def _span(self) -> str:
        return f"t = {self.t[0]:g} .. {self.t[-1]:g} s" if len(self.t) else "no outputs"

    @property
    def _closed(self) -> str:
        try:
            return f"{np.max(self.closure, initial=0.0):.1e}"
        except Exception:  # of a user's function, which also ended the run
            return "not known"

    @property
    def _switches(self) -> int:
        return switches_of(self)


def _times(values: Any) -> FloatArray:
    """Finite times."""
    try:
        times = floats(values)
    except TypeError as error:
        raise ArgumentError(f"t must be a number or an array of times, not {shown(values)}", argument="t") from error
    if times.ndim != 1 or not np.isfinite(times).all():
        raise ArgumentError("t must be a number or a flat array of finite times", argument="t")
    return times
