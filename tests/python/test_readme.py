"""The front page and the pages of docs/: code runs and prints the output shown, generated parts are current."""

import importlib.util
import inspect
import json
import re
import shlex
import shutil
import sys
import webbrowser
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import paper_runs
import pytest
from thorough import either

import partita as pt
from partita.cli import main
from partita.comparison import bench
from partita.comparison.table import COLUMNS
from partita.options import FORMULATIONS, METHODS

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
NAMES = [str(page.relative_to(ROOT)) for page in PAGES]
PYTHON = re.compile(r"^```python\n(.*?)^```\n(?:```output\n(.*?)^```\n)?", flags=re.DOTALL | re.MULTILINE)
TOML = re.compile(r"^```toml\n(.*?)^```\n", flags=re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\]\(([^)#:]+)(?:#[^)]*)?\)")


def text_of(page: Path) -> str:
    return page.read_text("utf-8")


def tool(name: str = "docs", folder: str = "tools") -> ModuleType:
    """A file of tools/ or examples/, which are no part of the package."""
    found = importlib.util.spec_from_file_location(f"{name}_tool", ROOT / folder / f"{name}.py")
    assert found is not None and found.loader is not None
    module = importlib.util.module_from_spec(found)
    sys.modules[found.name] = module  # where its dataclasses look for their names
    found.loader.exec_module(module)
    return module


@pytest.mark.parametrize("page", [page for page in PAGES if PYTHON.search(text_of(page))], ids=lambda p: p.name)
def test_blocks_run(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """All Python blocks of a page, in order, in an empty folder; an `output` block behind one is what it prints."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": page.stem}
    for code, printed in PYTHON.findall(text_of(page)):
        capsys.readouterr()
        exec(compile(code, str(page), "exec"), names)
        if printed:
            assert [line.rstrip() for line in capsys.readouterr().out.splitlines()] == printed.splitlines()


def test_front_page_shows_python() -> None:
    assert PYTHON.search(text_of(ROOT / "README.md"))


def test_front_page_shows_what_the_demo_says_of_reactions() -> None:
    shown = tool("demo", "examples").certificate(pt.catalogue.entry("four-bar").simulate())[-1]
    assert shown.startswith("  reactions") and shown in text_of(ROOT / "README.md").splitlines()


def test_front_page_shows_what_was_measured_beside_other_programs() -> None:
    """Each row is a row of the page that says how; none of its programs is left out."""

    def rows(text: str) -> list[list[str]]:
        table = re.search(r"^\|.*closure error \[m\] \|.*\n\|[-|]*\n((?:\|.*\n)*)", text, flags=re.MULTILINE)
        assert table is not None
        return [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in table[1].splitlines()]

    there = rows(text_of(ROOT / "docs" / "others.md"))
    (bennett,) = (i for i, row in enumerate(there) if row[0] == "Bennett")
    measured = [row[1:5] + row[-1:] for row in there[:bennett]]
    shown = rows(text_of(ROOT / "README.md"))
    assert all(row in measured for row in shown), [row for row in shown if row not in measured]
    assert {row[0] for row in shown} == {row[0] for row in measured}


def test_what_is_said_to_be_lacking_is_lacking() -> None:
    """The table of what Partita lacks names nothing that another page measures, and no option is offered that always
    fails."""
    offers = re.search(
        r"^\| offers \| lacks \|\n\|[-|]*\n((?:\|.*\n)*)", text_of(ROOT / "docs" / "others.md"), re.MULTILINE
    )
    assert offers is not None
    lacks = [row.strip("|").split("|")[1] for row in offers[1].splitlines()]
    assert "## Many at once" in text_of(ROOT / "docs" / "speed.md") and hasattr(pt.Mechanism, "ensemble")
    assert hasattr(pt.Mechanism, "gradient") and 'method="radau"' in text_of(ROOT / "docs" / "stiff.md")
    assert not [cell for cell in lacks if any(word in cell for word in ("at once", "implicit", "sensitivit"))]
    for function in (pt.Mechanism.simulate, pt.simulate, pt.Mechanism.stepper):
        assert "events" in inspect.signature(function).parameters
    for page in (ROOT / "README.md", ROOT / "docs" / "limits.md", ROOT / "docs" / "words.md"):
        assert "no events" not in text_of(page).lower(), page
    assert not {"Close", "SetParameters"} & set(pt.__all__)  # joints that close, other numbers: what events cannot do


@pytest.mark.parametrize("page", ["README.md", "docs/index.md"])
def test_commands_of_the_front_page_run_in_their_order(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Pasted as they are into an empty folder, the comments behind them included."""
    opened: list[str] = []
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(webbrowser, "open", opened.append)
    lines = re.findall(r"^    (\S.*)$", text_of(ROOT / page).partition("## All pages")[0], flags=re.MULTILINE)
    commands = [shlex.split(line, comments=True) for line in lines if line.startswith("partita ")]
    assert len(commands) > 10 and len({words[1] for words in commands}) > 9
    for words in commands:
        assert main(words[1:]) == 0, (words, capsys.readouterr().err)
    assert {"four-bar.html", "squeezer.html", "my.toml", "out.nc", "out.png"} <= {
        path.name for path in tmp_path.iterdir()
    }
    assert len(opened) == 1


def test_what_is_not_published_is_marked() -> None:
    """Where a page installs by the name alone it says that this is for later; no address is given that is not there."""
    for path in PAGES:
        text = " ".join(text_of(path).split())
        for found in re.finditer(r"pip install '?partita(?![\[\w-])", text):
            near = text[max(0, found.start() - 400) : found.end() + 400]
            assert "after release" in near.lower() or path.name in ("dependencies.md",), (path.name, near)
    assert not re.search(r"^(urls|\[project\.urls\])", text_of(ROOT / "pyproject.toml"), flags=re.MULTILINE)
    made = [line.split()[1] for line in re.findall(r"^    (make .*)$", text_of(ROOT / "README.md"), re.MULTILINE)]
    targets = re.findall(r"^([\w-]+):", text_of(ROOT / "Makefile"), flags=re.MULTILINE)
    assert made == ["demo", "test"] and set(made) <= set(targets)


NUMBERS = {8: "eight", 9: "nine", 10: "ten", 11: "eleven", 12: "twelve", 13: "thirteen"}


def test_numbers_in_words_are_those_of_the_pages_they_lead_to() -> None:
    """How many mechanisms are compared, how many computations illustrate the claims, which methods there are."""
    docs = ROOT / "docs"
    front, limits, index = (text_of(page) for page in (ROOT / "README.md", docs / "limits.md", docs / "index.md"))
    for text in (front, limits):
        ((explicit, implicit),) = re.findall(r"Methods are explicit \(([^)]*)\) or implicit \(([^)]*)\)", text)
        assert sorted(f"{explicit}, {implicit}".lower().split(", ")) == sorted(METHODS)
    compared = NUMBERS[text_of(docs / "compare.md").count("<!-- measured ")]
    for page in (ROOT / "README.md", *(docs / f"{name}.md" for name in ("formulations", "index", "questions"))):
        assert re.search(rf"{compared}\s+mechanisms", text_of(page)), page.name
    computed = NUMBERS[len(set(re.findall(r"\]\(paper/[a-z_]+\.png\)", text_of(docs / "paper.md"))))]
    assert (
        f"{computed} computations" in index and f"{computed} small computations" in text_of(docs / "paper.md").lower()
    )


@pytest.mark.parametrize("page", [page for page in PAGES if TOML.search(text_of(page))], ids=lambda p: p.name)
def test_model_files_run(page: Path, tmp_path: Path) -> None:
    for number, content in enumerate(TOML.findall(text_of(page))):
        path = tmp_path / f"{number}.toml"
        path.write_text(content, encoding="utf-8")
        assert pt.load(path).simulate(0.5).success


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_links_lead_somewhere(page: Path) -> None:
    missing = [link for link in LINK.findall(text_of(page)) if not source_of(page, link).exists()]
    assert not missing


def source_of(page: Path, link: str) -> Path:
    """The file that a link leads to; for a figure of docs/, which is drawn when the pages are rendered, its script."""
    if figure := re.fullmatch(r"paper/(\w+)\.png", link):
        return ROOT / "examples" / "paper" / f"{figure[1]}.py"
    if (figure := re.fullmatch(r"compare/([\w-]+)\.png", link)) and figure[1] in pt.catalogue.names():
        return ROOT / "tools" / "compare_page.py"
    if re.fullmatch(r"maps/([\w-]+)\.png", link):
        return ROOT / "tools" / "maps_page.py"
    return page.parent / link


def test_generated_parts_are_current() -> None:
    """Where this fails: `.venv/bin/python tools/docs.py --write`."""
    module = tool()
    stale = [page.name for page in module.pages() if module.current(page) != text_of(page)]
    assert not stale


@cache
def cells_of(path: Path) -> list[Any]:
    """The cells of a notebook, run once for its page and for what is asked of them."""
    return list(tool().scripts(ROOT / "tools", "website.notebooks").run(path))


@pytest.fixture(scope="module")
def compared() -> Iterator[Callable[[str], Any]]:
    """The comparisons of the page, each made once, and each run too: nothing here asks for times."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bench, "_REPEATS", 1)
        patch.setattr(bench, "_DEAR", 0.0)
        tables: dict[str, Any] = tool("compare_page").TABLES
        yield cache(lambda name: replace(tables[name], duration=SHORTER.get(name, tables[name].duration)).compare())


OVERCONSTRAINED = ("bennett", "bricard", "exechon-like", "scissor-lift")
TABLES = ("four-bar", "reference-four-bar", "rod-pendulum", "three-rrr", "rssr", "n-four-bar", "andrews-squeezer",
          *OVERCONSTRAINED, "delta")  # fmt: skip
SHORTER: dict[str, float] = either({"n-four-bar": 2.0}, {})
"""Seconds of what takes longest; the forty loops are in line twice in two seconds."""


@pytest.mark.parametrize("name", TABLES)
def test_tables_of_the_comparison_are_current(name: str, compared: Callable[[str], Any]) -> None:
    """Rows, columns and endings, not costs. Where this fails: `make compare-docs`, then read the page again."""
    module = tool("compare_page")
    assert module.tables().keys() == set(module.TABLES) == set(TABLES)
    shown = module.outline(module.tables()[name])
    assert shown["columns"] == list(COLUMNS) and len(shown["rows"]) > len(FORMULATIONS)
    if name in SHORTER:
        shown["caption"] = re.sub(r": [\d.]+ s,", f": {SHORTER[name]:g} s,", shown["caption"])
    assert module.outline(str(compared(name))) == shown


def test_sentences_on_overconstrained_loops_are_true(compared: Callable[[str], Any]) -> None:
    """What docs/compare.md says below its last five tables."""
    redundant = {name: compared(name).reference.summary for name in (*OVERCONSTRAINED, "delta")}
    assert [x["joint_rows"] - x["joint_rank"] for x in redundant.values()] == [3, 1, 2, 12, 0]
    assert redundant["delta"]["mobility"] == 9 and len(pt.catalogue.entry("delta").truth.idle) == 6
    for name in redundant:
        rows = compared(name).rows
        assert all(row.finished for row in rows if row.status not in ("needs tangent", "singular")), name
        assert max(row.acceleration for row in rows if row.acceleration is not None) < 1e-12, name
        assert all(row.acceleration is not None for row in rows if row.finished), name
    assert [row.name for name in redundant for row in compared(name).rows if row.status == "singular"] == [
        "projective: individual"
    ]
    refused = compared("delta").row("projective: individual")
    assert refused.message.count("elbow") == 9
    assert compared("reference-four-bar").row("explicit-closing").status == "not applicable"

    def row(table: str, name: str) -> Any:
        return compared(table).row(name)

    for name in ("bennett", "bricard"):
        (block,) = pt.catalogue.load(name).assemblies().blocks
        assert block.startswith("implicit block")
        assert row(name, "explicit-closing").newton_iterations > 0
    assert row("scissor-lift", "explicit-closing").newton_iterations == 0 < row("scissor-lift", "wehage-haug").steps
    assert row("exechon-like", "explicit-closing").sigma < 0.01 < 0.5 < row("exechon-like", "projective").sigma
    lowest = min(row("delta", name).sigma for name in ("svd", "qr", "zero-eigenvalue", "liang-lance"))
    assert lowest < 0.1 < row("delta", "projective").sigma


def test_sentences_of_the_comparison_are_true(compared: Callable[[str], Any]) -> None:
    """What docs/compare.md says of its tables, but for times."""

    def row(table: str, name: str) -> Any:
        return compared(table).row(name)

    unit_free = [f"projective{rule}" for rule in ("", ": greedy", ": individual", ": normalised-determinant")]
    for table in ("four-bar", "reference-four-bar", "rod-pendulum"):  # one rule where k = 1
        assert len({(row(table, n).evaluations, row(table, n).error, row(table, n).sigma) for n in unit_free}) == 1
    errors = [x.error for x in compared("four-bar").rows if x.error is not None and x.formulation != "baumgarte"]
    assert min(errors) > 1e-5 and max(errors) < 1e-3
    assert row("four-bar", "projective").switches == 0 < row("four-bar", "projective: determinant").switches
    assert row("four-bar", "baumgarte").closure > 1e4 * row("four-bar", "projective").closure

    best, angle = row("reference-four-bar", "projective"), row("reference-four-bar", "projective: complete-pivoting")
    assert best.switches > 0 == angle.switches and angle.sigma < best.sigma and angle.steps < best.steps
    assert 0.1 < angle.error / best.error < 10.0
    for table in ("reference-four-bar", "rod-pendulum", "three-rrr"):
        assert row(table, "fixed").status == "singular"
    assert row("rod-pendulum", "projective: determinant").switches == 0 < row("rod-pendulum", "projective").switches
    assert row("rod-pendulum", "projective: determinant").sigma == pytest.approx(0.5)
    rules = {name: row("three-rrr", name).evaluations for name in unit_free}
    assert len(set(rules.values())) > 1

    assert not row("rssr", "projective: individual").finished
    assert all(row("rssr", f"projective{rule}").finished for rule in ("", ": greedy", ": normalised-determinant"))
    for table in TABLES:
        assert row(table, "gram-schmidt: each step").sqrt_mu == pytest.approx(1.0, abs=1e-9)
        for plain in ("svd: each step", "qr: each step", "zero-eigenvalue: each step"):
            assert row(table, plain).sqrt_mu < 0.9 and row(table, plain).renewals > row(table, plain).steps

    chain = {x.name: x for x in compared("n-four-bar").rows}
    assert {name: x.status for name, x in chain.items() if not x.finished} == {
        "user-tangent": "needs tangent",
        "baumgarte": "needs baumgarte",
    }
    assert (
        chain["projective"].condition > 1e3 and chain["projective: complete-pivoting"].sigma < chain["projective"].sigma
    )
    squeezer = {x.name: x for x in compared("andrews-squeezer").rows}
    assert squeezer["projective: determinant"].sigma < 0.6 * squeezer["projective"].sigma
    assert squeezer["wehage-haug"].error > 2.0 * squeezer["projective"].error
    assert 1.2 < squeezer["multipliers"].evaluations / squeezer["projective"].evaluations < 1.6
    assert squeezer["multipliers"].error < 0.2 * squeezer["projective"].error


def test_front_page_has_rows_of_the_comparison() -> None:
    """Where this fails: `make compare-docs`."""
    module = tool("compare_page")
    assert module.front() == text_of(ROOT / "README.md") and module.EXCERPT.search(module.front())


def test_site_is_put_together(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The figures of the paper are those that its own tests draw, once for all."""
    module = tool()
    own = module.scripts

    def scripts(folder: Path, name: str) -> Any:
        def main(short: bool, into: Path) -> None:
            paper_runs.numbers(name)
            into.mkdir(parents=True, exist_ok=True)
            shutil.copy(paper_runs.folder() / f"{name}.png", into)

        return SimpleNamespace(main=main) if folder == module.PAPER else own(folder, name)

    monkeypatch.setattr(module, "scripts", scripts)
    with monkeypatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("notebooks"))
        cells = {path: cells_of(path) for path in NOTEBOOKS}
    monkeypatch.setattr(own(module.TOOLS, "website.notebooks"), "run", cells.__getitem__)
    shown = ("four-bar", "bennett")
    module.stage(tmp_path, short=True, only=shown)
    for name in shown:  # both cranks make a turn
        page = text_of(tmp_path / "gallery" / f"{name}.md")
        assert "quality of the choice over the first turn of A:" in page
        assert f"](quality/{name}.png)" in page and (tmp_path / "gallery" / "quality" / f"{name}.png").is_file()
    written = {path.relative_to(tmp_path).with_suffix("").as_posix() for path in tmp_path.rglob("*.md")}
    listed = [page for text in map(text_of, tmp_path.rglob("*.md")) for page in listed_pages(text)]
    outline = module.scripts(module.TOOLS, "website.outline")
    in_sidebar = {page for pages in outline.PARTS.values() for page in pages}
    assert in_sidebar <= written and in_sidebar <= set(listed)
    decisions = {page for page in written if page.startswith("decisions/0")}
    # of each page of the reference those of its names, listed there
    named = {page for page in written if page.startswith("reference/") and page.count("/") == 2}
    assert written == {"index"} | in_sidebar | decisions | named | {f"gallery/{name}" for name in shown}
    assert {page.rpartition("/")[2] for page in decisions} | set(shown) <= set(listed)
    assert all(any(page.endswith(entry) for entry in listed) for page in named)
    for page in tmp_path.rglob("*.md"):
        for link in LINK.findall(text_of(page)):
            assert (page.parent / link).exists(), (page.name, link)
        for link in re.findall(r'(?:src|href)="\.\./(live|files)/([^"#?]+)["#?]', text_of(page)):
            assert tmp_path.joinpath("_extra", *link).exists(), link
    animated = {path.stem for path in (tmp_path / "_extra" / "live").iterdir()}
    guide = {page.replace("/", "-") for page in in_sidebar if page.startswith("guide/")}
    assert animated == {*shown, "index", "playground", "holding", *guide}
    assert not any("<!-- live" in text_of(p) for p in tmp_path.rglob("*.md"))
    assert len(list((tmp_path / "notebooks").glob("*.svg"))) >= len(NOTEBOOKS)


def listed_pages(text: str) -> list[str]:
    """Entries of the tables of contents of a page."""
    blocks = re.findall(r"^```\{toctree\}\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)
    return [line for block in blocks for line in block.splitlines() if line and not line.startswith(":")]


def test_reference_has_every_public_name() -> None:
    """What `partita` and its rooms offer in `__all__`, each on one page of the reference."""
    outline = tool().scripts(ROOT / "tools", "website.outline")
    found = tool().scripts(ROOT / "tools", "website.stage").found
    there = [found(name) for _, _, names in outline.REFERENCE.values() for name in names]
    assert len({id(each) for each in there}) == len(there)
    rooms = (pt, pt.results, pt.analyses, pt.partition, pt.catalogue, pt.comparison, pt.io, pt.plots, pt.viewer)
    known = {"partita.errors", "partita.units"}  # pages made of whole modules
    for room in rooms:
        for name in room.__all__:
            each = getattr(room, name)
            if isinstance(each, type) or callable(each):
                assert any(each is other for other in there) or each.__module__ in known or name in HELPERS, name


HELPERS = {"compare_mechanism", "figure_path", "save_figure"}  # what other rooms of the package use
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In an empty folder, from top to bottom; they are kept without outputs, and show something."""
    monkeypatch.chdir(tmp_path)
    stored = [cell for cell in json.loads(text_of(path))["cells"] if cell["cell_type"] == "code"]
    assert not any(cell["outputs"] or cell["execution_count"] for cell in stored)
    cells = cells_of(path)
    code = [cell for cell in cells if cell.kind == "code"]
    assert len(code) == len(stored) and sum(bool(c.printed or c.figures) or c.value is not None for c in code) > 2
    assert any(cell.figures or hasattr(cell.value, "savefig") for cell in code)


def test_broken_links_are_found(tmp_path: Path) -> None:
    links = tool().scripts(ROOT / "tools", "website.links")
    (tmp_path / "a.html").write_text(
        '<h1 id="top"></h1><a href="b.html#there"></a><a href="#top"></a><a href="c.html"></a>'
        '<a href="b.html#gone"></a><iframe src="live/c.html#play"></iframe><a href="b.html#play"></a>'
        '<a href="https://example.org"></a><script src="https://example.org/x.js"></script>',
        encoding="utf-8",
    )
    (tmp_path / "b.html").write_text('<p id="there"></p>', encoding="utf-8")
    (tmp_path / "live").mkdir()
    (tmp_path / "live" / "c.html").write_text("<p></p>", encoding="utf-8")
    assert links.broken_links(tmp_path) == [
        "a.html: c.html leads nowhere",
        "a.html: b.html#gone names a place that is not there",
        "a.html: b.html#play names a place that is not there",
        "a.html: fetches https://example.org/x.js",
    ]
    assert links.broken_links(tmp_path / "none")
