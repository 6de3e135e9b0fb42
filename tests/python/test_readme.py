"""The front page and the pages of docs/: code runs and prints what stands there, generated parts are current."""

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

import partita as pt
from partita.cli import main
from partita.comparison.table import COLUMNS
from partita.options import FORMULATIONS

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
NAMES = [str(page.relative_to(ROOT)) for page in PAGES]
PYTHON = re.compile(r"^```python\n(.*?)^```\n(?:```output\n(.*?)^```\n)?", flags=re.DOTALL | re.MULTILINE)
TOML = re.compile(r"^```toml\n(.*?)^```\n", flags=re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\]\(([^)#:]+)(?:#[^)]*)?\)")


def text_of(page: Path) -> str:
    return page.read_text("utf-8")


def tool(name: str = "docs") -> ModuleType:
    """A file of tools/, which is no part of the package."""
    pytest.importorskip("markdown2")
    found = importlib.util.spec_from_file_location(f"{name}_tool", ROOT / "tools" / f"{name}.py")
    assert found is not None and found.loader is not None
    module = importlib.util.module_from_spec(found)
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
    return page.parent / link


def test_generated_parts_are_current() -> None:
    """Where this fails: `.venv/bin/python tools/docs.py --write`."""
    module = tool()
    stale = [page.name for page in module.pages() if module.current(page) != text_of(page)]
    assert not stale


@pytest.mark.parametrize("name", ["four-bar", "n-four-bar", "andrews-squeezer"])
def test_tables_of_the_comparison_are_current(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Rows, columns and endings, not costs. Where this fails: `make compare-docs`, then read the page again."""
    module = tool("compare_page")
    assert name in module.TABLES and module.tables().keys() == set(module.TABLES)
    shown = module.outline(module.tables()[name])
    assert shown["columns"] == list(COLUMNS) and len(shown["rows"]) + len(shown["notes"]) > len(FORMULATIONS)
    assert main(["compare", name]) == 0
    assert module.outline(capsys.readouterr().out) == shown


def test_front_page_has_rows_of_the_comparison() -> None:
    """Where this fails: `make compare-docs`."""
    module = tool("compare_page")
    assert module.front() == text_of(ROOT / "README.md") and module.EXCERPT.search(module.front())


def test_pages_render(tmp_path: Path) -> None:
    module = tool()
    module.render(tmp_path, short=True)
    written = {path.relative_to(tmp_path).with_suffix(".md") for path in tmp_path.rglob("*.html")}
    assert written == {page.relative_to(ROOT / "docs") for page in module.pages()}
    for path in tmp_path.rglob("*.html"):
        for link in re.findall(r'href="([^"#:]+)', text_of(path)):
            assert link.split("/")[-2:-1] in (["python"], ["partita_system"]) or (path.parent / link).exists(), link
        for image in re.findall(r'src="([^"]+)', text_of(path)):
            assert (path.parent / image).exists(), image
