"""Many errors in one build: each function with an error in it becomes a choice between itself and its spoilt form.

    { body }   ->   { if deliberate(7) { spoilt body } else { body } }

The choice is made by an environment variable when the program runs, so that one build serves all errors. A function
that cannot be written twice (a constant one, or one whose result is a type without a name) is left to a build of its
own.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from formulas_spoilt import Error

VARIABLE = "PARTITA_DELIBERATE_ERROR"
HOME = "crates/partita-math/src/lib.rs"
CHOICE = f"""
/// Whether this error is to be made.
#[doc(hidden)]
pub fn deliberate(number: usize) -> bool {{
    static ASKED: std::sync::OnceLock<usize> = std::sync::OnceLock::new();
    *ASKED.get_or_init(|| std::env::var("{VARIABLE}").ok().and_then(|x| x.parse().ok()).unwrap_or(0)) == number
}}
"""

_TOKEN = re.compile(
    r"""(?P<comment>//[^\n]*|/\*.*?\*/)
      | (?P<raw>b?r(?P<hashes>\#*)".*?"(?P=hashes))
      | (?P<string>b?"(?:[^"\\]|\\.)*")
      | (?P<char>b?'(?:[^'\\]|\\[^u]|\\u\{[^}]*\}|\\x..)')
      | (?P<mark>[{}();\[\]])""",
    re.VERBOSE | re.DOTALL,
)
_FUNCTION = re.compile(r"\bfn\s+\w+")
_CONSTANT = re.compile(r"\bconst\s+(?:unsafe\s+)?fn\b")


@dataclass(frozen=True)
class Body:
    """From the opening brace of a function to behind the closing one."""

    begin: int
    end: int


def bodies(text: str) -> Iterator[Body]:
    """The bodies of all functions of a Rust source that may be run anew, inner ones first."""
    # where the words before a brace begin, and open brackets since the last one, for each block around
    header, deep, plain = [0], [0], text
    open_braces: list[tuple[int, bool]] = []
    for token in _TOKEN.finditer(text):
        if token["mark"] is None:
            if token["comment"] is not None:
                blank = " " * len(token[0])
                plain = plain[: token.start()] + blank + plain[token.end() :]
            continue
        mark = token["mark"]
        if mark in "([":
            deep[-1] += 1
        elif mark in ")]":
            deep[-1] -= 1
        elif mark == "{":
            words = plain[header[-1] : token.start()]
            open_braces.append((token.start(), bool(_FUNCTION.search(words)) and not _CONSTANT.search(words)))
            header.append(token.end())
            deep.append(0)
        elif mark == "}":
            begin, is_function = open_braces.pop()
            header.pop()
            deep.pop()
            header[-1] = token.end()
            if is_function:
                yield Body(begin, token.end())
        elif mark == ";" and deep[-1] == 0:
            header[-1] = token.end()


def around(text: str, error: Error) -> Body | None:
    """The innermost function that contains the text to be replaced; none if it stands elsewhere."""
    begin = text.index(error.old)
    end = begin + len(error.old)
    return next((body for body in bodies(text) if body.begin < begin and end < body.end), None)


def together(text: str, errors: Sequence[tuple[int, Error]], path: str) -> tuple[str, list[tuple[Error, Body]]]:
    """A source with all of these errors to choose from, by number; and those that could be joined, each with its
    function in the new text."""
    joined: dict[Body, list[tuple[int, Error]]] = {}
    for number, error in errors:
        body = around(text, error)
        if body is not None:
            joined.setdefault(body, []).append((number, error))
    # of functions within each other the outer one alone
    outer = {a: own for a, own in joined.items() if not any(b.begin < a.begin and a.end < b.end for b in joined)}
    call = "crate::deliberate" if path.startswith("crates/partita-math/") else "partita_math::deliberate"
    new, found, last = "", list[tuple[Error, Body]](), 0
    for body, own in sorted(outer.items(), key=lambda item: item[0].begin):
        new += text[last : body.begin]
        right = text[body.begin : body.end]
        begin = len(new)
        new += "{ "
        for number, error in own:
            new += f"if {call}({number}) {right.replace(error.old, error.new)} else "
        new += f"{right} }}"
        found += [(error, Body(begin, len(new))) for _, error in own]
        last = body.end
    return new + text[last:], found
