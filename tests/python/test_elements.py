"""Loads are declared once: the schema of model files is what their declarations and docstrings say."""

from __future__ import annotations

import inspect
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita.builder.declaration import LOADS
from partita.io import schema

sys.path.insert(0, str(Path(__file__).parents[2] / "tools"))
import elements


def test_the_schema_is_current() -> None:
    assert elements.current() == schema.PATH.read_text(encoding="utf-8"), "run .venv/bin/python tools/docs.py --write"


@pytest.mark.parametrize("kind", sorted(LOADS))
def test_every_argument_is_declared_and_described(kind: str) -> None:
    """The method that users call is the one that was declared, and its fields are its arguments besides the name."""
    load = LOADS[kind]
    method = inspect.unwrap(getattr(pt.Mechanism, f"add_{kind}"))
    assert method is inspect.unwrap(load.method)
    assert {"name", *load.fields} == set(load.defaults)
    assert set(load.defaults) <= set(elements.arguments(inspect.getdoc(method) or ""))


@pytest.mark.parametrize(("kind", "law"), [("spring", {}), ("rope", {}), ("bushing", None)])
def test_lengths_left_out_are_those_of_the_drawing(kind: str, law: dict[str, Any] | None) -> None:
    m = pt.Mechanism("pair")
    for name, x in (("a", 1.0), ("b", 4.0)):
        m.add_body(
            name, mass=1.0, inertia=(1, 1, 1), position=(x, 0, 0), orientation=((0, -1, 0), (1, 0, 0), (0, 0, 1))
        )
    if law is None:
        m.add_bushing("load", "a", "b", (2.0, 5.0, 0.0), stiffness=np.ones(6))
        found = m.to_spec()["forces"][0]
        assert (found["point1"], found["point2"]) == ([5.0, -1.0, 0.0], [5.0, 2.0, 0.0])
        return
    getattr(m, f"add_{kind}")("load", "a", (0, 2, 0), "b", (4, 0, 0), stiffness=2.0, **law)
    assert m.to_spec()["forces"][0]["length"] == pytest.approx(np.hypot(5.0, 4.0))
    assert m.forces["load"].length is None


def test_words_of_a_docstring() -> None:
    text = "Add.\n\nArgs:\n    a, b: two of\n        them: both [m].\n    c: [N]; None: as drawn.\n\nRaises:\n    d"
    assert elements.arguments(text) == {
        "a": "two of them: both [m].",
        "b": "two of them: both [m].",
        "c": "[N]; None: as drawn.",
    }
    assert elements.sentence("two of them") == "Two of them."
    assert [elements.plain(x) for x in (1.0, (0.0, 1.5), "ground", 0)] == ["1", "[0, 1.5]", '"ground"', "0"]
