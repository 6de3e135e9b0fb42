"""Every threshold of the core has one name, one meaning, a scale and a reason, and stands in docs/tolerances.md."""

from __future__ import annotations

from collections import Counter

import tolerances

from partita.builder import frames, joints, records

FACE = {
    "AXES_CROSS": joints._PARALLEL,
    "EQUAL": frames.ORTHONORMAL,
    "EQUAL_IN_SIX_DIGITS": frames.INERTIA,
    "NEARLY_ALONG": frames.NEARLY_ALONG,
    "DRAWING_TOLERANCE": records.DRAWING_TOLERANCE,
    "LARGEST_TOLERANCE": records.LARGEST_DRAWING_TOLERANCE,
}
"""What the face refuses before the core sees it, by the core's name for it."""


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


def test_the_face_has_the_values_of_the_core() -> None:
    core = {c.name: float(c.value) for c in tolerances.constants() if c.name in FACE}
    assert core == FACE


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
