"""The published JSON Schema of model files, and a check by it that reports in sentences.

The schema is the only definition of keys, types and defaults of a file. The part of JSON Schema that it uses is
implemented here: $ref, type, properties, required, items, oneOf, enum, const, pattern and simple bounds. `title` is the
word for a value in messages.
"""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, NoReturn

_LONG = 60
"""Characters of a value in a message."""
PATH = Path(__file__).with_name("mechanism.schema.json")
Schema = Mapping[str, Any]

_TYPES: dict[str, tuple[str, Any]] = {
    "object": ("a table", lambda value: isinstance(value, dict)),
    "array": ("a list", lambda value: isinstance(value, list)),
    "string": ("text", lambda value: isinstance(value, str)),
    "integer": ("an integer", lambda value: isinstance(value, int) and not isinstance(value, bool)),
    "number": ("a number", lambda value: isinstance(value, int | float) and not isinstance(value, bool)),
}


# The rule of a number without bounds, and the types that satisfy it.
_PLAIN_NUMBER = {"type", "title", "description", "pattern"}
_QUANTITY = ["number", "string"]
_NUMBERS = {int, float}


class Mismatch(Exception):
    """The error of the value at a JSON pointer."""

    def __init__(self, pointer: str, sentence: str) -> None:
        super().__init__(sentence)
        self.pointer, self.sentence = pointer, sentence


@cache
def load() -> dict[str, Any]:
    """The schema as plain data."""
    content: dict[str, Any] = json.loads(PATH.read_text(encoding="utf-8"))
    return content


def check(value: Any, schema: Schema | None = None, pointer: str = "", owner: str = "the file") -> None:
    """Raise `Mismatch` for the first thing in `value` that the schema does not allow."""
    rule = _resolved(load() if schema is None else schema)
    if "oneOf" in rule:
        _one_of(value, rule, pointer, owner)
        return
    if "type" in rule and not _is_of(value, rule["type"]):
        _expected(rule, value, pointer)
    if "pattern" in rule and isinstance(value, str) and not re.search(rule["pattern"], value):
        _expected(rule, value, pointer)
    # for Python True == 1
    if "enum" in rule and not any(type(value) is type(word) and value == word for word in rule["enum"]):
        close = _close(value, [word for word in rule["enum"] if isinstance(word, str)])
        hint = f"; did you mean {close!r}?" if close else ""
        raise Mismatch(
            pointer,
            f"{_key(pointer)} must be one of {', '.join(map(_shown, rule['enum']))}, not {_shown(value)}{hint}",
        )
    if "const" in rule and (value != rule["const"] or isinstance(value, bool)):  # for Python True == 1
        _expected(rule, value, pointer)
    if "minimum" in rule and not isinstance(value, str) and value < rule["minimum"]:
        raise Mismatch(pointer, f"{_key(pointer)} is {_shown(value)}; it must be at least {rule['minimum']}")
    if isinstance(value, dict) and "properties" in rule:
        _object(value, rule, pointer, owner)
    if isinstance(value, list):
        _array(value, rule, pointer)


def _object(value: dict[str, Any], rule: Schema, pointer: str, owner: str) -> None:
    """Known keys only, all required ones, each as it must be."""
    known = rule["properties"]
    for key in value:
        if key not in known:
            close = _close(key, known)
            hint = f'did you mean "{close}"?' if close else f"known keys: {', '.join(known)}"
            raise Mismatch(child(pointer, key), f'"{_cut(key)}" is not a key of {owner}; {hint}')
    for key in rule.get("required", ()):
        if key not in value:
            raise Mismatch(pointer, f'{owner} has no "{key}": {known[key].get("description", "it is required")}')
    for key, item in value.items():
        check(item, known[key], child(pointer, key), _owner(key, item))


def _array(value: list[Any], rule: Schema, pointer: str) -> None:
    """The right number of items, each as it must be."""
    low, high = rule.get("minItems", 0), rule.get("maxItems", len(value))
    if not low <= len(value) <= high:
        _expected(rule, value, pointer)
    items = _resolved(rule.get("items", {}))
    if (
        items.keys() <= _PLAIN_NUMBER
        and items.get("type") in ("number", _QUANTITY)
        and _NUMBERS.issuperset(map(type, value))
    ):
        return  # points and axes, by far the most of a file
    for index, item in enumerate(value):
        check(item, items, child(pointer, index), _owner(pointer.rpartition("/")[2], item))


def _one_of(value: Any, rule: Schema, pointer: str, owner: str) -> None:
    """One of several forms; tables with a key `type` are selected by it, so that the message refers to the right
    one."""
    forms = [_resolved(form) for form in rule["oneOf"]]
    kinds = {form.get("properties", {}).get("type", {}).get("const"): form for form in forms}
    if None in kinds:
        if not any(_fits(value, form) for form in forms):
            _expected(rule, value, pointer)
        return
    if not isinstance(value, dict):
        _expected(rule, value, pointer)
    if "type" not in value:
        raise Mismatch(pointer, f'{owner} has no "type"; it is one of {", ".join(kinds)}')
    if not isinstance(value["type"], str) or value["type"] not in kinds:
        close = _close(value["type"], kinds)
        hint = f'did you mean "{close}"?' if close else f"known types: {', '.join(kinds)}"
        kind = owner.partition(" ")[0]
        raise Mismatch(child(pointer, "type"), f"there is no {kind} of type {_shown(value['type'])}; {hint}")
    check(value, kinds[value["type"]], pointer, f"{value['type']} {owner}")


def _fits(value: Any, rule: Schema) -> bool:
    try:
        check(value, rule)
    except Mismatch:
        return False
    return True


def _resolved(schema: Schema) -> Schema:
    """The schema to which a $ref refers, with the bounds given beside it."""
    if "$ref" not in schema:
        return schema
    target: Schema = load()["$defs"][schema["$ref"].rpartition("/")[2]]
    return {**target, "minimum": schema["minimum"]} if "minimum" in schema else target


def _is_of(value: Any, kind: str | list[str]) -> bool:
    """Whether it is of this type, or of one of these."""
    return any(_TYPES[word][1](value) for word in ([kind] if isinstance(kind, str) else kind))


def _expected(rule: Schema, value: Any, pointer: str) -> NoReturn:
    wanted = rule.get("title") or (_TYPES[rule["type"]][0] if "type" in rule else repr(rule.get("const")))
    if rule.get("type") == _QUANTITY and isinstance(value, str):
        wanted += " or text that begins with one and ends with its unit, such as '250 mm'"
    raise Mismatch(pointer, f"{_key(pointer)} must be {wanted}, not {_shown(value)}")


def _shown(value: Any) -> str:
    """A value in a message, as a file has it."""
    return _cut(json.dumps(value, ensure_ascii=False))


def _cut(words: str) -> str:
    return words if len(words) <= _LONG else words[: _LONG - 3] + "..."


def _close(value: Any, known: Iterable[str]) -> str | None:
    """The known word that was meant, if any."""
    return next(iter(difflib.get_close_matches(_cut(str(value)), known, n=1)), None)


def _owner(key: str, item: Any) -> str:
    """The name of a table in messages: 'joint "A"'."""
    name = item.get("name") if isinstance(item, dict) else None
    return f'{key} "{_cut(name)}"' if isinstance(name, str) else key


def _key(pointer: str) -> str:
    """The last key of a pointer, with the indices behind it: 'point[1]'."""
    parts, indices = pointer.split("/")[1:], ""
    while parts and parts[-1].isdigit():
        indices = f"[{parts.pop()}]{indices}"
    return (_cut(parts[-1]) if parts else "the file") + indices


def child(pointer: str, key: str | int) -> str:
    """JSON pointer of a member."""
    return f"{pointer}/{str(key).replace('~', '~0').replace('/', '~1')}"
