"""Loads are declared once: the schema of model files is what their declarations and docstrings say."""

from __future__ import annotations

import inspect
import sys
from pathlib import Path

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


def test_words_of_a_docstring() -> None:
    text = "Add.\n\nArgs:\n    a, b: two of\n        them: both [m].\n    c: [N]; None: as drawn.\n\nRaises:\n    d"
    assert elements.arguments(text) == {
        "a": "two of them: both [m].",
        "b": "two of them: both [m].",
        "c": "[N]; None: as drawn.",
    }
    assert elements.sentence("two of them") == "Two of them."
    assert [elements.plain(x) for x in (1.0, (0.0, 1.5), "ground", 0)] == ["1", "[0, 1.5]", '"ground"', "0"]
