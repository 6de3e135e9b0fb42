"""Which runs a comparison is made of."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from ..errors import ArgumentError
from ..numeric import shown
from ..options import FORMULATIONS, SELECTIONS, one_of

DEFAULT = "projective"
# What runs only with something that no one but the user can know: option of `simulate`, and how to give it.
_NEEDS = {
    "baumgarte": ("baumgarte", "it needs baumgarte=(alpha, beta) [1/s]; no value fits every mechanism"),
    "user-tangent": ("tangent", "it needs tangent=TangentVelocities(...)"),
    "persistence": ("window", "it needs window=, the time [s] over which it looks back"),
}


@dataclass(frozen=True)
class Case:
    """One run: a formulation and, for "projective", the rule that chooses its coordinates."""

    formulation: str
    selection: str | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    missing: str | None = None
    """Why it cannot run: what the user did not give."""

    @property
    def name(self) -> str:
        """What tables call it: the formulation, with its rule unless that is the default."""
        plain = self.selection in (None, SELECTIONS[0])
        return self.formulation if plain else f"{self.formulation}: {self.selection}"


def cases(formulations: Iterable[str] | None, selections: Iterable[str] | None, given: Mapping[str, Any]) -> list[Case]:
    """All wanted runs in the order of the options; `given` are those of "baumgarte", "window", "tangent" that are
    known. Raises `ArgumentError` for an unknown word."""
    found: list[Case] = []
    for formulation in _words("formulations", formulations, FORMULATIONS):
        if formulation == DEFAULT:
            rules = _words("selections", selections, SELECTIONS)
            found += [_case(formulation, rule, rule, given) for rule in rules]
        else:
            found.append(_case(formulation, None, formulation, given))
    return found


def _case(formulation: str, selection: str | None, word: str, given: Mapping[str, Any]) -> Case:
    options = {} if selection is None else {"selection": selection}
    option, why = _NEEDS.get(word, (None, ""))
    if option is None:
        return Case(formulation, selection, options)
    if given.get(option) is None:
        return Case(formulation, selection, options, missing=why)
    return Case(formulation, selection, {**options, option: given[option]})


def _words(what: str, wanted: Iterable[str] | None, known: tuple[str, ...]) -> list[str]:
    """The wanted words, each once; None: all."""
    if wanted is None:
        return list(known)
    if isinstance(wanted, str | bytes) or not isinstance(wanted, Iterable):
        raise ArgumentError(f"{what} must be a list of names such as {[known[0]]}, not {shown(wanted)}", argument=what)
    words = list(dict.fromkeys(one_of(what, word, known) for word in wanted))
    if not words:
        raise ArgumentError(f"{what} is empty; name some of {', '.join(known)}, or leave it out for all", argument=what)
    return words
