"""The tables of docs/paper.md with every equation and claim of the paper: what they name is computed, drawn, tested.

An equation is an expression that vanishes: it is evaluated on three models, one of them driven. An option is run with,
an attribute looked for, a figure is that of a script whose page shows it, a test is one that pytest collects.
"""

import ast
import re
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from paper_runs import ROOT, SCRIPTS

import partita as pt
from partita import instant, partition
from partita.builder.compiled import CompiledModel
from partita.results import Result
from partita.solver import grouped

TITLE = "## Every equation and claim"
WITHIN = 1e-11
"""Of the expressions: round-off of matrices with entries up to some tens and conditions of a hundred."""


def rows(columns: int) -> list[list[str]]:
    """The cells of both tables, those of the equations first; headings left out."""
    section = (ROOT / "docs" / "paper.md").read_text("utf-8").split(TITLE)[1]
    lines = [line for line in section.splitlines() if line.startswith("| ")]
    found = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines]
    return [cells for cells in found if len(cells) == columns and cells[0] not in ("equation", "section")]


EQUATIONS = [row for row in rows(5) if row[0] == "A" or row[0].startswith("(")]
CLAIMS = [row for row in rows(5) if row[0].isdigit()]


def test_every_equation_and_section_has_its_line() -> None:
    numbers = [row[0] for row in EQUATIONS]
    assert [x for x in numbers if x != "A"] == [f"({n})" for n in range(1, 24)] and numbers.count("A") >= 3
    assert sorted({row[0] for row in CLAIMS}) == list("123456")
    assert len(EQUATIONS) + len(CLAIMS) == len(rows(5))


@cache
def instants() -> dict[str, SimpleNamespace]:
    """What the expressions may name, for each model."""
    found = {}
    for name, coordinates in (("reference-four-bar", "relative"), ("reference-four-bar", "absolute"),
                              ("five-bar", "relative")):  # fmt: skip
        entry = pt.catalogue.entry(name)
        m = entry.mechanism()
        if name == "five-bar":  # driven, so that the constraints depend on time
            m.add_drive("A", lambda t: 0.3 * t + 0.1 * t * t)
            start = m.assemble()
        else:
            start = m.convert(entry.initial(m), coordinates)
        model = m.compile(coordinates)
        at = model.at(start.q, start.v)
        found[f"{name}, {coordinates}"] = names_of(at, model.constraints(start.q))
    return found


def names_of(at: instant.Instant, phi: np.ndarray) -> SimpleNamespace:
    """The names of the table for one instant."""
    n, (independent, dependent) = len(at.v), (at.independent, at.dependent)

    def pad(x: np.ndarray) -> np.ndarray:
        whole = np.zeros(n)
        whole[dependent] = x
        return whole

    def blocks(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        corner = np.zeros((len(x), len(y)))
        return np.block([[x, corner], [corner.T, y]])

    # D of an instant has its columns in the order of v, A its rows in that of D
    return SimpleNamespace(at=at, g=partition.geometry(at.M, at.C, independent.tolist()), phi=phi, n=n, m=len(at.a),
                           k=len(independent), I=independent, D=dependent, pad=pad, blocks=blocks, np=np)  # fmt: skip


def test_one_of_the_models_is_driven() -> None:
    (driven,) = [each for name, each in instants().items() if name.startswith("five")]
    assert np.max(np.abs(driven.at.eta)) > 0.1 and driven.k == 1


@pytest.mark.parametrize("row", EQUATIONS, ids=lambda row: f"{row[0]} {row[1]}")
def test_equation_vanishes(row: list[str]) -> None:
    expressions = re.findall(r"`([^`]+)`", row[2])
    assert expressions
    for model, names in instants().items():
        for expression in expressions:
            value = np.asarray(eval(expression, {"__builtins__": {}}, vars(names)))
            assert np.max(np.abs(value), initial=0.0) < WITHIN, (model, expression)


@pytest.mark.parametrize("row", CLAIMS, ids=lambda row: f"{row[0]} {row[1]}")
def test_what_computes_a_claim_exists_and_runs(row: list[str]) -> None:
    words = re.findall(r"`([^`]+)`", row[2])
    assert words
    entry = pt.catalogue.entry("four-bar")
    m = entry.mechanism()
    options: dict[str, Any] = {}
    for word in words:
        if "=" in word:
            key, _, value = word.partition("=")
            options.setdefault(key, []).append(value.strip('"') if '"' in value else float(value))
            continue
        where: Any = pt
        rooms = {"Result": Result, "Instant": instant.Instant, "Geometry": partition.Geometry,
                 "Partition": partition.Partition, "CompiledModel": CompiledModel}  # fmt: skip
        for part in word.split("."):
            known = getattr(where, "__dataclass_fields__", {})
            where = rooms.get(part) or getattr(where, part, known.get(part))
            assert where is not None, word
    for key, values in options.items():
        for value in values:
            others = {"formulation": "svd"} if key == "renew" else {}
            start = m.convert(entry.initial(m), value if key == "coordinates" else "relative")
            assert m.simulate(0.1, initial=start, **grouped({**others, key: value})).success, (key, value)


def test_what_is_drawn_is_on_a_page() -> None:
    drawn = {row[3] for row in (*EQUATIONS, *CLAIMS)} - {"-"}
    pages = "".join((ROOT / "docs" / page).read_text("utf-8") for page in ("paper.md", "geometry.md"))
    for figure in drawn:
        assert (SCRIPTS / f"{figure}.py").is_file() and f"(paper/{figure}.png)" in pages, figure
    scripts = {path.stem for path in SCRIPTS.glob("*.py")} - {"drawing", "reference"}
    assert drawn == scripts, "a script of examples/paper shows nothing that the table lists"


def test_what_is_tested_is_collected() -> None:
    named = {row[4] for row in (*EQUATIONS, *CLAIMS)}
    files = {name.partition(".")[0] for name in named}
    assert all(file.startswith("test_") for file in files)
    collected = {
        f"{file}.{node.name}"
        for file in files
        for node in ast.parse((ROOT / "tests" / "python" / f"{file}.py").read_text("utf-8")).body
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
    }
    assert named <= collected, named - collected
