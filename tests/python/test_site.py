"""The inspection of pages of the site finds what is wrong with them; `make docs` inspects all of them."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import chromium
import pytest
from catalogue_runs import run_of

from partita import viewer

sys.path.insert(0, str(Path(__file__).parents[2] / "tools"))
from website import seen, stage, texts

pytestmark = pytest.mark.skipif(chromium.PROGRAM is None, reason="no Chromium is installed to open pages in")

LONG = "word " * 60
TOWER = f'<td style="max-width: 20px; overflow-wrap: anywhere">{LONG}</td>'
NARROW = "<td>a sentence of more than forty letters in one cell</td>"
FAULTS = {
    '<div style="width: 900px">wide</div>': "px wide on a screen of 390",
    f'<table><tr><td style="white-space: nowrap">{LONG}</td></tr></table>': "is cut at the right",
    f'<div style="overflow: hidden"><p style="white-space: nowrap">{LONG}</p></div>': "hides",
    f'<div style="overflow: auto"><table><tr>{TOWER}</tr></table></div>': "px high",
    f'<table style="width: 70px; table-layout: fixed"><tr>{NARROW}</tr></table>': "a column of words",
    "<table class='docutils'><tr><td>5.65 ms</td></tr></table>": "may be parted between two lines",
    "<table class='docutils' style='width: 90px; table-layout: fixed'><tr><td style='overflow-wrap: anywhere'>"
    "<code>a ContradictionError</code></td></tr></table>": '"ContradictionError" is broken within itself',
    "<table class='docutils'><tr><td>in system/src/saddle.rs</td></tr></table>": '"system/src/saddle.rs" is one word',
    "<dd>Alias for field number 0</dd>": "a field without words",
    '<span class="math">\\frac12</span>': "is no drawn formula",
    '<span class="math"><math><merror><mtext>?</mtext></merror></math></span>': "has an error in it",
    "<p>the angle $$\\mathbf x$$</p>": "raw LaTeX",
    '<div class="highlight-python"><pre>x = 1</pre></div>': "no button to copy",
    "<section><h2>Nothing</h2></section>": "nothing under the heading",
    '<p style="color: #aaa">pale</p>': "has a contrast of",
    '<img src="none.png">': "is not there",
}
SOUND = """<section><h2>Sound</h2><p>Words.</p>
<div style="overflow-x: auto"><table><tr><td style="white-space: nowrap">{long}</td></tr></table></div>
<table class="docutils"><tr><td>system/<wbr>src/<wbr>full/<wbr>saddle.rs; m/rad/s</td></tr></table>
<p><span class="math"><math><mi>x</mi></math></span></p></section>"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium.Chromium() as opened:
        yield opened


def console(browser: Any, folder: Path, body: str, screen: tuple[int, int, bool] = chromium.PHONE) -> list[str]:
    page = folder / "page.html"
    head = '<!doctype html><meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>page</title>'
    page.write_text(f'{head}<body style="background: #fff; color: #000"><article>{body}</article>', "utf-8")
    browser.open(page, screen)
    return [str(word) for word in browser.value(seen.QUESTIONS)]


def test_each_fault_is_found_and_none_where_none_is(browser: Any, tmp_path: Path) -> None:
    assert console(browser, tmp_path, SOUND.format(long=LONG)) == []
    for body, wanted in FAULTS.items():
        found = console(browser, tmp_path, body)
        assert any(wanted in word for word in found), (body, found)


def test_an_example_is_seen_whole_on_a_wide_screen_and_scrolls_on_a_phone(browser: Any, tmp_path: Path) -> None:
    """By the style of the site; tables of plain text keep their columns and scroll everywhere."""
    style = (Path(seen.__file__).with_name("partita.css")).read_text("utf-8")
    pre = f'<pre style="overflow: auto">{LONG}</pre>'
    for kind, whole in (("python", True), ("default", True), ("output", True), ("text", False)):
        body = f'<div class="highlight-{kind}"><button class="copybtn"></button>{pre}</div>'
        assert console(browser, tmp_path, f"<style>{style}</style>{body}") == []
        scrolls = "(() => { const e = document.querySelector('pre'); return e.scrollWidth > e.clientWidth + 1; })()"
        assert browser.value(scrolls)
        assert console(browser, tmp_path, f"<style>{style}</style>{body}", chromium.DESKTOP) == []
        assert browser.value(scrolls) != whole
        if whole:
            found = console(browser, tmp_path, body, chromium.DESKTOP)
            assert any("px out of sight" in word for word in found)


def test_a_name_in_a_table_is_not_broken_on_a_phone(browser: Any, tmp_path: Path) -> None:
    """By the style of the site: in any column, the first as well; beside it a sentence keeps its width."""
    style = (Path(seen.__file__).with_name("partita.css")).read_text("utf-8")
    cells = "<td>{0} (<code>ContradictionError</code>)</td><td>{0}</td><td>{0}</td>".format("words " * 40)
    first = "<td><code>EQUAL_IN_SIX_DIGITS</code></td><td>1e-6</td>"
    table = f'<table class="docutils"><tr>{cells}</tr><tr>{first}</tr></table>'
    body = f'<style>{style} code {{ overflow-wrap: anywhere }}</style><div class="table-wrapper">{table}</div>'
    assert console(browser, tmp_path, body) == []


def test_a_page_with_an_animation_in_it_opens_at_its_title(browser: Any, tmp_path: Path) -> None:
    """A browser may scroll to the element that an address names, and the pages around its page with it: no element of
    an animated page has the name by which it is told to move."""
    head = '<!doctype html><link rel="icon" href="data:,"><h1 style="height: 500px">Title</h1>'
    inside = '<iframe class="live" src="run.html#play" height="900"></iframe>'
    page = viewer.write_html(run_of("four-bar"), tmp_path / "run.html")
    assert 'id="play"' not in page.read_text("utf-8")
    (tmp_path / "index.html").write_text(head + inside, "utf-8")
    (tmp_path / "below.html").write_text(f"{head}{inside}<script>window.scrollTo(0, 300)</script>", "utf-8")
    with seen.served(tmp_path) as address:
        assert seen._live(browser, address, "index.html", chromium) == []
        found = seen._live(browser, address, "below.html", chromium)
        assert found == ["below.html: it opens 300 px below its title"]


def test_a_playground_and_a_moving_mechanism_are_put_where_a_page_asks(browser: Any, tmp_path: Path) -> None:
    marks = {"index": "jansen-pair bare", "try": "four-bar playground"}
    for name, mark in marks.items():
        (tmp_path / f"{name}.md").write_text(f"Before.\n\n<!-- live: {mark} -->\n\nAfter.\n", "utf-8")
    stage.animate(tmp_path)
    for name in marks:
        text = (tmp_path / f"{name}.md").read_text("utf-8")
        assert "<!-- live" not in text and text.startswith("Before.") and text.endswith("After.\n")
        assert ("gallery/index.html" in text) == (name == "index")
        page = '<!doctype html><link rel="icon" href="data:,">' + text
        (tmp_path / "_extra" / f"{name}.html").write_text(page, "utf-8")
    with seen.served(tmp_path / "_extra") as address:
        assert seen._live(browser, address, "index.html", chromium) == []
        assert seen._playground(browser, address, "try.html", chromium) == []


def test_a_site_is_searched_where_it_stands(browser: Any, tmp_path: Path) -> None:
    """A page of results: the first ones in their order, each with its address."""
    links = [f'<li><a href="reference/{page}.html?highlight=x#partita.{page}">{page}</a></li>' for page in "abc"]
    (tmp_path / "search.html").write_text(
        f'<div id="search-results"><p>3 pages found</p><ul>{"".join(links)}</ul></div>', "utf-8"
    )
    with seen.served(tmp_path) as address:
        assert seen.results(browser, address, "x")[0] == "reference/a.html#partita.a"
        reported = seen._search(browser, address, "x", "reference/d.html")
        assert reported and "before reference/d.html" in reported[0]
        assert seen._search(browser, address, "x", "reference/c.html#partita.c") == []


def test_a_search_from_disk_has_the_texts_of_pages(browser: Any, tmp_path: Path) -> None:
    """Pages in pieces, and what a page of results then reads in place of another page; markup stays text."""
    page = (
        '<html><body><nav id="n">elsewhere</nav><article role="main"><h1>Title<a class="headerlink" href="#x">#</a>'
        "</h1>"
        '<section id="x"><p>closed <b>loops</b> &lt;i&gt;</p><img src="a.png"><script>bad()</script></section>'
        '<dl><dt id="partita.f">f</dt><dd>an answer</dd>'
        "<dd><pre><span>m</span><span>.</span><span>add</span></pre></dd>"
        '</dl></article><footer id="f">below</footer></body></html>'
    )
    found = texts.pieces(page)
    assert found == [["", "Title"], ["x", "closed loops <i>"], ["partita.f", "f an answer m.add"]]
    static = tmp_path / "_static"
    static.mkdir()
    (tmp_path / "page.html").write_text(page, "utf-8")
    texts.write(tmp_path)
    script = (Path(texts.__file__).with_name("from_disk.js")).read_text("utf-8")
    (tmp_path / "search.html").write_text(f"<script>{script}</script>", "utf-8")
    browser.open(tmp_path / "search.html")
    read = browser.value("fetch('page.html?highlight=loops#x').then((r) => r.text())")
    parsed = f"new DOMParser().parseFromString({read!r}, 'text/html')"
    assert browser.value(f"{parsed}.querySelector('[role=\"main\"] #x').textContent").strip() == "closed loops <i>"
    assert browser.value(f"{parsed}.querySelectorAll('i, script, img').length") == 0
