"""The tables of declared loads in the schema of model files, from declarations and docstrings of their methods."""

from __future__ import annotations

import inspect
import json
import re
from typing import Any

from partita.builder.declaration import LOADS, Load
from partita.io import schema

WIDTH = 120


def current() -> str:
    """The text of the schema as it should be: declared loads anew, all else as it is."""
    content = json.loads(schema.PATH.read_text(encoding="utf-8"))
    tables, sensor = content["properties"], content["properties"].pop("sensor")
    tables.update({kind: table(load) for kind, load in LOADS.items()})
    return text({**content, "properties": {**tables, "sensor": sensor}}) + "\n"


def table(load: Load) -> dict[str, Any]:
    """Its table, each argument with its words; what `None` means in a call is what leaving it out means in a
    file, which has no functions."""
    docstring = inspect.getdoc(load.method) or ""
    first = " ".join(docstring.partition("\n\n")[0].split()).partition(". ")[0]
    words, summary = arguments(docstring), sentence(first.removeprefix("Add "))
    properties = {}
    for name, default in load.defaults.items():
        rule = load.fields[name].rule if name in load.fields else {"$ref": "#/$defs/name"}
        usual = "" if default in (None, inspect.Parameter.empty) else f" Default: {plain(default)}."
        meaning = words[name].replace("None:", "left out:").replace(", or f(t, state)", "")
        properties[name] = {**rule, "description": sentence(meaning) + usual}
    item = {
        "type": "object",
        "description": summary,
        "properties": properties,
        "required": [name for name, default in load.defaults.items() if default is inspect.Parameter.empty],
        "additionalProperties": False,
    }
    return {"type": "array", "description": summary, "items": item}


def arguments(docstring: str) -> dict[str, str]:
    """What a docstring says of each argument."""
    found = re.search(r"^Args:\n((?:    .*\n?)+)", docstring, flags=re.MULTILINE)
    entries = re.findall(
        r"^    (\w[\w, ]*): ((?:.*\n?)(?:     +.*\n?)*)", found[1] if found else "", flags=re.MULTILINE
    )
    return {name: " ".join(words.split()) for names, words in entries for name in names.split(", ")}


def sentence(words: str) -> str:
    """Words that begin with a capital letter and end with a stop."""
    return words[:1].upper() + words[1:].rstrip(".") + "."


def plain(value: Any) -> str:
    """A default as a file has it."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(plain, value))}]"
    return f"{value:g}" if isinstance(value, float) else json.dumps(value)


def text(value: Any, indent: int = 0, used: int = 0) -> str:
    """JSON with what fits on one line on one line."""
    line = json.dumps(value, ensure_ascii=False)
    if (used and used + len(line) < WIDTH) or not isinstance(value, dict | list) or not value:
        return line
    inside, parts = " " * (indent + 2), []
    for key, item in value.items() if isinstance(value, dict) else enumerate(value):
        head = f"{inside}{json.dumps(key, ensure_ascii=False)}: " if isinstance(value, dict) else inside
        parts.append(head + text(item, indent + 2, len(head)))
    opening, closing = "{}" if isinstance(value, dict) else "[]"
    return "\n".join([opening, ",\n".join(parts), " " * indent + closing])
