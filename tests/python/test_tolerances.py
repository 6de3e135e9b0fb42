"""Every threshold has one name, one meaning, a scale and a reason, and stands in docs/tolerances.md."""

from __future__ import annotations

import ast
import re
from collections import Counter

import numpy as np
import pytest
import tolerances


def test_every_constant_says_its_meaning_its_scale_and_its_reason() -> None:
    assert not [f"{c.where}: {c.name}: {c.comment}" for c in tolerances.constants() if c.parts is None]


def test_settings_separate_nothing() -> None:
    """What an algorithm goes on by is compared with nothing; what is compared is a threshold, with a scale."""
    settings = [c.name for c in tolerances.constants() if c.is_setting]
    assert len(settings) > 20
    compared = [found for _, text in tolerances.sources() for found in tolerances.comparisons(settings, text)]
    assert not compared


def test_a_name_stands_for_one_constant() -> None:
    twice = {name for name, count in Counter(c.name for c in tolerances.constants()).items() if count > 1}
    assert not [f"{c.where}: {c.name}" for c in tolerances.constants() if c.name in twice]


def test_a_meaning_has_one_constant() -> None:
    meanings = Counter(c.parts[0].lower() for c in tolerances.constants() if c.parts)
    twice = {meaning for meaning, count in meanings.items() if count > 1}
    assert not [f"{c.where}: {c.name}" for c in tolerances.constants() if c.parts and c.parts[0].lower() in twice]


def test_nothing_is_compared_with_a_bare_literal() -> None:
    found = {where: lines for where, text in tolerances.sources() if (lines := tolerances.bare_literals(text))}
    assert not found, "name them, with meaning, scale and reason; shared ones stand in partita-math/src/tolerance.rs"


def test_nothing_is_compared_with_a_bare_factor() -> None:
    """Arithmetic hides a threshold as well as a bare number does: `now < 0.5 * before`."""
    found = {where: lines for where, text in tolerances.sources() if (lines := tolerances.compared_literals(text))}
    assert not found


def test_what_is_shared_is_used_by_more_than_one_file() -> None:
    shared = [c.name for c in tolerances.constants() if c.where == tolerances.SHARED]
    users = Counter(
        name
        for where, text in tolerances.sources()
        if where != tolerances.SHARED
        for name in shared
        if f"tolerance::{name}" in text
    )
    assert not [name for name in shared if users[name] < 2]


SAME_AS_THE_CORE = {
    "ATOL", "AXES_CROSS", "CLOCK_TICK", "DRAWING_TOLERANCE", "EQUAL", "EQUAL_IN_SIX_DIGITS", "LARGEST_TOLERANCE",
    "LONG_ROUNDING", "NEARLY_ALONG", "NEGLIGIBLE", "ROUNDING", "RTOL", "SUM_ROUNDING",
}  # fmt: skip
"""Names of the core in Python: what is refused there before the core sees it, and what both mean."""


def value_of(constant: tolerances.Constant) -> float:
    """In numbers."""
    text = constant.value.replace("f64::EPSILON", "EPSILON").replace("float(np.finfo(float).eps)", "EPSILON")
    return float(eval(text, {"EPSILON": np.finfo(float).eps}))


def test_the_package_has_the_values_of_the_core() -> None:
    core = {c.name: value_of(c) for c in tolerances.constants() if c.name in SAME_AS_THE_CORE}
    python = {c.name: value_of(c) for c in tolerances.of_package() if c.name in core and c.where.startswith("py/")}
    assert core == python and set(core) == SAME_AS_THE_CORE
    scripts = {c.name: value_of(c) for c in tolerances.of_package() if c.where == "js/tolerance" and c.name in core}
    assert scripts == {name: core[name] for name in ("EQUAL", "EQUAL_IN_SIX_DIGITS", "NEGLIGIBLE")}


def test_every_threshold_of_the_package_says_its_meaning_its_scale_and_its_reason() -> None:
    found = tolerances.of_package()
    assert len(found) > 100
    assert not [f"{c.where}: {c.name}: {c.comment}" for c in found if c.parts is None]


@pytest.mark.parametrize("language", tolerances.LANGUAGES)
def test_a_name_and_a_meaning_of_the_package_stand_for_one_constant(language: str) -> None:
    found = [c for c in tolerances.of_package() if c.where.startswith(f"{language}/")]
    names = Counter(c.name.lstrip("_") for c in found)
    meanings = Counter(c.parts[0].lower() for c in found if c.parts)
    assert not [name for name, count in (*names.items(), *meanings.items()) if count > 1]


def test_the_package_compares_with_nothing_that_has_no_name() -> None:
    python = {where: lines for where, tree in tolerances.modules() if (lines := tolerances.nameless(tree))}
    scripts = {where: lines for where, text in tolerances.scripts() if (lines := tolerances.nameless_in_script(text))}
    assert not python, "name them, with meaning, scale and reason; shared ones stand in partita/tolerance.py"
    assert not scripts, "name them, with meaning, scale and reason; shared ones stand in partita/tolerance.js"


def test_what_modules_share_is_used_by_more_than_one() -> None:
    for language, texts in (
        ("py", [(where, ast.unparse(tree)) for where, tree in tolerances.modules()]),
        ("js", list(tolerances.scripts())),
    ):
        shared = [c.name for c in tolerances.of_package() if c.where == f"{language}/tolerance"]
        users = {
            name: [where for where, text in texts if where != "tolerance" and re.search(rf"\b{name}\b", text)]
            for name in shared
        }
        assert shared and not [name for name in shared if len(users[name]) < 2], language


def test_the_rules_find_what_they_look_for() -> None:
    text = '/// Largest error. Scale: m. Reason: a guess.\nconst WORST: f64 = 1e-3;\nif x < 1e-9 { "1e-4" }'
    assert tolerances.bare_literals(text) == ['if x < 1e-9 { "" }']
    assert tolerances.bare_literals("x.max(0.05) // 1e-3") == ["x.max(0.05)"]
    assert tolerances.bare_literals("const RULE: Rule = Rule::new(30, 1e4);") == [
        "const RULE: Rule = Rule::new(30, 1e4);"
    ]
    assert tolerances.compared_literals("if now < 0.5 * before && x > 1.0 { 0.3 }") == ["if now < 0.5 * before"]
    (found,) = tolerances.in_text("a", text)
    assert (found.name, found.value, found.parts) == ("WORST", "1e-3", ("Largest error.", "m", "a guess"))
    assert not found.is_setting
    (step,) = tolerances.in_text("a", "/// A step. Unit: s. Reason: short.\nconst STEP: f64 = 1e-3;")
    assert step.is_setting
    assert tolerances.comparisons(["STEP"], "if t > STEP * h && x.len() { STEP } // STEP < 1") == ["if t > STEP * h"]
    assert tolerances.comparisons(["STEP"], "let f: Vec<f64> = x.map(|x| x -> STEP); i < STEP.len()") == []
    assert next(tolerances.in_text("a", "/// Largest error.\nconst WORST: f64 = 1e-3;")).parts is None


def test_the_rules_find_what_they_look_for_in_the_package() -> None:
    def found(text: str) -> list[str]:
        return tolerances.nameless(ast.parse(text))

    assert found("def f(x):\n    return x < 0.5 * size(2.0)") == ["2: 0.5"]
    assert found("if abs(x - 2.5) > LEAST: pass") == ["1: 2.5"]
    assert found("if max(x, 0.02 * y) >= z: pass") == ["1: 0.02"]
    assert found("def f(x):\n    return g(x, 1e-9)") == ["2: 1e-09"]
    assert not found("LEAST = 1e-9\nx = 0.5 * LEAST < 1.0 or x > 0.0 or len(x) < 8")
    assert not found("def f(x, rtol=1e-8, *, atol=1e-10):\n    return x == 0.5")
    assert not found("class A:\n    tolerance: float = 1e-12")
    assert tolerances.nameless_in_script('a < 1e-9; // 1e-9\nb("1e-9"); c(0.001)\nconst LEAST = 1e-9;') == [
        "a < 1e-9;",
        'b(""); c(0.001)',
    ]
    (one,) = tolerances.of_script("a", "// Small. Scale: m. Reason: a guess.\nconst LEAST = 1e-9;\nconst MANY = 3;")
    assert (one.name, one.parts) == ("LEAST", ("Small.", "m", "a guess"))
