"""Docstrings as the pages of the reference show them: sections that say what they mean, types that can be read."""

from __future__ import annotations

import ast
import builtins
import inspect
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import partita as pt

sys.path.insert(0, str(Path(__file__).parents[2] / "tools"))
from website import conf, docstrings, stage
from website.outline import MEMBERS, REFERENCE

KINDS = {name for name in (*vars(pt.errors), *vars(builtins)) if name.endswith(("Error", "Warning", "Interrupted"))}
NAMES = [name for _, _, names in REFERENCE.values() for name in names]


def documented() -> Iterator[tuple[str, str]]:
    """Names of everything on the pages of the reference, each with its docstring."""
    for name in NAMES:
        kind = stage.found(name)
        yield name, inspect.getdoc(kind) or ""
        if isinstance(kind, type):
            for member in dir(kind):
                there = inspect.getattr_static(kind, member)
                if not member.startswith("_") and (isinstance(there, property) or inspect.isfunction(there)):
                    yield f"{name}.{member}", inspect.getdoc(there) or ""


@pytest.mark.parametrize("name", MEMBERS)
def test_every_member_of_a_large_class_has_one_place(name: str) -> None:
    listed = [member for _, _, members in MEMBERS[name].values() for member in members]
    public = {member for member in dir(stage.found(name)) if not member.startswith("_")}
    assert sorted(listed) == sorted(public)


def section(text: str, head: str) -> list[str]:
    """The entries of a section."""
    found = re.search(rf"^{head}:\n((?: .*\n|\n)*(?: .*)?)", text, flags=re.MULTILINE)
    return [line.strip() for line in found[1].splitlines() if line.strip()] if found else []


def test_every_error_has_an_entry_of_its_own() -> None:
    seen = 0
    for name, text in documented():
        entries = section("\n".join(docstrings.sections(text.splitlines())), "Raises")
        assert bool(entries) == bool(section(text, "Raises")), name
        for entry in entries:
            kinds, colon, words = entry.partition(": ")
            assert colon and words and set(kinds.split(", ")) <= KINDS, (name, entry)
            inside = re.findall(r"(?:[.;] |^)([A-Z]\w*(?:Error|Warning)(?:, \w+)*): ", words)
            assert not inside, (name, entry)
            seen += 1
    assert seen > 100


def test_sections_are_made_for_napoleon() -> None:
    text = """Do it.

Attributes:
    A, B: arrays, of which
        A, B: are two.
    only: one.

Raises:
    ArgumentError: too few, or
        too many. UnknownNameError, AssemblyError: no such
        name: none. FileFormatError: bad.

Returns:
    `Thing`: this and that.

>>> 1 * 2
2"""
    comma, colon = f",{docstrings.SPACE}", docstrings.COLON
    found = docstrings.sections(text.splitlines())
    assert [line.strip() for line in found if line.startswith(" ")] == [
        f"A{comma}B: arrays, of which",
        f"A{comma}B: are two.",
        "only: one.",
        "ArgumentError: too few, or too many.",
        "UnknownNameError, AssemblyError: no such name: none.",
        "FileFormatError: bad.",
        f"`Thing`{colon} this and that.",
    ]
    assert [line for line in found if not line.startswith(" ")] == [
        line for line in text.splitlines() if not line.startswith(" ")
    ]
    assert docstrings.restored(found[-4]) == "    `Thing`: this and that."


def test_prose_is_literal_and_names_of_pages_are_links() -> None:
    lines = ["See docs/howto/engineer.md, |Phi| and `a*b`.", ">>> 2 * 3  # docs/robots.md", "6", "", "C*"]
    assert docstrings.plain(lines) == [
        "See :doc:`/howto/engineer`, \\|Phi\\| and `a*b`.", *lines[1:4], "C\\*"
    ]  # fmt: skip
    for name, text in documented():
        assert "docs/" not in re.sub(r":doc:`/[\w/-]+`", "", "\n".join(docstrings.plain(text.splitlines()))), name
        starred = re.findall(
            r"(?<![\w*\\`(])\*[A-Za-z]+\*(?!\w)", re.sub(r"^(>>>|\.\.\.).*", "", text, flags=re.MULTILINE)
        )
        assert not starred, f"{name}: stars are shown as they are: {starred}"


def test_types_of_arrays_are_short() -> None:
    for spelt in (str(NDArray[np.bool_]), "~numpy.ndarray[tuple[~typing.Any, ...], ~numpy.dtype[~numpy.bool]]"):
        assert docstrings.short(f"dict[str, {spelt}] | None") == "dict[str, NDArray[bool]] | None"
    assert docstrings.short("list[int]") == "list[int]"


def test_constructors_for_the_package_alone_are_not_on_the_pages() -> None:
    assert conf.internal(pt.State, inspect.getattr_static(pt.State, "computed"))
    assert not conf.internal(pt.State, inspect.getattr_static(pt.State, "copy"))
    for name in NAMES:
        kind = stage.found(name)
        if isinstance(kind, type):
            shown = "".join(stage.overview(name, kind))
            for member in dir(kind):
                if conf.internal(kind, inspect.getattr_static(kind, member)):
                    assert f"{name}.{member}>" not in shown, (name, member)


def test_every_field_of_a_tuple_has_words_of_its_own() -> None:
    """Python gives each the words "Alias for field number"; a string below the field replaces them."""
    tuples = [kind for kind in map(stage.found, NAMES) if isinstance(kind, type) and hasattr(kind, "_fields")]
    assert len(tuples) >= 3
    for kind in tuples:
        (defined,) = ast.parse(inspect.getsource(kind)).body
        assert isinstance(defined, ast.ClassDef)
        for field, after in zip(defined.body, [*defined.body[1:], None], strict=True):
            if isinstance(field, ast.AnnAssign):
                words = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
                assert words, f"{kind.__name__}: {ast.unparse(field.target)}"


def test_quantities_stay_together_and_paths_may_go_on_below() -> None:
    """In cells of tables; names that an entry of a docstring has together stand side by side everywhere."""
    nodes = pytest.importorskip("docutils.nodes", reason="docutils is pinned for `make docs` alone")
    words, path, names = nodes.Text("5 ms for N = 40"), nodes.Text("a/b/c.rs"), nodes.Text(f"A,{docstrings.SPACE}B")
    dash = nodes.Text(" -- ")
    cell = nodes.entry("", nodes.paragraph("", "", words, nodes.literal("", "", path)))
    page = nodes.section("", nodes.paragraph("", "", names, dash), cell)
    conf.together(None, page)
    assert page[0].astext() == "A, B \N{EN DASH} "
    assert cell.astext() == "5\N{NO-BREAK SPACE}ms for N\N{NO-BREAK SPACE}=\N{NO-BREAK SPACE}40a/<wbr>b/<wbr>c.rs"
