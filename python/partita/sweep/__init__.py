"""Many runs of one model over a grid of parameters or over samples, in one labelled dataset: `partita.sweep`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

from ..errors import ArgumentError, Interrupted
from ..extras import extra
from ..numeric import shown
from ..progress import reporting
from .batches import Pool, Spread, pool_of
from .collected import NOT_COMPUTED, Answer, answer_of, dataset
from .interrupts import noticed
from .members import Members, check_signature, members_of
from .samplers import samples
from .store import Store, load_sweep, opened, storable

if TYPE_CHECKING:
    from concurrent.futures import Executor

    import xarray

__all__ = ["load_sweep", "samples", "sweep"]


def sweep(
    model: Callable[..., Any],
    parameters: Mapping[str, Any] | Sequence[Mapping[str, Any]],
    *,
    executor: Executor | str | None = None,
    workers: int | None = None,
    batch: int | str = "auto",
    store: Any = None,
    progress: Any = False,
) -> xarray.Dataset:
    """Call `model(**parameters)` for every member of a grid or of a list of samples, and collect the returned values in
    one labelled dataset.

    Args:
        model: function of the parameters, by their names, that returns a dict of numbers or arrays (with the same
            shapes for all members), or one number. For processes it must be importable (defined in a module).
        parameters: a dict name -> values: the members are their Cartesian product, and each parameter is a dimension of
            the dataset. Or a list of samples, one dict of parameters for each member, such as `partita.samples` draws:
            the dataset has the dimension `sample`.
        executor: None: one member after the other; "threads" (a run releases the interpreter lock most of the time);
            "processes"; or any object with `submit`, such as those of `concurrent.futures`, Dask's
            `client.get_executor()` or the `MPIPoolExecutor` of `mpi4py`.
        workers: number of workers for "threads" and "processes"; None: the number of cores. Of another executor, the
            number that it has, where it does not tell.
        batch: number of members that are given to a worker at once; "auto": by their measured time, about half a
            second of work, so that handing them out costs little.
        store: name of a folder in which results are kept as they come; None: in memory alone. If it exists, the sweep
            continues: what it has is not computed again. `partita.load_sweep` reads it at any time. If the name ends in
            .zarr, the dataset is put there as Zarr as well when the sweep ends.
        progress: True: a progress bar on the terminal with the rate and the remaining time (needs tqdm); or a function
            of the completed fraction, 0 to 1.

    Returns:
        An `xarray.Dataset`: one variable for each name, with the parameters (or `sample`) as its first dimensions,
        followed by the axes of arrays (`NAME_axis0`, ...); `failed` holds the error message of each member (empty:
        none; "not computed" in a sweep that was interrupted). The numbers of a failed member are NaN. The dataset
        depends on the model and the parameters alone: not on the executor, the batches, or whether the sweep was
        continued.

    If a worker dies, its unfinished members are given to new workers, up to three times each.

    Raises:
        MissingDependencyError: xarray is not installed. ArgumentError: parameters or executor are invalid, every member
            failed, or the store belongs to another sweep. FileFormatError: the store cannot be written, is damaged, or
            another process writes to it. Interrupted: Ctrl-C was pressed; `result` of the error is the dataset so far.

    >>> import partita as pt
    >>> def period(length):
    ...     m = pt.Mechanism("pendulum")
    ...     rod = m.add_rod("rod", start=(0, 0, 0), end=(length, 0, 0), mass=1.0)
    ...     m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    ...     return {"angle": m.simulate(0.5).joint("A").angle[-1]}
    >>> found = pt.sweep(period, {"length": [0.5, 1.0, 2.0]})
    >>> found.angle.sel(length=1.0).item() < found.angle.sel(length=2.0).item()
    True
    """
    extra("xarray", "xarray", "a sweep")
    if not callable(model):
        raise ArgumentError(f"model must be a function of the parameters, not {shown(model)}", argument="model")
    members = members_of(parameters)
    check_signature(model, members)
    work, size = _Work(model, members), _size(batch)
    with (
        reporting(progress, members.count, "members") as report,
        noticed() as check,
        pool_of(executor, workers, model) as pool,
        nullcontext() if store is None else opened(store, model, members) as kept,
    ):
        work.begin(kept, report)
        try:
            work.compute(pool, size, check)
        except KeyboardInterrupt as stopped:
            raise work.interrupted() from stopped
        return work.judged()


def _size(batch: Any) -> int | None:
    if isinstance(batch, str) and batch == "auto":
        return None
    if isinstance(batch, bool) or not isinstance(batch, int) or batch < 1:
        raise ArgumentError(f'batch must be a positive integer or "auto", not {shown(batch)}', argument="batch")
    return batch


class _Work:
    """Members and their answers."""

    def __init__(self, model: Callable[..., Any], members: Members) -> None:
        self.model, self.members = model, members
        self.answers: dict[int, Answer] = {}
        self.store: Store | None = None
        self.report: Callable[[float], None] | None = None
        self.elsewhere = NOT_COMPUTED

    def begin(self, store: Store | None, report: Callable[[float], None] | None) -> None:
        """With what is known already."""
        self.store, self.report = store, report
        if store is not None and store.answers:
            self.answers = dict(store.answers)
            self._report_part()

    def keep(self, new: Mapping[int, Answer]) -> None:
        """What came back."""
        if self.store is not None:
            stored = {member: storable(answer) for member, answer in new.items()}
            self.store.put(stored)
            new = stored
        self.answers |= new
        self._report_part()

    def _report_part(self) -> None:
        if self.report is not None:
            self.report(len(self.answers) / self.members.count)

    def compute(self, pool: Pool | None, batch: int | None, check: Callable[[], None]) -> None:
        """All that is not known yet; `check` raises where Ctrl-C was pressed."""
        left = [member for member in range(self.members.count) if member not in self.answers]
        if pool is None:
            for member in left:
                self.keep({member: answer_of(self.model, self.members.arguments(member))})
                check()
        elif left:
            lost = Spread(self.model, left, self.members.arguments, self.keep, batch, check).over(pool)
            if lost is not None:
                self.elsewhere = f"{NOT_COMPUTED}: the executor accepts no more work ({lost})"

    def dataset(self) -> xarray.Dataset:
        """All members, as they stand when the sweep ends."""
        found = dataset(self.members, self.answers, self.elsewhere)
        if self.store is not None:
            self.store.publish(found)
        return found

    def interrupted(self) -> Interrupted:
        """The error that has what was computed."""
        words = (
            f"interrupted after {len(self.answers)} of {self.members.count} members; `result` of this error has them"
        )
        if self.store is not None:
            words += f", and the store {str(self.store.path)!r}: the same sweep continues there"
        return Interrupted(words, self.dataset())

    def judged(self) -> xarray.Dataset:
        """The dataset, unless there is nothing in it."""
        found = self.dataset()
        reasons = found.failed.values.ravel()
        if all(reasons):
            raise ArgumentError(
                f"every member failed; the first, {self.members.arguments(0)}: {reasons[0]}", argument="model"
            )
        return found
