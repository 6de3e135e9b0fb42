"""The runs of a comparison."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from ..errors import ArgumentError
from ..numeric import is_list, shown
from ..options import CORRECTIONS, FORMULATIONS, SELECTIONS, TANGENTS, one_of

DEFAULT = "projective"
EACH_STEP = "each step"
# Formulations that need data only the user can provide: option of `simulate`, and how to give it.
_NEEDS = {
    "baumgarte": ("baumgarte", "it needs baumgarte=(alpha, beta) [1/s]; no value fits every mechanism"),
    "user-tangent": ("tangent", "it needs tangent=TangentVelocities(...)"),
    "persistence": ("window", "it needs window=, the time [s] over which it looks back"),
}
# Variants of a formulation, as further rows: the suffix of the name, and the option of `simulate`.
_VARIANTS: dict[str, dict[str, dict[str, Any]]] = {
    "wehage-haug": {"complete-pivoting": {"selection": "complete-pivoting"}},
    **{name: {EACH_STEP: {"renew": EACH_STEP}} for name in TANGENTS},
}

_REMOVALS = {"kantorovich": "kantorovich", "mass-orthogonal": "mass-orthogonal", "uncorrected": "none"}
"""The same for corrections of "projective"."""


@dataclass(frozen=True)
class Case:
    """One run: a formulation, and its difference from others of the same."""

    formulation: str
    selection: str | None = None
    """Rule that chooses the coordinates, if one was requested."""
    variant: str | None = None
    """The word after the name of the formulation; None for the plain one."""
    options: Mapping[str, Any] = field(default_factory=dict)
    needs: str | None = None
    """The missing option without which it cannot run."""
    missing: str = ""
    """The same in a sentence."""

    @property
    def name(self) -> str:
        """Its name in tables: the formulation, and its difference from others."""
        return self.formulation if self.variant is None else f"{self.formulation}: {self.variant}"


def cases(
    formulations: Iterable[str] | None,
    selections: Iterable[str] | None,
    given: Mapping[str, Any],
    corrections: Iterable[str] | None = None,
) -> list[Case]:
    """All wanted runs in the order of the options; `given` are those of "baumgarte", "window", "tangent" that are
    known. Names of rows ("svd: each step") serve as formulations. Raises `ArgumentError` for an unknown word."""
    everything = formulations is None
    rules = _words("selections", selections, SELECTIONS)
    usual = CORRECTIONS if everything and selections is None else CORRECTIONS[:1]
    removals = _words("corrections", corrections, CORRECTIONS) if corrections is not None else list(usual)
    found: list[Case] = []
    for word in _words("formulations", formulations, (*FORMULATIONS, *_rows())):
        formulation, _, variant = word.partition(": ")
        if variant:
            found.append(_variant(formulation, variant, given))
            continue
        if formulation == DEFAULT:
            found += [_rule(rule, given) for rule in rules]
            found += [_correction(removal) for removal in removals if removal != CORRECTIONS[0]]
            continue
        found.append(_case(formulation, None, None, {}, formulation, given))
        if everything:
            found += [_variant(formulation, variant, given) for variant in _VARIANTS.get(formulation, ())]
    return list({case.name: case for case in found}.values())


def _rows() -> list[str]:
    """Names of all rows other than plain formulations."""
    mine = [f"{DEFAULT}: {word}" for word in (*SELECTIONS[1:], *_REMOVALS)]
    return [*mine, *(f"{name}: {variant}" for name, words in _VARIANTS.items() for variant in words)]


def _variant(formulation: str, variant: str, given: Mapping[str, Any]) -> Case:
    if formulation == DEFAULT:
        return _correction(_REMOVALS[variant]) if variant in _REMOVALS else _rule(variant, given)
    options = _VARIANTS[formulation][variant]
    return _case(formulation, options.get("selection"), variant, options, formulation, given)


def _rule(rule: str, given: Mapping[str, Any]) -> Case:
    plain = rule == SELECTIONS[0]
    return _case(DEFAULT, rule, None if plain else rule, {"selection": rule}, rule, given)


def _correction(removal: str) -> Case:
    options = {"selection": SELECTIONS[0], "correction": removal}
    variant = next(word for word, named in _REMOVALS.items() if named == removal)
    return Case(DEFAULT, SELECTIONS[0], variant, options)


def _case(
    formulation: str,
    selection: str | None,
    variant: str | None,
    options: Mapping[str, Any],
    word: str,
    given: Mapping[str, Any],
) -> Case:
    option, why = _NEEDS.get(word, (None, ""))
    if option is None:
        return Case(formulation, selection, variant, options)
    if given.get(option) is None:
        return Case(formulation, selection, variant, options, needs=option, missing=why)
    return Case(formulation, selection, variant, {**options, option: given[option]})


def _words(what: str, wanted: Iterable[str] | None, known: tuple[str, ...]) -> list[str]:
    """The selected words, each once; None: all except rows of a formulation."""
    if wanted is None:
        return [word for word in known if ": " not in word]
    if not is_list(wanted):
        raise ArgumentError(f"{what} must be a list of names such as {[known[0]]}, not {shown(wanted)}", argument=what)
    words = list(dict.fromkeys(one_of(what, word, known) for word in wanted))
    if not words:
        raise ArgumentError(f"{what} is empty; name some of {', '.join(known)}, or leave it out for all", argument=what)
    return words
