"""docs/messages.md: every message on the page is what its model says, names something, and its remedy works."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from typing import Any

import messages
import pytest

ROOT = Path(__file__).resolve().parents[2]
CURED = [case for case in messages.CASES if case.cured is not None]


@pytest.mark.parametrize("case", messages.CASES, ids=lambda case: case.title)
def test_each_is_said_and_names_what_it_is_about(case: Any) -> None:
    words = case.words()
    assert words, "nothing was said"
    kind = words.partition(":")[0]
    # an error has its type, a run its status, a report a sentence
    assert kind.endswith("Error") or kind.startswith("success is False") or words.count(" ") > 5
    assert "Traceback" not in words and "0x" not in words and "panick" not in words
    assert case.cause.endswith(".") and case.remedy.endswith(".")


@pytest.mark.parametrize("case", CURED, ids=lambda case: case.title)
def test_remedies_work(case: Any) -> None:
    case.cured()  # raises nothing


def test_the_page_is_what_is_said() -> None:
    spec = importlib.util.spec_from_file_location("docs_tool", ROOT / "tools" / "docs.py")
    assert spec is not None and spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    page = ROOT / "docs" / "messages.md"
    text = page.read_text(encoding="utf-8")
    assert tool.current(page) == text, "run .venv/bin/python tools/docs.py --write"
    assert len(messages.CASES) >= 40 and f"{len(messages.CASES)} cases." in text
    assert len(re.findall(r"^### ", text, re.MULTILINE)) == len(messages.CASES)
