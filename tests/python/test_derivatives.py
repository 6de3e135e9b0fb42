"""Linearised equations of some mechanisms of the zoo with springs.

`python -m derivatives`, a part of `make trust`, looks at all of them.
"""

import pytest
from derivatives.study import study

NAMES = (
    "antiparallelogram",
    "belt-drive",
    "bennett",
    "cam-rocker",
    "cv-shaft",
    "delta",
    "five-bar",
    "gear-pair",
    "gyroscope",
    "rccc",
    "rolling-coin",
    "screw-press",
)


@pytest.mark.parametrize("name", NAMES)
def test_the_matrices_are_the_extrapolated_differences(name: str) -> None:
    assert study(name).wrong == []
