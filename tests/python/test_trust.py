"""Success is never wrong: each case of docs/trust.md comes out as stands there, none wrong with success."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from trust import CASES, CLASSES
from trust.case import NO_SUCCESS, REFUSED, RIGHT, SUSPECT, UNHELD, WRONG, Case, Held, done, outcome, refused, right
from trust.page import tables

import partita as pt
from partita.errors import ArgumentError, SuspectResultWarning

PAGE = Path(__file__).parents[2] / "docs" / "trust.md"


@pytest.mark.parametrize("name", CASES)
def test_cases(name: str) -> None:
    case = CASES[name]
    found = outcome(case)
    assert found.kind not in (WRONG, UNHELD), (found.kind, found.words)
    assert found.kind == case.kind, (found.kind, found.error, found.words)
    if case.kind != RIGHT:
        assert found.error == case.error and case.words in found.words, (found.error, found.words)


def test_names_and_titles_of_cases_differ() -> None:
    cases = [case for c in CLASSES for case in c.cases]
    assert len(CASES) == len(cases)
    titles = [(c.heading, case.title) for c in CLASSES for case in c.cases]
    assert len(set(titles)) == len(titles)
    assert {case.kind for case in cases} <= {RIGHT, REFUSED, NO_SUCCESS, SUSPECT}
    assert all(case.words for case in cases)


def test_the_page_lists_these_cases() -> None:
    """Where this fails: `.venv/bin/python tools/docs.py --write`."""
    assert tables(CLASSES) in PAGE.read_text("utf-8")


# ------------------------------------------------- the judge itself


def pendulum() -> pt.Mechanism:
    return pt.catalogue.load("planar-pendulum")


def test_a_wrong_answer_is_seen() -> None:
    @right("a number that is off", "itself")
    def off() -> Iterator[Held]:
        yield Held("one", [1.0, 1.0 + 2e-9], 1.0, 1e-9)

    found = outcome(off)
    assert found.kind == WRONG and "one is off by 2.00e-09" in found.words


def test_what_is_no_number_is_wrong() -> None:
    @right("a number that is none", "itself")
    def none() -> Iterator[Held]:
        yield Held("one", [1.0, np.nan], 1.0, 1e300)

    assert outcome(none).kind == WRONG


def test_wrong_numbers_before_a_refusal_are_seen() -> None:
    """A run that ends early has kept what it computed: that shall be right, too."""

    @refused("refused after a wrong number", ArgumentError, "no")
    def early() -> Iterator[Held]:
        yield Held("one", 1.0, 2.0, 0.5)
        raise ArgumentError("no", argument="x")

    assert outcome(early).kind == WRONG


def test_success_without_an_answer_is_none() -> None:
    @right("a run and nothing to hold it against", "nothing")
    def alone() -> Iterator[Held]:
        done(pendulum().simulate(0.1))
        yield from ()

    assert outcome(alone).kind == UNHELD


def test_errors_of_others_go_through() -> None:
    @right("a mistake", "nothing")
    def mistake() -> Iterator[Held]:
        raise ZeroDivisionError
        yield

    with pytest.raises(ZeroDivisionError):
        outcome(mistake)


def test_a_suspect_run_is_not_right(monkeypatch: pytest.MonkeyPatch) -> None:
    from trust import contradictions

    case: Case = contradictions.hardly_off
    with warnings.catch_warnings():
        warnings.simplefilter("error", SuspectResultWarning)
        assert outcome(case).kind == SUSPECT
