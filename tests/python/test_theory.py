"""Labels of equations: every one that a comment cites has one place in docs/theory, with the formula beside it."""

from __future__ import annotations

import ast
import io
import re
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "tools"))
from website import labels as site

ROOT = Path(__file__).parents[2]
THEORY = ROOT / "docs" / "theory"
LABEL = r"[A-Z]?[1-9]\d?"
LISTED = re.compile(rf"(?<![\w\])}}'⁻⁺])\(({LABEL}(?:, {LABEL}(?:-{LABEL})?)*)\)(?!\))")
"""One or several labels alone in parentheses, which no name or matrix precedes: (34), (S3, S4), (S2, P1-P3)."""
BARE = re.compile(r"(?<![\w.(])[SPRV][1-9]\d?(?!\w)")
"""Labels in a sentence: S1-S5, P6."""
SECTION = re.compile(r"[Tt]heory \d|[Cc]atalogue row \d|(?<![\w(])\((?:[3-9]|1\d)\.\d{1,2}(?:, \d+)?\)")
"""What points to the sections of a page that is not here."""
HEADING = re.compile(r"^#{2,4} (.*)$", flags=re.MULTILINE)
MATH = re.compile(r"^```math\n(.*?)^```$", flags=re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\]\(([\w/.-]*\.md)?#([\w-]+)\)")


def sources() -> Iterator[Path]:
    for folder in ("crates", "python", "tests", "tools", "benches", "examples"):
        for ending in ("*.rs", "*.py", "*.js"):
            yield from (path for path in sorted((ROOT / folder).rglob(ending)) if "target" not in path.parts)


def comments(name: str, text: str) -> Iterator[tuple[int, str]]:
    """Lines of comments and docstrings with their numbers."""
    if name.endswith(".py"):
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type == tokenize.COMMENT:
                yield token.start[0], token.string
        for node in ast.walk(ast.parse(text)):
            if (
                isinstance(node, ast.Expr)
                and isinstance(node.value, ast.Constant)
                and isinstance(node.value.value, str)
            ):
                yield from enumerate(node.value.value.splitlines(), node.lineno)
        return
    for found in re.finditer(r"(?<![:\"'])//[^\n]*|/\*.*?\*/", text, flags=re.DOTALL):
        yield from enumerate(found[0].splitlines(), text.count("\n", 0, found.start()) + 1)


def cited(comment: str) -> list[str]:
    """The labels of a comment."""
    listed = [label for group in LISTED.findall(comment) for label in re.split(", |-", group)]
    return [*listed, *(found[0] for found in BARE.finditer(LISTED.sub("", comment)))]


def sections(text: str) -> Iterator[tuple[str, str]]:
    """Headings of a page with what stands below each."""
    parts = HEADING.split(text)[1:]
    yield from zip(parts[::2], parts[1::2], strict=True)


@cache
def pages() -> dict[str, str]:
    return {path.name: path.read_text("utf-8") for path in sorted(THEORY.glob("*.md"))}


@cache
def stated() -> Counter[str]:
    """How many places each label has."""
    return Counter(
        label for text in pages().values() for heading, _ in sections(text) for label in site.LABEL.findall(heading)
    )


def faults(name: str, text: str, known: Counter[str]) -> Iterator[str]:
    """What is wrong with the citations of a file; examples in docstrings cite nothing."""
    if not any(True for _ in wrong(text, known)):
        return  # whatever is comment there and what is code
    for number, comment in comments(name, text):
        if not comment.lstrip().startswith((">>>", "...")):
            yield from (f"{name}:{number}: {fault}: {comment.strip()}" for fault in wrong(comment, known))


def wrong(comment: str, known: Counter[str]) -> Iterator[str]:
    """What is wrong with the citations of a comment."""
    yield from (f"({label}) has {known[label]} places" for label in cited(comment) if known[label] != 1)
    if SECTION.search(comment):
        yield "points to no page"


def test_every_label_that_a_comment_cites_has_one_place() -> None:
    found = [x for path in sources() for x in faults(str(path.relative_to(ROOT)), path.read_text("utf-8"), stated())]
    assert not found, "\n".join(found)


def test_no_label_has_two_places_and_none_is_missing_in_its_series() -> None:
    assert [label for label, count in stated().items() if count > 1] == []
    series: dict[str, list[int]] = {}
    for label in stated():
        series.setdefault(label.rstrip("0123456789"), []).append(int(label.lstrip("ABCDEFGHIJKLMNOPQRSTUVWXYZ")))
    for letter, numbers in series.items():
        assert sorted(numbers) == list(range(1, len(numbers) + 1)), letter
    assert max(series[""]) == 48


@pytest.mark.parametrize("name", [path.name for path in sorted(THEORY.glob("*.md"))])
def test_the_formula_of_a_label_stands_at_its_place(name: str) -> None:
    assert unmarked(pages()[name]) == []


def unmarked(text: str) -> list[str]:
    """Labels of headings below which no formula carries them."""
    found = []
    for heading, below in sections(text):
        formulas = "".join(MATH.findall(below))
        found += [label for label in site.LABEL.findall(heading) if rf"\text{{({label})}}" not in formulas]
    return found


def test_links_to_headings_lead_to_one() -> None:
    missing = []
    for page in sorted((ROOT / "docs").rglob("*.md")):
        for file, fragment in LINK.findall(page.read_text("utf-8")):
            target = page.parent / file if file else page
            if "reference" in target.parts or not target.is_file():  # made for the site
                continue
            plain = re.sub(r"^```.*?^```$", "", target.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
            heads = re.findall(r"^#+ (.*)$", plain, flags=re.MULTILINE)
            if fragment not in {site.anchor(head.replace("`", "")) for head in heads}:
                missing.append(f"{page.name}: {file}#{fragment}")
    assert not missing


@pytest.mark.parametrize(
    ("name", "text", "fault"),
    [
        ("a.rs", "fn f() {} // the reduced equations (P9)", "(P9) has 0 places"),
        ("a.rs", "//! By levels (S3, S9).", "(S9) has 0 places"),
        ("a.rs", "//! rates          (S2, P1-P9)", "(P9) has 0 places"),
        ("a.rs", "/// As P9 says.", "(P9) has 0 places"),
        ("a.rs", "/// Levels.      (11.9)", "points to no page"),
        ("a.rs", "//! Rows: theory 11.1.", "points to no page"),
        ("a.py", "x = 1  # (99)", "(99) has 0 places"),
        ("a.py", 'def f():\n    """By (34)."""', "(34) has 2 places"),
        ("a.js", "let x = 1; // P9", "(P9) has 0 places"),
        ("a.js", "/* one\n(99) */", "a.js:2: (99) has 0 places"),
        ("a.rs", "let x = f(99); // of P3, (12)-(14) and f(99), M (99)⁻¹", "(99) has 0 places"),
    ],
)
def test_a_label_without_one_place_is_seen(name: str, text: str, fault: str) -> None:
    known = Counter(["S2", "S3", "P1", "P3", "12", "14", "34", "34"])
    (found,) = faults(name, text, known)
    assert fault in found


def test_what_is_no_citation_is_none() -> None:
    for comment in ("// f(99), rows [3](4), x (0.5), the year (2016), C(20, 10)", "// see (a) and P0, `S3x`, NP12"):
        assert cited(comment) == [], comment
    assert list(comments("a.rs", 'let x = "https://here"; let y = "//z"; // (34)')) == [(1, "// (34)")]


def test_a_formula_without_its_label_is_seen() -> None:
    text = "# T\n\n## (S1), (1) Equations\n\n```math\n\\text{(S1)} x\n```\n\n(1) too.\n\n## (2) None\n\nWords.\n"
    assert unmarked(text) == ["1", "2"]


def test_labels_on_pages_of_the_site_are_links() -> None:
    """In running text, but not in code, formulas, links, headings and below their own."""
    known = {label: (page, heading) for label, page, heading in site.targets()}
    assert set(known) == set(stated())
    reduced, measure = site.DOCS / "theory" / "reduced.md", site.DOCS / "measure.md"
    text = "# T (P3)\n\nBy (P3), `(P3)`, $(P3)$, [(P3)](x.md), f(3), (99).\n\n```math\n(P3)\n```\n"
    place = f"theory/reduced.md#{site.anchor(known['P3'][1])}"
    assert site.linked(text, measure, known) == text.replace("By (P3)", f"By [(P3)]({place})")
    own = f"## {known['P3'][1]}\n\n(P3) by (P2).\n\n## Next\n\n(12)\n"
    shown = site.linked(own, reduced, known)
    assert shown.startswith(own[: own.index("(P2)")]) and shown.count("](../theory/") == 2
    assert site.cites(measure) and site.cites(reduced) and not site.cites(site.DOCS / "questions.md")
