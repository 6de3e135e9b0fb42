"""`partita report | list | plot | view | convert | draw`."""

from __future__ import annotations

import argparse
import warnings
from contextlib import suppress
from pathlib import Path

from ..errors import ArgumentError, LossyFileWarning
from .models import open_as_asked
from .printing import print_json


def report(arguments: argparse.Namespace) -> int:
    """Print the report of a mechanism."""
    opened = open_as_asked(arguments.model, arguments)
    found = opened.mechanism.report(opened.initial())
    if arguments.json:
        print_json(found.to_dict())
    else:
        print(found.markdown if arguments.markdown else found, end="")
    return 0


def list_names(arguments: argparse.Namespace) -> int:
    """Print names, durations and titles of the catalogue."""
    from .. import catalogue

    names = catalogue.names()
    if arguments.json:
        entries = [catalogue.entry(name) for name in names]
        print_json([{"name": e.name, "duration": e.duration, "title": e.title} for e in entries])
        return 0
    width = max(map(len, names), default=0)
    for name in names:
        entry = catalogue.entry(name)
        print(f"{name:<{width}}  {entry.duration:>6g} s  {entry.title}")
    return 0


def plot(arguments: argparse.Namespace) -> int:
    """Draw a stored result."""
    from ..results import load_result

    target = _beside(arguments.result, arguments.output, ".png")
    load_result(arguments.result).plot(*(arguments.what or ()), path=target)
    print(f"wrote {target}")
    return 0


def view(arguments: argparse.Namespace) -> int:
    """Open the page of a stored result in the browser; with a file to write, write it, a film for a .gif or .mp4."""
    from ..results import load_result

    if not arguments.output:
        print(f"opened {load_result(arguments.result).show().path}; -o FILE keeps it")
        return 0
    target = _beside(arguments.result, arguments.output, ".html")
    if target.suffix.lower() in (".gif", ".mp4"):
        load_result(arguments.result).save_animation(target)
        print(f"wrote {target}")
        return 0
    load_result(arguments.result).to_html(target)
    print(f"wrote {target}; open it with a browser")
    return 0


def convert(arguments: argparse.Namespace) -> int:
    """Read one model file, write another, and print changes and losses."""
    opened = open_as_asked(arguments.source, arguments)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LossyFileWarning)  # printed below
        written = opened.mechanism.save(arguments.target, strict=arguments.strict)
    if arguments.json:
        print_json(written.to_dict())
    else:
        print(f"wrote {written}")
    return 0


def draw(arguments: argparse.Namespace) -> int:
    """Serve the page on which a mechanism is drawn until Ctrl+C, or write it as a file of its own."""
    from ..sketch import draw as opened
    from ..sketch import write_static_page

    if arguments.static:
        print(f"wrote {write_static_page(arguments.static)}; open it with a browser")
        return 0
    with suppress(KeyboardInterrupt), opened(port=arguments.port, browser=not arguments.no_browser) as page:
        print(f"draw at {page.url}\nCtrl+C ends", flush=True)
        page.wait()
    return 0


def _beside(result: str, output: str | None, ending: str) -> Path:
    """The requested file, or a new one beside the result with another ending; never the result itself, nor a file of
    that name that is there already and was not asked for."""
    target = Path(output) if output else Path(result).with_suffix(ending)
    if not output and target.exists():
        raise ArgumentError(f"{str(target)!r} exists already; -o {target} replaces it", argument="output")
    if target.resolve() == Path(result).resolve():
        raise ArgumentError(f"{str(target)!r} is the result itself; give another file with -o", argument="output")
    return target
