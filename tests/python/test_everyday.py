"""Everyday drawings by chance: right or refused, never wrong; and what must not matter does not.

Every number is a case, the same on every machine; `make trust` looks at thousands more, drawn more widely.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from everyday import kinds
from everyday.case import Case
from everyday.chance import case, kinds_of
from everyday.checks import CHECKS
from everyday.judging import judge
from everyday.shrinking import shrunk
from everyday.study import Study, report, study

CASES = 200
FEW = 2
"""Checks of each case, by chance; all have the tolerance, and that success is not called invalid."""


@pytest.fixture(scope="module")
def found() -> Study:
    return study(range(CASES), few=FEW)


def test_nothing_is_wrong_with_success(found: Study) -> None:
    assert not found.wrong, "\n\n".join(report(seed, verdict) for seed, verdict in found.wrong[:2])


def test_the_cases_are_as_intended(found: Study) -> None:
    """Nothing is right because it was passed over."""
    assert found.counts["compared"] > 0.75 * CASES and found.counts["refused"] < 0.12 * CASES
    cheap = [name for name in CHECKS if name not in ("independent", "instants", "stepper", "file", "exact")]
    assert min(found.counts[name] for name in cheap) > 0.1 * CASES, found.counts
    assert min(found.counts[name] for name in ("instants", "stepper", "file", "exact")) > 2, found.counts
    for words in ("scissor lift", "door", "cart"):
        assert found.drawn[words] > 8
    for kind in ("TableTorque", "TableForce", "FunctionTorque", "Stop", "Contact", "Course", "TableCourse"):
        assert found.drawn[kind] > 8, found.drawn
    for over in ("time", "joint", "distance", "along", "cosine"):
        assert found.drawn[f"table over {over}"] > 4, found.drawn


@pytest.mark.parametrize("seed", [6, 12, 19])
def test_every_check_of_some(seed: int) -> None:
    """With the motion by the independent program among them."""
    verdict = judge(case(seed))
    assert verdict.word == "right" and not verdict.wrong, verdict


def test_every_kind_has_the_freedom_that_it_says() -> None:
    for make in kinds.KINDS:
        for seed in range(4):
            kind = make(np.random.default_rng([seed, 3]))
            assert kind.drawing.build().compile().mobility == kind.mobility, (kind.words, seed)


def test_a_find_is_made_short() -> None:
    """Of a case with several loads, stays what makes it fail: here, that there is a stop."""
    seed = next(s for s in range(CASES) if kinds_of(case(s).drawing)["Stop"] and len(case(s).drawing.forces) > 2)

    def fails(c: Case) -> bool:
        return kinds_of(c.drawing)["Stop"] > 0 and judge(c, only=[]).word == "right"

    short = shrunk(replace(case(seed), outputs=7), fails)
    assert len(short.drawing.forces) == 1 and short.outputs == 2 and not short.error
    names: dict[str, object] = {}
    exec(short.lines(), names)  # it reads back as a program
    assert names["run"].success  # type: ignore[attr-defined]
