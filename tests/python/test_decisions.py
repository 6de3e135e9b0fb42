"""The decisions: all are listed, and what a later one replaced is marked, in its file as in the list."""

from __future__ import annotations

import re
from pathlib import Path

DECISIONS = Path(__file__).parents[2] / "docs" / "decisions"
FILES = {path.name[:4]: path for path in sorted(DECISIONS.glob("[0-9]*.md"))}
ROW = re.compile(r"^\| \[(\d{4})\]\(([\w-]+\.md)\) \| .*? \|$", flags=re.MULTILINE)
MARK = re.compile(r"^Replaced (?:in part )?by .*?(?=\n\n)", flags=re.MULTILINE | re.DOTALL)
LISTED = re.compile(r"\(replaced (?:in part )?by ((?:\d{4}(?:, )?)+)\)")
LINK = re.compile(r"\[(\d{4})\]\(([\w-]+\.md)\)")


def replaced(text: str) -> list[str]:
    """By which decisions a decision says to be replaced."""
    mark = MARK.search(text)
    return [number for number, _ in LINK.findall(mark[0])] if mark else []


def unmarked(texts: dict[str, str]) -> list[str]:
    """Decisions that another one says to overturn, without a mark that names it."""
    found = []
    for number, text in texts.items():
        for other, _ in re.findall(LINK.pattern + r"(?=, overturned here)", text):
            found += [other] if number not in replaced(texts[other]) else []
    return found


def test_every_decision_is_listed_once_in_order() -> None:
    rows = ROW.findall((DECISIONS / "README.md").read_text("utf-8"))
    assert rows == [(number, path.name) for number, path in FILES.items()]


def test_marks_in_files_and_in_the_list_agree() -> None:
    for row in (DECISIONS / "README.md").read_text("utf-8").splitlines():
        if found := re.match(r"\| \[(\d{4})\]", row):
            named = [number for numbers in LISTED.findall(row) for number in numbers.split(", ")]
            assert replaced(FILES[found[1]].read_text("utf-8")) == named, row


def test_what_is_overturned_is_marked() -> None:
    texts = {number: path.read_text("utf-8") for number, path in FILES.items()}
    assert not unmarked(texts) and replaced(texts["0010"]) == ["0048"] and replaced(texts["0065"]) == ["0074", "0081"]
    one = {
        "0001": "# 0001\n\n**Asked.** It.\n",
        "0002": "**Asked.** [0001](0001-a.md), overturned here, was.\n",
    }
    assert unmarked(one) == ["0001"]
    one["0001"] = "# 0001\n\nReplaced by [0002](0002-b.md): that.\n\n**Asked.** It.\n"
    assert unmarked(one) == []
