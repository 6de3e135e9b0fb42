"""What can be typed: the words and options of the command line."""

from __future__ import annotations

import argparse
import math
from typing import NoReturn

from ..options import COORDINATES, CORRECTIONS, FORMULATIONS, METHODS, SELECTIONS
from ..units.door import QuantityError, in_si
from ..units.text import NotAQuantity, quantity_of

MODEL = "a model file (it exists or has an ending such as .toml), or a name from `partita list`"
BAUMGARTE = "the two numbers [1/s] that the formulation baumgarte needs"
WINDOW = "time [s] over which the rule persistence looks back"


def parser() -> argparse.ArgumentParser:
    """The parser; every command stores the function that carries it out in `run`."""
    from .. import __version__
    from . import check, commands
    from .compare import compare
    from .simulate import simulate

    top = _Parser(prog="partita", description="Motion and forces of mechanisms with closed loops.")
    top.add_argument("--version", action="version", version=f"partita {__version__}")
    words = top.add_subparsers(title="commands", metavar="COMMAND", required=True)

    _simulate(_command(words, "simulate", simulate, "compute a motion, and tell what was found"))

    _compare(_command(words, "compare", compare, "run every formulation on one mechanism, and tell what each costs"))

    report = _command(words, "report", commands.report, "mobility, redundancy, coordinates and reactions, in words")
    report.add_argument("model", metavar="FILE|NAME", help=MODEL)
    about = "what a model file is: what was read and dropped, whether it closes, what moves, what looks like a slip"
    lint = _command(words, "check", check.check, about)
    lint.add_argument("model", metavar="FILE|NAME", help=MODEL)
    lint.add_argument("--json", action="store_true", help="print all that was found as JSON")
    lint.add_argument("--base", choices=("fixed", "free"), default="fixed", help="what the root of a URDF does")

    _command(words, "list", commands.list_names, "list the mechanisms of the catalogue")

    plot = _command(words, "plot", commands.plot, "draw a stored result")
    plot.add_argument("result", metavar="RESULT", help="a stored result (.nc, .zarr, .json, .csv, .parquet, .mat)")
    plot.add_argument(
        "-o", "--output", metavar="FILE", help="figure to write (.png, .pdf, .svg); default: beside RESULT"
    )
    plot.add_argument(
        "--what",
        metavar="WORD",
        action="append",
        help="overview (default), coordinates, closure, energy, measure, reactions, or the name of a joint; repeatable",
    )

    view = _command(words, "view", commands.view, "make the animated page of a stored result")
    view.add_argument("result", metavar="RESULT", help="a stored result (.nc, .zarr, .json, .csv, .parquet, .mat)")
    view.add_argument("-o", "--output", metavar="FILE", help="page to write (.html); default: beside RESULT")

    convert = _command(words, "convert", commands.convert, "read one model file and write another")
    convert.add_argument("source", metavar="A", help="model file to read, or a name of the catalogue")
    convert.add_argument("target", metavar="B", help="model file to write; its ending decides the format")
    convert.add_argument("--strict", action="store_true", help="refuse what the format cannot carry")
    convert.add_argument("--json", action="store_true", help="print what was changed and dropped as JSON")
    convert.add_argument("--base", choices=("fixed", "free"), default="fixed", help="what the root of a URDF does")
    return top


def _simulate(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    add("model", metavar="FILE|NAME", help=MODEL)
    add(
        "--time",
        metavar="S",
        type=seconds,
        help="length of the run [s, or such as '2 min']; default for a NAME: that of its problem",
    )
    add("--outputs", metavar="N", type=count, default=501, help="number of equally spaced outputs (default 501)")
    add("--rtol", metavar="X", type=positive, help="relative tolerance of the step control (default 1e-8)")
    add("--atol", metavar="X", type=positive, help="absolute tolerance of the step control (default 1e-10)")
    add("--method", choices=METHODS, help="integrator (default dop853)")
    add("--formulation", choices=FORMULATIONS, help="equations of motion (default projective)")
    add("--coordinates", choices=COORDINATES, default="relative", help="coordinates of the model (default relative)")
    add("--selection", choices=SELECTIONS, help="rule that chooses the coordinates of projective (default collective)")
    add("--independent", metavar="A,B", type=listed, help="velocities to integrate throughout, instead of a choice")
    add("--window", metavar="S", type=seconds, help=WINDOW)
    add("--correction", choices=CORRECTIONS, help="what closes the loops after a step (default partition)")
    add("--baumgarte", metavar="ALPHA,BETA", type=pair, help=BAUMGARTE)
    add(
        "--target",
        metavar="JOINT=VALUE",
        type=setting,
        action="append",
        default=[],
        help="position of a joint at the start [rad or m; or with its unit: 30deg, '5 mm']; repeatable",
    )
    add(
        "--rate",
        metavar="JOINT=VALUE",
        type=setting,
        action="append",
        default=[],
        help="velocity of a joint at the start [rad/s or m/s; or with its unit: 60rpm]; repeatable",
    )
    add("--html", metavar="FILE", help="write the animated page")
    add("--save", metavar="FILE", help="write the result (.nc, .zarr, .json, .csv, .parquet, .mat)")
    add("--plot", metavar="FILE", help="write the figure (.png, .pdf, .svg)")
    add("--quiet", action="store_true", help="print nothing but errors")


def _compare(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    add("model", metavar="FILE|NAME", help=MODEL)
    add("--time", metavar="S", type=seconds, help="length of the runs [s]; default for a NAME: that of its problem")
    add("--rtol", metavar="X", type=positive, default=1e-8, help="relative tolerance (default 1e-8)")
    add("--atol", metavar="X", type=positive, default=1e-10, help="absolute tolerance (default 1e-10)")
    add("--method", choices=METHODS, default="dop853", help="integrator (default dop853)")
    known = ", ".join(FORMULATIONS)
    add(
        "--formulations",
        metavar="A,B",
        type=listed,
        help=f'which ones, with commas, or rows such as "svd: each step" (default all: {known})',
    )
    rules = ", ".join(SELECTIONS)
    add("--rules", "--selections", metavar="A,B", type=listed, help=f"rules of projective (default all: {rules})")
    removals = ", ".join(CORRECTIONS)
    add("--correction", metavar="A,B", type=listed, help=f"corrections of projective, a row for each ({removals})")
    add("--coordinates", choices=COORDINATES, default="relative", help="coordinates of the model (default relative)")
    add(
        "--tolerances",
        metavar="X,Y",
        type=ladder,
        help="run the rows that finish again with each of these rtol, and print errors and costs",
    )
    add("--baumgarte", metavar="ALPHA,BETA", type=pair, help=BAUMGARTE)
    add("--window", metavar="S", type=seconds, help=WINDOW)
    add("--plot", metavar="FILE", help="write a figure of errors and costs (.png, .pdf, .svg)")
    add("--work-precision", metavar="FILE", help="run over the tolerances, and write the figure of error over work")
    add("--csv", metavar="FILE", help="write the rows")


def _command(words: argparse._SubParsersAction, name: str, run: object, text: str) -> argparse.ArgumentParser:  # type: ignore[type-arg]
    command: argparse.ArgumentParser = words.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")
    command.set_defaults(run=run)
    return command


class _Parser(argparse.ArgumentParser):
    """Tells a misuse in one sentence instead of a page of usage."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"partita: error: {message}; see `{self.prog} --help`\n")


def number(text: str) -> float:
    """A finite number."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} is not finite")
    return value


def seconds(text: str) -> float:
    """A time above zero [s], or one with its unit."""
    try:
        value = float(text)
    except ValueError:
        try:
            value = in_si("it", text, "s")
        except QuantityError as error:
            raise argparse.ArgumentTypeError(f"{text!r} is not a number: {error}") from None
    return positive(repr(value))


def ladder(text: str) -> list[float]:
    """Several numbers above zero, with commas."""
    return [positive(part) for part in text.split(",")]


def positive(text: str) -> float:
    """A finite number above zero."""
    value = number(text)
    if value <= 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not greater than zero")
    return value


def count(text: str) -> int:
    """Two or more."""
    try:
        value = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number") from None
    if value < 2:
        raise argparse.ArgumentTypeError(f"{text!r} is too few: the start and the end are two outputs")
    return value


def listed(text: str) -> list[str]:
    """Names with commas between them."""
    names = [name.strip() for name in text.split(",")]
    if not all(names):
        raise argparse.ArgumentTypeError(f"{text!r} does not read A,B,C")
    return names


def pair(text: str) -> tuple[float, float]:
    """Two finite numbers with a comma between them."""
    values = [number(part) for part in text.split(",")]
    if len(values) != 2:
        raise argparse.ArgumentTypeError(f"{text!r} are not two numbers with a comma between them")
    return values[0], values[1]


def setting(text: str) -> tuple[str, list[float | str]]:
    """`JOINT=VALUE`; several values for a joint with several coordinates stand with commas. What has a unit is read
    where the joint is known."""
    name, equals, values = text.rpartition("=")
    if not equals or not name:
        raise argparse.ArgumentTypeError(f"{text!r} does not read JOINT=VALUE, such as A=0.5 or A=30deg")
    return name, [_number_or_quantity(value) for value in values.split(",")]


def _number_or_quantity(text: str) -> float | str:
    try:
        found = quantity_of(text)
    except NotAQuantity as error:
        try:
            return number(text)
        except argparse.ArgumentTypeError:
            raise argparse.ArgumentTypeError(f"{text!r} is not a number: {error}") from None
    return text if found.named else number(text)
