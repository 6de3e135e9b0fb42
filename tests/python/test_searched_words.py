"""Words that people search for lead to the section that answers them, by the index of terms and by a search."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
ROW = re.compile(r"^\| ([^|]+) \| (.*) \|$", flags=re.MULTILINE)
LINK = re.compile(r"\[[^\]]+\]\(([\w/-]+\.md)#([\w-]+)\)")
SEARCHED = (
    "natural frequency", "equilibrium", "motor torque", "release", "rope", "spring force", "degrees of freedom",
    "inertia of a disc", "density", "CAD",
    "singular", "over-constrained", "CAD inertia",
    "contact", "flexible", "events", "control",
)  # fmt: skip


def slug(title: str) -> str:
    """The anchor of a heading, as GitHub and the site make it."""
    return re.sub(r"[^\w\- ]", "", title.replace("`", "")).strip().lower().replace(" ", "-")


def sections(page: Path) -> dict[str, str]:
    """Anchor of each heading -> the text from there to the next one."""
    parts = re.split(r"^#+ (.+)$", page.read_text("utf-8"), flags=re.MULTILINE)[1:]
    return {slug(title): f"{title}\n{text}" for title, text in zip(parts[::2], parts[1::2], strict=True)}


def index() -> dict[str, list[tuple[str, str]]]:
    """Word -> pages and anchors of its row."""
    table = (DOCS / "words.md").read_text("utf-8").partition("## Words people search for")[2].partition("\n## ")[0]
    rows = [(words, LINK.findall(where)) for words, where in ROW.findall(table)][1:]
    return {word.strip(): links for words, links in rows for word in words.split(",")}


def test_every_row_leads_somewhere() -> None:
    found = index()
    assert len(found) > 20
    for word, links in found.items():
        assert links, word
        for page, anchor in links:
            assert anchor in sections(DOCS / page), f"{word}: {page}#{anchor}"


@pytest.mark.parametrize("word", SEARCHED)
def test_a_section_answers_in_that_word(word: str) -> None:
    links = index()[word]
    texts = [sections(DOCS / page)[anchor].lower() for page, anchor in links]
    stems = [part[:7].lower() for part in word.split()]  # "natural frequencies" answers "natural frequency"
    assert any(all(stem in text for stem in stems) for text in texts), word
