"""Labels of equations: the heading of docs/theory at which each stands, and links to it from the pages that cite it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"
THEORY = "theory"
# Pages outside docs/theory on which a label in parentheses is a citation; on others (3) may be a shape or a number.
CITING = ("formulations", "geometry", "inverse-dynamics", "measure", "paper", "tolerances")

LABEL = re.compile(r"\(([A-Z]?[1-9]\d?)\)")
HEADING = re.compile(r"^#+ (.*)$", flags=re.MULTILINE)
# What is no running text, a heading, or a label in running text.
PART = re.compile(
    r"^```.*?^```$|`[^`]*`|\$[^$]*\$|\[[^\]]*\]\([^)]*\)|<!--.*?-->|^#+ (?P<heading>[^\n]*)$"
    rf"|(?<![\w\])]){LABEL.pattern}",
    flags=re.MULTILINE | re.DOTALL,
)


def anchor(heading: str) -> str:
    """The id that a heading gets."""
    return re.sub(r"[^\w-]", "", heading.lower().replace(" ", "-"))


def targets() -> Iterator[tuple[str, Path, str]]:
    """Every label with its page and the heading there that bears it."""
    for page in sorted((DOCS / THEORY).glob("*.md")):
        for heading in HEADING.findall(page.read_text(encoding="utf-8"))[1:]:
            for label in LABEL.findall(heading):
                yield label, page, heading


def linked(text: str, page: Path, known: dict[str, tuple[Path, str]]) -> str:
    """The text of a page with a link for each label in it, save those below their own heading."""
    up = "../" * (len(page.relative_to(DOCS).parts) - 1)
    section = ""

    def shown(found: re.Match[str]) -> str:
        nonlocal section
        if found["heading"] is not None:
            section = found["heading"]
        target, heading = known.get(found[2] or "", (page, section))
        if (target, heading) == (page, section):
            return found[0]
        return f"[{found[0]}]({up}{target.relative_to(DOCS).as_posix()}#{anchor(heading)})"

    return PART.sub(shown, text)


def cites(page: Path) -> bool:
    """Whether labels in parentheses are citations on this page of docs/."""
    parts = page.relative_to(DOCS).with_suffix("").parts
    return parts[0] in (THEORY, *CITING)
