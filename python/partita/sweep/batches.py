"""Members over the workers of an executor: in batches sized by their measured time, and again where a worker died."""

from __future__ import annotations

import itertools
import os
import pickle
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent import futures  # which imports processes and threads on first use
from contextlib import contextmanager
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any

from ..errors import ArgumentError
from ..numeric import shown
from .collected import Answer, Plain, call, packed, reason

if TYPE_CHECKING:
    from concurrent.futures import Executor, Future

TRIES = 3
"""How often a member is given to a new worker when its worker dies: once for others' deaths in its pool, once more for
bad luck; a third time, alone in a pool, it is the member."""
PULSE = 0.2
"""Seconds between checks of the clock and of Ctrl-C."""
BATCH = 0.5
"""Seconds of work in a batch: Dask's scheduler and client need some 4 ms for a task, a hundredth of it."""
SHORTEST_BATCH = 0.1
"""The last batches are not shorter. Scale: s of work. Reason: a scheduler and its client need some 4 ms for a task;
all workers are to end together."""
CLOCK_TICK = 1e-9
"""A member takes this long at least. Scale: s. Reason: the finest clocks."""
SHARE = 20.0
"""Where a batch costs this process more than a fraction 1/SHARE of its work, batches become longer, ..."""
LONGEST_BATCH = 2.0
"""Batches are not longer. Scale: s of work. Reason: what a crash may cost of each worker, and what Ctrl-C waits
for."""
PATIENCE = 2.0
"""A worker sends back what it has, and the rest, when a batch takes this many times as long as it should."""
GROWTH = 8
"""A batch has at most this many times the members of the one that was measured: the first may be an unusual one."""
PIECES = 8
"""A batch whose worker died is given out again in this many pieces, until the member that kills is alone."""
AHEAD = 2
"""Batches under way per worker: one computes, one waits."""
WORKERS = 32
"""Assumed of executors that do not say how many they have."""

Keep = Callable[[Mapping[int, Answer]], None]


@dataclass(frozen=True)
class Returned:
    """What a worker sends back: answers to the first members of a batch, and the time that they took."""

    answers: list[Answer]
    seconds: float
    interrupted: bool = False
    process: int = 0
    cpu: float = 0.0


def run_batch(model: Callable[..., Any], batch: list[dict[str, Any]], patience: float) -> Returned:
    """Compute members one after the other, in a worker; those that are left after `patience` seconds go back."""
    called: list[Answer | Plain] = []
    began, cpu, stopped = time.perf_counter(), time.thread_time(), False
    try:
        for arguments in batch:
            called.append(call(model, arguments))
            if time.perf_counter() - began > patience:
                break
    except KeyboardInterrupt:
        stopped = True
    answers = [packed(answer) for answer in called]
    return Returned(answers, time.perf_counter() - began, stopped, os.getpid(), time.thread_time() - cpu)


@dataclass(frozen=True)
class Pool:
    """Source of executors: an own one is made again after its workers died, a given one is what it is."""

    make: Callable[[], Executor]
    is_own: bool
    workers: int


@contextmanager
def pool_of(executor: Any, workers: int | None, model: Callable[..., Any]) -> Iterator[Pool | None]:
    """The workers of an argument `executor`; None for none."""
    if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int) or workers < 1):
        raise ArgumentError(f"workers must be a positive integer, not {shown(workers)}", argument="workers")
    if executor is None:
        yield None
    elif isinstance(executor, str):
        if executor not in ("threads", "processes"):
            raise ArgumentError(
                f'executor is "{executor}"; known: threads, processes, or an object with submit', argument="executor"
            )
        count = workers or os.cpu_count() or 1
        if executor == "processes":
            _check_picklable(model)
        made: list[Executor] = []

        def make() -> Executor:
            if executor == "threads":
                made.append(futures.ThreadPoolExecutor(count))
            else:
                made.append(futures.ProcessPoolExecutor(count, initializer=_end_with_parent))
            return made[-1]

        try:
            yield Pool(make, True, count)
        finally:
            for one in made:
                one.shutdown(wait=False, cancel_futures=True)
    elif callable(getattr(executor, "submit", None)):
        yield Pool(lambda: executor, False, workers or _workers_of(executor))
    else:
        raise ArgumentError(f"executor must have a method submit, not {shown(executor)}", argument="executor")


def _check_picklable(model: Callable[..., Any]) -> None:
    try:
        pickle.dumps(model)
    except Exception as error:
        raise ArgumentError(
            f"processes cannot import the model {shown(model)} ({error}): define it in a module, or use threads",
            argument="model",
        ) from error


def _end_with_parent() -> None:
    """A worker ends with its parent, also where that was killed: it would wait for work for ever."""
    import multiprocessing  # which is slow to import, and there in a worker

    def watch() -> None:
        parent = multiprocessing.parent_process()
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _workers_of(executor: Any) -> int:
    """Number of workers that an executor tells: those of the standard library and MPI, Dask's client."""
    client = getattr(executor, "_client", None)
    try:
        if client is not None:
            return max(1, sum(client.nthreads().values()))
        return max(1, int(getattr(executor, "num_workers", None) or executor._max_workers))
    except Exception:
        return WORKERS


class Spread:
    """The members of a sweep over the workers of a pool.

    Args:
        model: of the sweep.
        members: those to be computed.
        arguments: parameters of a member.
        keep: takes answers as they come.
        batch: members in a batch; None: by their time.
        check: raises where Ctrl-C was pressed.
    """

    def __init__(
        self,
        model: Callable[..., Any],
        members: Iterable[int],
        arguments: Callable[[int], dict[str, Any]],
        keep: Keep,
        batch: int | None,
        check: Callable[[], None],
    ) -> None:
        self.model, self.arguments, self.keep, self.batch, self.check = model, arguments, keep, batch, check
        waiting = list(members)
        self.fresh, self.left = iter(waiting), len(waiting)
        self.pieces: deque[list[int]] = deque()
        self.deaths: Counter[int] = Counter()
        self.alone: list[int] = []
        self.size, self.aim = 1, BATCH
        """Members in a batch, and its seconds."""
        self.each, self.measured = 0.0, 0
        """Seconds of a member in the batches before, and members in the largest of them."""
        self.accepted = False
        """Whether the executor took a batch at all."""
        self.began, self.returned = time.process_time(), 0
        self.here = 0.0
        """CPU time of members that were computed by threads of this process."""

    def over(self, pool: Pool) -> str | None:
        """Compute all; the reason, if the executor accepts no more work."""
        while True:
            lost = self._hand_out(pool.make(), pool.workers)
            if lost is None and not self.pieces:
                return self._one_by_one(pool)
            if lost is not None and not (pool.is_own and self.accepted):
                return lost

    def _hand_out(self, executor: Executor, workers: int) -> str | None:
        """Until nothing is left, or the executor is lost: then the reason."""
        done: SimpleQueue[Future[Returned]] = SimpleQueue()
        under_way: dict[Future[Returned], list[int]] = {}
        lost: str | None = None
        self.accepted = False
        try:
            while True:
                while lost is None and len(under_way) < AHEAD * workers and (batch := self._next(workers)):
                    try:
                        future = self._submit(executor, batch)
                    except Exception as error:
                        self.pieces.appendleft(batch)
                        lost = reason(error)
                    else:
                        self.accepted = True
                        under_way[future] = batch
                        future.add_done_callback(done.put)
                if not under_way:
                    return lost
                self.check()
                try:
                    future = done.get(timeout=PULSE)
                except Empty:  # a chance for Ctrl-C
                    continue
                lost = self._take(future, under_way.pop(future)) or lost
        except BaseException as error:
            for future in list(under_way):
                future.cancel()
            if isinstance(error, KeyboardInterrupt):
                for future, batch in under_way.items():
                    if future.done() and not future.cancelled() and future.exception() is None:
                        self.keep(dict(zip(batch, future.result().answers, strict=False)))
            raise

    def _submit(self, executor: Executor, batch: list[int]) -> Future[Returned]:
        patience = PATIENCE * self.aim if self.batch is None else float("inf")
        return executor.submit(run_batch, self.model, [self.arguments(member) for member in batch], patience)

    def _next(self, workers: int) -> list[int]:
        """The next batch; the last ones are smaller."""
        if self.pieces:
            return self.pieces.popleft()
        size = self.batch or max(1, min(self.size, max(-(-self.left // (AHEAD * workers)), self._least())))
        batch = list(itertools.islice(self.fresh, size))
        self.left -= len(batch)
        return batch

    def _least(self) -> int:
        return int(self.size * SHORTEST_BATCH / self.aim)

    def _take(self, future: Future[Returned], batch: list[int]) -> str | None:
        """What came back of a batch; the reason, where the executor is lost."""
        if future.cancelled():
            self.pieces.append(batch)
            return "the executor cancelled its work"
        error = future.exception()
        if error is None:
            self._keep(batch, future.result())
            return None
        if not isinstance(error, Exception):
            raise error
        if isinstance(error, futures.CancelledError):
            self.pieces.append(batch)
            return "the executor cancelled its work"
        lost = isinstance(error, futures.BrokenExecutor)
        if len(batch) > 1:
            size = -(-len(batch) // PIECES)
            self.pieces.extend(batch[i : i + size] for i in range(0, len(batch), size))
        elif not (lost or _is_death(error)):
            self.keep({batch[0]: reason(error)})
        else:
            (member,) = batch
            self.deaths[member] += 1
            if self.deaths[member] < TRIES - 1:
                self.pieces.append(batch)
            else:
                self.alone.append(member)
        return reason(error) if lost else None

    def _keep(self, batch: list[int], returned: Returned) -> None:
        """Keep the answers, and measure."""
        known = len(returned.answers)
        self.keep(dict(zip(batch, returned.answers, strict=False)))
        if returned.interrupted:
            raise KeyboardInterrupt
        if rest := batch[known:]:
            self.pieces.append(rest)
        self.returned += 1
        if returned.process == os.getpid():
            self.here += returned.cpu
        cost = (time.process_time() - self.began - self.here) / self.returned
        self.aim = min(max(BATCH, SHARE * cost), LONGEST_BATCH)
        each = returned.seconds / max(known, 1)
        self.measured = max(self.measured, known, 1)
        self.each = 0.5 * (self.each + each) if known > 1 and self.each else each
        self.size = max(1, min(int(self.aim / max(self.each, CLOCK_TICK)), GROWTH * self.measured))

    def _one_by_one(self, pool: Pool) -> str | None:
        """Members whose workers died, each alone, so that one that kills affects no other."""
        executor: Executor | None = None
        for member in self.alone:
            self.check()
            executor = executor or pool.make()
            try:
                self._keep([member], self._submit(executor, [member]).result())
            except Exception as error:
                lost = isinstance(error, futures.BrokenExecutor)
                died = lost or _is_death(error)
                self.keep({member: f"its worker died {TRIES} times" if died else reason(error)})
                executor = None if lost else executor
        return None


def _is_death(error: BaseException) -> bool:
    """Dask, MPI and Ray report a dead worker by errors of their own, which need not be installed here."""
    return type(error).__name__ in ("KilledWorker", "CommClosedError", "MPIError", "WorkerCrashedError")
