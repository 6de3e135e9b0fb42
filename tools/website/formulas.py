"""Formulas as MathML, made when the site is built: browsers draw it themselves, without script and network."""

from __future__ import annotations

from html import escape
from typing import Any

from latex2mathml.converter import convert


def inline(writer: Any, node: Any) -> None:
    """A formula in a line."""
    writer.body.append(f'<span class="math">{mathml(node.astext(), "inline")}</span>')
    _skip()


def displayed(writer: Any, node: Any) -> None:
    """A formula of its own; one wider than the page scrolls."""
    writer.body.append(f'<div class="math">{mathml(node.astext(), "block")}</div>\n')
    _skip()


def mathml(formula: str, display: str) -> str:
    """One formula; its LaTeX stands in `alttext` for those who hear or copy it."""
    # The converter knows this environment by its other name.
    known = formula.strip().replace("{aligned}", "{align*}")
    made: str = convert(known, display=display)
    # Brackets of matrices are borders: without a font for mathematics a bracket stays as small as a letter.
    made = made.replace("<mo>&#x0005B;</mo><mtable>", '<mrow class="bracket"><mtable>')
    made = made.replace("</mtable><mo>&#x0005D;</mo>", "</mtable></mrow>")
    return made.replace("<math ", f'<math alttext="{escape(formula.strip(), quote=True)}" ', 1)


def _skip() -> None:
    from docutils.nodes import SkipNode

    raise SkipNode


def setup(app: Any) -> dict[str, bool]:
    """What Sphinx requires of an extension."""
    app.add_html_math_renderer("mathml", (inline, None), (displayed, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
