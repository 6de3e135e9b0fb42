"""One case: what is asked of Partita, what shall come out of it, and how that is known."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from partita.errors import PartitaError, SuspectResultWarning
from partita.results import Result

RIGHT, REFUSED, NO_SUCCESS, SUSPECT = "right", "refused", "not success", "suspect"
WRONG = "success and wrong"
UNHELD = "success, held against nothing"
"""What must never come out."""


@dataclass(frozen=True)
class Held:
    """Numbers that were found, held against those that an independent answer gives."""

    what: str
    found: Any
    exact: Any
    within: float

    @property
    def off(self) -> float:
        """The largest difference; NaN where one of them is not a number."""
        return float(np.max(np.abs(np.asarray(self.found, dtype=float) - np.asarray(self.exact, dtype=float))))

    @property
    def right(self) -> bool:
        return self.off <= self.within


Ask = Callable[[], Iterator[Held]]


@dataclass(frozen=True)
class Case:
    """A question to Partita.

    `kind`: what shall come out. `words`: of a right answer, what it was held against; else a part of what is said.
    `error`: the type of the error, or the status of the run.
    """

    name: str
    title: str
    kind: str
    words: str
    ask: Ask
    error: str = ""


@dataclass(frozen=True)
class Outcome:
    kind: str
    words: str
    error: str = ""


class Ended(Exception):
    """A run that is no success."""


class Doubted(Exception):
    """A run that is doubtful."""


def done(run: Result) -> Result:
    """`run` if it says success and has no doubt."""
    findings = "; ".join(finding.sentence for finding in run.certificate.findings)
    if not run.success:
        raise Ended(run.status, f"{run.message} {findings}")
    if run.certificate.verdict == "suspect":
        raise Doubted(run.status, findings)
    return run


def outcome(case: Case) -> Outcome:
    """What comes out of a case. An error that is not one of Partita's goes through."""
    held: list[Held] = []
    kind, words, error = RIGHT, "", ""
    try:
        with warnings.catch_warnings():
            # what is doubtful is asked for by `done`
            warnings.simplefilter("ignore", SuspectResultWarning)
            for one in case.ask():
                held.append(one)
    except PartitaError as caught:
        kind, words, error = REFUSED, str(caught), type(caught).__name__
    except Ended as caught:
        kind, error, words = NO_SUCCESS, *caught.args
    except Doubted as caught:
        kind, error, words = SUSPECT, *caught.args
    wrong = [f"{one.what} is off by {one.off:.2e}, more than {one.within:.0e}" for one in held if not one.right]
    if wrong:
        return Outcome(WRONG, "; ".join(wrong))
    if kind == RIGHT and not held:
        return Outcome(UNHELD, "")
    return Outcome(kind, words, error)


def right(title: str, against: str) -> Callable[[Ask], Case]:
    """A case whose answer is right; `against`: the independent answer."""
    return lambda ask: Case(ask.__name__, title, RIGHT, against, ask)


def refused(title: str, error: type[PartitaError], words: str) -> Callable[[Ask], Case]:
    """A case that is refused by a typed error with these words in it."""
    return lambda ask: Case(ask.__name__, title, REFUSED, words, ask, error.__name__)


def no_success(title: str, status: str, words: str) -> Callable[[Ask], Case]:
    """A case whose run ends with this status, `success` False and these words."""
    return lambda ask: Case(ask.__name__, title, NO_SUCCESS, words, ask, status)


def suspect(title: str, words: str) -> Callable[[Ask], Case]:
    """A case whose answer is right within limits, which a warning with these words states."""
    return lambda ask: Case(ask.__name__, title, SUSPECT, words, ask, "finished")
