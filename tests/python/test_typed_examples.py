"""mypy, strict, accepts every example of the pages and of the docstrings: what is documented has the types it is shown
with."""

from __future__ import annotations

import ast
import doctest
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("mypy")

ROOT = Path(__file__).parents[2]
PYTHON = re.compile(r"^```python\n(.*?)^```\n", flags=re.DOTALL | re.MULTILINE)

WRONG = """import partita as pt

m = pt.Mechanism("m", gravity="-z")
rod = m.add_rod("rod", start=(0, 0, 0), end=("1 m", 0, 0), mass=[1.0])
m.add_revolute("A", m.ground, 3, point=rod.at((0, 0, 0)))
m.simulate(duration=None)
"""
"""Three mistakes, in lines 4 to 6."""


def examples() -> Iterator[tuple[str, str]]:
    """Name and source of each page, and of each docstring, with examples."""
    for page in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        if blocks := PYTHON.findall(page.read_text("utf-8")):
            yield f"page_{page.relative_to(ROOT).with_suffix('')}", "\n".join(blocks)
    parser = doctest.DocTestParser()
    package = ROOT / "python" / "partita"
    for path in sorted(package.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if not isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
                continue
            every = parser.get_examples(ast.get_docstring(node) or "")
            found = [example for example in every if doctest.SKIP not in example.options]
            if found:
                name = f"doc_{path.relative_to(package).with_suffix('')}_{getattr(node, 'name', 'module')}"
                yield f"{name}_{getattr(node, 'lineno', 0)}", "".join(example.source for example in found)


def checked(folder: Path) -> list[str]:
    """Lines that mypy prints about the files of a folder. Functions of the examples need no annotations; their bodies
    are checked."""
    command = [sys.executable, "-m", "mypy", "--config-file", str(ROOT / "pyproject.toml"), "--allow-untyped-defs"]
    command += ["--explicit-package-bases", "--no-error-summary", *map(str, sorted(folder.glob("*.py")))]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert not done.stderr, done.stderr
    return [re.sub(r"^.*/(?=\w+\.py:\d)", "", line) for line in done.stdout.splitlines()]


def test_documented_examples_are_typed(tmp_path: Path) -> None:
    wanted = dict(examples())
    assert len(wanted) > 150
    for name, source in wanted.items():
        (tmp_path / (re.sub(r"\W", "_", name) + ".py")).write_text(source, "utf-8")
    (tmp_path / "wrong.py").write_text(WRONG, "utf-8")
    lines = checked(tmp_path)
    own = {line.split(": ")[0] for line in lines if line.startswith("wrong.py")}
    assert own == {f"wrong.py:{n}" for n in (4, 5, 6)}
    assert not [line for line in lines if not line.startswith("wrong.py")]
