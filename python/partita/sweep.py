"""Many runs of one model over a grid of parameters, in one labelled dataset: `partita.sweep`."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent import futures  # which imports processes and threads on first use
from contextlib import contextmanager
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import ArgumentError, Interrupted, MissingDependencyError
from .numeric import shown
from .progress import reporting

if TYPE_CHECKING:
    from concurrent.futures import Executor, Future

    import xarray

Point = tuple[int, ...]
TRIES = 3
"""How often a point is given to a new worker when its worker dies: once for others' deaths in its pool, once more for
bad luck; a third time it is the point."""
PULSE = 0.2
"""Seconds between checks of the clock and of Ctrl-C."""
AHEAD = 1000
"""Points submitted ahead: enough for a cluster, few to wait for where a sweep is interrupted."""


def sweep(
    model: Callable[..., Any],
    parameters: Mapping[str, Sequence[Any]],
    *,
    executor: Executor | str | None = None,
    workers: int | None = None,
    progress: Any = False,
) -> xarray.Dataset:
    """Call `model(**point)` for every point of a grid and collect the returned values in one labelled dataset.

    Args:
        model: function of the parameters, by their names, that returns a dict of numbers or arrays (with the same
            shapes at all points), or one number. For processes it must be importable (defined in a module).
        parameters: name -> values; the grid is their Cartesian product, and each is a dimension of the dataset.
        executor: None: one point after the other; "threads" (a run releases the interpreter lock most of the time);
            "processes"; or any object with `submit`, such as those of `concurrent.futures`, Dask's
            `client.get_executor()` or the `MPIPoolExecutor` of `mpi4py`.
        workers: number of workers for "threads" and "processes"; None: the number of cores.
        progress: True: a progress bar on the terminal with the rate and the remaining time (needs tqdm); or a function
            of the completed fraction, 0 to 1.

    Returns:
        An `xarray.Dataset`: one variable for each name, with the parameters as its first dimensions, followed by the
        axes of arrays (`NAME_axis0`, ...); `failed` holds the error message of each point (empty: none). The numbers of
        a failed point are NaN.

    If a worker dies, its unfinished points are given to new workers, up to three times each.

    Raises:
        MissingDependencyError: xarray is not installed. ArgumentError: parameters or executor are invalid, or every
            point failed. Interrupted: Ctrl-C was pressed; `result` of the error is the dataset so far.

    >>> import partita as pt
    >>> def period(length):
    ...     m = pt.Mechanism("pendulum")
    ...     rod = m.add_rod("rod", start=(0, 0, 0), end=(length, 0, 0), mass=1.0)
    ...     m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    ...     return {"angle": m.simulate(0.5).joint("A").position[-1, 0]}
    >>> found = pt.sweep(period, {"length": [0.5, 1.0, 2.0]})
    >>> found.angle.sel(length=1.0).item() < found.angle.sel(length=2.0).item()
    True
    """
    try:
        import xarray  # noqa: F401
    except ImportError as error:
        raise MissingDependencyError(
            "a sweep is collected into an xarray.Dataset: pip install partita[xarray]", package="xarray"
        ) from error
    if not callable(model):
        raise ArgumentError(f"model must be a function of the parameters, not {shown(model)}", argument="model")
    grid = _grid(parameters)
    work = _Work(model, grid)
    try:
        with reporting(progress, len(work.points), "points") as report, _pool(executor, workers) as make:
            work.report = report or work.report
            if make is None:
                work.in_turn()
            else:
                work.spread(make)
    except KeyboardInterrupt as stopped:
        done = len(work.found) + len(work.failed)
        words = f"interrupted after {done} of {len(work.points)} points; `result` of this error has them"
        raise Interrupted(words, work.dataset()) from stopped
    if len(work.failed) == len(work.points):
        point, reason = next(iter(work.failed.items()))
        raise ArgumentError(f"every point failed; the first, {work.named(point)}: {reason}", argument="model")
    return work.dataset()


def _grid(parameters: Any) -> dict[str, list[Any]]:
    if not isinstance(parameters, Mapping) or not parameters:
        raise ArgumentError(
            f"parameters must be a dict such as {{'length': [0.5, 1.0]}}, not {shown(parameters)}",
            argument="parameters",
        )
    grid: dict[str, list[Any]] = {}
    for name, values in parameters.items():
        if not isinstance(name, str) or not name.isidentifier() or name == "failed":
            raise ArgumentError(f"the parameter {name!r} is not a valid name of an argument", argument="parameters")
        if isinstance(values, (str, bytes)) or not hasattr(values, "__iter__") or not len(list(values)):
            raise ArgumentError(
                f"parameters[{name!r}] must be a list of values, not {shown(values)}", argument="parameters"
            )
        grid[name] = [value.item() if isinstance(value, np.generic) else value for value in values]
    return grid


Make = Callable[[], "Executor"]


@contextmanager
def _pool(executor: Any, workers: int | None) -> Iterator[Make | None]:
    """Source of an executor: an own one is created again after a worker died, a given one is reused."""
    if executor is None:
        yield None
    elif isinstance(executor, str):
        kinds: dict[str, Any] = {"threads": "ThreadPoolExecutor", "processes": "ProcessPoolExecutor"}
        if executor not in kinds:
            raise ArgumentError(
                f'executor is "{executor}"; known: threads, processes, or an object with submit', argument="executor"
            )
        made: list[Executor] = []

        def make() -> Executor:
            made.append(getattr(futures, kinds[executor])(max_workers=workers))
            return made[-1]

        try:
            yield make
        finally:
            for one in made:
                one.shutdown(wait=False, cancel_futures=True)
    elif callable(getattr(executor, "submit", None)):
        yield lambda: executor
    else:
        raise ArgumentError(f"executor must have a method submit, not {shown(executor)}", argument="executor")


@dataclass
class _Work:
    """Points, their results, and the progress function."""

    model: Callable[..., Any]
    grid: dict[str, list[Any]]
    report: Callable[[float], None] = lambda part: None
    found: dict[Point, dict[str, Any]] = field(default_factory=dict)
    failed: dict[Point, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.points: list[Point] = list(itertools.product(*(range(len(values)) for values in self.grid.values())))

    def named(self, point: Point) -> dict[str, Any]:
        """The parameters of a point."""
        return {name: values[i] for (name, values), i in zip(self.grid.items(), point, strict=True)}

    def keep(self, point: Point, answer: Any) -> None:
        """What came back."""
        try:
            answer = answer if isinstance(answer, Mapping) else {"value": answer}
            self.found[point] = {str(name): np.asarray(value) for name, value in answer.items()}
        except Exception as error:
            self.failed[point] = _words(error)
        self.report((len(self.found) + len(self.failed)) / len(self.points))

    def in_turn(self) -> None:
        """One after the other."""
        for point in self.points:
            try:
                answer = self.model(**self.named(point))
            except Exception as error:
                self.failed[point] = _words(error)
            else:
                self.keep(point, answer)

    def spread(self, make: Make) -> None:
        """Over the workers of an executor; points of a dead one are given to the next."""
        waiting, tries = list(self.points), dict.fromkeys(self.points, 0)
        while waiting:
            lost = self.handed_out(make(), waiting)
            for point in lost:
                tries[point] += 1
                if tries[point] >= TRIES:
                    self.failed[point] = f"its worker died {TRIES} times"
            waiting = [point for point in lost if point not in self.failed]
            if len(waiting) > 1 and len(waiting) == len(lost) and max(tries.values()) == TRIES - 1:
                self.one_by_one(make, waiting)
                return

    def handed_out(self, pool: Executor, points: list[Point]) -> list[Point]:
        """All to one executor, a few ahead of those that have returned; returns the lost ones."""
        lost: list[Point] = []
        done: SimpleQueue[tuple[Point, Future[Any]]] = SimpleQueue()
        left, under_way, pool_died = iter(points), 0, False

        def take(point: Point, future: Future[Any]) -> None:
            error = future.exception()
            if error is None:
                self.keep(point, future.result())
            elif isinstance(error, futures.BrokenExecutor) or _is_death(error):
                lost.append(point)
            elif isinstance(error, Exception):
                self.failed[point] = _words(error)
            else:
                raise error

        try:
            while True:
                for point in itertools.islice(left, 0 if pool_died else AHEAD - under_way):
                    try:
                        future = pool.submit(self.model, **self.named(point))
                    except futures.BrokenExecutor:
                        lost.append(point)
                        pool_died = True
                        break
                    under_way += 1
                    future.add_done_callback(lambda future, point=point: done.put((point, future)))  # type: ignore[misc]
                if not under_way:
                    return lost + list(left)
                try:
                    point, future = done.get(timeout=PULSE)
                except Empty:  # a chance for Ctrl-C
                    continue
                under_way -= 1
                take(point, future)
        except KeyboardInterrupt:
            while not done.empty():
                point, future = done.get()
                if not future.cancelled() and future.exception() is None:
                    self.keep(point, future.result())
            raise

    def one_by_one(self, make: Make, points: list[Point]) -> None:
        """Each point in a separate pool, so that a point that kills its worker affects no other."""
        for point in points:
            try:
                self.keep(point, make().submit(self.model, **self.named(point)).result())
            except futures.BrokenExecutor:
                self.failed[point] = f"its worker died {TRIES} times"
            except Exception as error:
                died = _is_death(error)
                self.failed[point] = f"its worker died {TRIES} times" if died else _words(error)

    def dataset(self) -> xarray.Dataset:
        """The whole grid; NaN where nothing is known."""
        import xarray

        sizes = tuple(len(values) for values in self.grid.values())
        shapes: dict[str, tuple[int, ...]] = {}
        kinds: dict[str, np.dtype[Any]] = {}
        for point, answer in list(self.found.items()):
            for name, value in answer.items():
                if shapes.setdefault(name, value.shape) != value.shape:
                    here, there = value.shape, shapes[name]
                    why = f"{name} has the shape {here}, elsewhere {there}; it must be the same throughout"
                    self.failed[point] = why
                    self.found.pop(point, None)
                kinds[name] = np.result_type(kinds.get(name, value.dtype), value.dtype)
        dims = tuple(self.grid)
        variables: dict[str, Any] = {}
        whole = len(self.found) == len(self.points)
        for name, shape in shapes.items():
            kind = kinds[name] if whole or kinds[name].kind not in "biu" else np.dtype(float)
            blank: Any = np.nan if kind.kind in "fc" else (None if kind.kind == "O" else np.zeros((), kind)[()])
            values = np.full(sizes + shape, blank, dtype=kind)
            for point, answer in self.found.items():
                if name in answer:
                    values[point] = answer[name]
            variables[name] = (dims + tuple(f"{name}_axis{i}" for i in range(len(shape))), values)
        messages = np.full(sizes, "", dtype=object)
        for point, words in self.failed.items():
            messages[point] = words
        variables["failed"] = (dims, messages.astype(str))
        return xarray.Dataset(variables, coords={name: list(values) for name, values in self.grid.items()})


def _is_death(error: BaseException) -> bool:
    """Dask reports a dead worker by an error of its own, which need not be installed here."""
    return type(error).__name__ in ("KilledWorker", "CommClosedError", "MPIError")


def _words(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}"
