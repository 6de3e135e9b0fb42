"""docs/paper.md says what the scripts find: every number in its sentences and tables is compared with one.

A claim is a stretch of the page with # in the place of each number, the script that finds them, and the keys of what it
returns. A number agrees if it is the script's, rounded to the digits that stand on the page; errors near round-off,
which no two machines share, are compared by their size. What was given to the scripts, and not found by them, is listed
too: a number that is neither makes the test fail.
"""

import re
from dataclasses import dataclass
from functools import cache

import pytest
from paper_runs import ROOT, numbers  # before what it makes importable
from thorough import THOROUGH

NUMBER = r"(\d+(?:\.\d+)?(?:e-?\d+)?)"
SECTION = "## The measure of a pendulum"
TABLE = "## Every equation and claim"
"""From here on the page lists names; test_paper_table.py reads them."""
SKIPPED = ""
"""The key of a number that another claim with the same words looks at."""


@dataclass(frozen=True)
class Claim:
    """`words` of the page; `keys` of what `script` returns, one for each #; `factor` from the script to the page."""

    script: str
    words: str
    keys: tuple[str, ...]
    factor: float = 1.0
    rough: float = 0.0
    """Relative difference allowed beyond the rounding."""
    sizes: bool = False
    """Whether the page writes the signs itself."""
    full: bool = False
    """Whether the full form of the script alone finds it, which runs in `make trust`."""


def margins() -> list[Claim]:
    """Rows of the table of margins."""
    return [
        Claim("four_bar_turn", f"\n| {margin} | # | # | # | # |", tuple(
            f"{kind}: {what}, margin {margin}"
            for kind in ("absolute", "joint") for what in ("switches", "least rho of the chosen")
        ))
        for margin in ("1", "1.2", "1.5", "2", "3")
    ]  # fmt: skip


def orders() -> list[Claim]:
    """Rows of the table of orders; the errors come near round-off."""
    found = []
    for method in ("rk4", "dopri5", "dop853"):
        steps = (f"{method}: shortest step [ms]", f"{method}: longest step [ms]")
        errors = (f"{method}: least error", f"{method}: largest error")
        slopes = (f"{method}: least order", f"{method}: largest order")
        row, skipped = f"\n| {method} | # to # | # to # | # to # |", (SKIPPED, SKIPPED)
        found.append(Claim("orders", row, steps + skipped + slopes, rough=0.005))
        found.append(Claim("orders", row, skipped + errors + skipped, rough=0.5))
    return found


def thresholds() -> list[Claim]:
    """Rows of the table of thresholds."""
    return [
        Claim("switching", f"\n| {threshold} | # | # | # |", tuple(
            f"turning, threshold {threshold}: {what}" for what in ("switches", "evaluations", "error")
        ), rough=0.02)
        for threshold in ("1.0001", "1.01", "1.1", "1.25", "1.5", "2", "3", "5", "kept")
    ]  # fmt: skip


def fading() -> list[Claim]:
    """Rows of the table of frozen tangents."""
    return [
        Claim("frozen", f"\n| {'joint' if coordinates == 'relative' else coordinates} | {start} | # | # | # | # | # |",
              tuple(f"{coordinates} from {start} rad: {what}"
                    for what in (*(f"after {a} deg" for a in (10, 40, 80, 120)), "least in a turn")))
        for coordinates in ("absolute", "relative") for start in ("0.8", "0", "2")
    ]  # fmt: skip


def costs() -> list[Claim]:
    """Rows of the table of operations."""
    return [
        Claim("closing", f"\n| {title} | # | # | # | # |",
              tuple(f"operations, {title}: {what}"
                    for what in ("projective", "explicit-closing", "ratio", "iteration")))
        for title in ("four-bar", "slider-crank", "Watt's six-bar", "Andrews' squeezer", "3-RRR", "Jansen's leg",
                      "chain of 40")
    ]  # fmt: skip


FROZEN = "frozen tangent after {} deg"
MADE = "svd: sqrt(mu) when made, drawn in {}"
CLAIMS = (
    Claim("pendulum", "at # degrees first", ("first switch at [deg]",)),
    Claim("pendulum", "never farther than # degrees away", ("farthest switch from 45 [deg]",)),
    Claim("pendulum", "rho of the angle is # over the whole turn", ("rod: rho of the angle",)),
    Claim("four_bar_turn", "rho of the crank's joint A falls to # and that of B to #; C fails",
          ("joint: least rho of A", "joint: least rho of B")),
    Claim("four_bar_turn", "only the rotation of the crank stays at # or more", ("absolute: least rho of crank.turn",)),
    Claim("four_bar_turn", "takes # switches in a turn from", ("absolute: switches, margin 1",)),
    *margins(),
    Claim("drift", "after 32 s the closure error is # m; it grows like t to the #, and with the step to the #.",
          ("k + n: largest |Phi|", "k + n: |Phi| grows like t to the", "k + n: |Phi| falls with the step to the")),
    Claim("drift", "integrated, the closure error is # m; it grows like t to the #, and the error of the rates like "
          "t to the #.",
          ("accelerations: largest |Phi|", "accelerations: |Phi| grows like t to the",
           "accelerations: |C v| grows like t to the")),
    *orders(),
    Claim("determinant", "choice in # % of the positions",
          ("determinant: share of the turn that changes with m to mm",), factor=100.0),
    Claim("individual", "keeps sigma at #, # and #.", tuple(
        f"{name}: sigma of the collective choice"
        for name in ("pendulum and carts", "3-RRR robot", "coupled inertia")
    )),
    Claim("individual", "Over # random poses of the robot the k largest fall below 0.1 in # of them, to # at worst; "
          "the collective choice never falls below #.",
          ("robot, many poses: poses", "robot, many poses: k largest below 0.1",
           "robot, many poses: least sigma of the k largest rho",
           "robot, many poses: least sigma of the collective choice"), full=True),
    Claim("frozen", "where they are defined: sqrt(mu) = #.", ("quality when made",)),
    Claim("frozen", "they have fallen to # after 10 degrees of the crank, to # after 40, to # after 80. After # "
          "degrees they reach zero",
          (FROZEN.format(10), FROZEN.format(40), FROZEN.format(80), "frozen tangent reaches zero after [deg]")),
    Claim("frozen", "to # after 120 and # after 180.", (FROZEN.format(120), FROZEN.format(180))),
    *fading(),
    Claim("frozen", "sqrt(mu) is # where the four-bar is drawn in metres, and # where it is drawn in millimetres",
          (MADE.format("m"), MADE.format("mm"))),
    Claim("frozen", "is # for all four at the start", ("delta: sqrt(mu) of all four at the start",)),
    Claim("frozen", "is between # and #.", ("delta: least sigma of the four at the start",
                                            "delta: largest sigma of the four at the start")),
    *thresholds(),
    Claim("four_bar_turn", "with rho of # to #, beats them all",
          ("absolute: least rho of crank.turn", "absolute: largest rho of crank.turn")),
    Claim("switching", "after each of # switches", ("handed over: switches looked at",)),
    Claim("switching", "and # switches or more in each measured run",
          ("dop853, threshold 1.01: least number of switches",)),
    Claim("switching", "\n| rk4 | the eleven turns | # | # |",
          ("rk4, threshold 1.0001: order", "rk4, threshold 1.01: order")),
    Claim("switching", "\n| dopri5 | the free swing, 18 s | # | # |",
          ("dopri5, threshold 1.0001: order", "dopri5, threshold 1.01: order")),
    Claim("switching", "\n| dop853 | the eleven turns | # | # |",
          ("dop853, threshold 1.0001: order", "dop853, threshold 1.01: order"), rough=0.01),
    *(Claim("switching", f"\n| {method} | # | # | # | # |", tuple(
        f"adaptive, {method}, {name}: {what}" for what in ("evaluations", "error") for name in ("none", "forced")
    ), rough=0.05) for method in ("dopri5", "dop853", "adams")),
    Claim("switching", "pays # evaluations and more", ("adaptive, adams: evaluations of a switch",)),
    Claim("switching", "there are # switches:", ("adaptive, dop853, forced: switches",)),
    Claim("switching", "At the default threshold of 1.25 rk4 has # and dop853 #.",
          ("rk4, threshold 1.25: order", "dop853, threshold 1.25: order"), rough=0.01),
    Claim("closing", "to within the accuracy of the differences: # and #.",
          ("A: largest difference from that of the Jacobian", "xi: largest difference from that of the Jacobian"),
          rough=0.5),
    Claim("closing", "the smallest pivot over a turn is # times its largest value",
          ("least pivot over a turn, in parts of the largest",), full=True),
    Claim("closing", "and all # combinations close", ("assemblies for one angle of the crank",)),
    *costs(),
    Claim("closing", "the operations of # to # iterations",
          ("operations: closing over an iteration, least", "operations: closing over an iteration, largest")),
    Claim("closing", "costs # to # times as much", ("operations: least ratio", "operations: largest ratio")),
    Claim("closing", "the second # in each evaluation", ("wehage-haug: Newton iterations for each",)),
    Claim("closing", "starts Newton's method in # positions of the leg", ("Newton: positions",), full=True),
    Claim("closing", "Up to a jump of # degrees it stays on its branch from all of them. From # degrees on",
          ("Newton: largest jump that keeps it everywhere [deg]",
           "Newton: jump that loses the branch somewhere [deg]"), full=True),
    Claim("reactions", "(M v' - h)_D is # and -# N m, generalised",
          ("(M v' - h)_D there, first [N m]", "(M v' - h)_D there, second [N m]"), sizes=True),
    Claim("reactions", "the force in D is # and # N.",
          ("lambda at 0.8 rad and 1.5 rad/s, x [N]", "lambda at 0.8 rad and 1.5 rad/s, y [N]")),
    Claim("reactions", "of the largest force, # N in A when the crank has turned by # degrees; there B has #, C # and "
          "D # N.", ("force in A: largest over a turn [N]", "force in A: at a turn of the crank of [deg]",
                   *(f"force in {joint}: largest over a turn [N]" for joint in "BCD"))),
    Claim("reactions", "it is # at most. With C independent it is never below #,",
          ("amplification with A independent: largest", "amplification with C independent: least")),
)  # fmt: skip

GIVEN = (
    "cross at 45 degrees",
    "crank 1, coupler 2.5, rocker 2, ground 2.2 m",
    "the crank at 0;",
    "started at 6 rad/s, RK4 with steps of 10 ms",
    "after 32 s",
    "driven by 40 N m",
    "With the crank at 0.8 rad",
    "after 10 degrees", "after 40,", "after 80.", "after 120", "after 180.", "with the crank at 0.8 rad,",
    "after 10°", "after 40°", "after 80°", "after 120°", "less than 1e-9 between",
    "the crank at 0.8 rad and 1.5 rad/s", "started at 0.8 rad with 6 rad/s", "the same 2k equations",
    "agree to 1e-15", "agree to 1e-14", "agree to 1e-12", "1/sqrt(mu)",
    "eleven times in 23 s", "rk4 with steps of 2.5 ms", "is to 1, the more",
    "With thresholds of 1.0001 and 1.01,", "| method | motion | 1.0001 | 1.01 |", "the free swing, 18 s",
    "default threshold of 1.25", "in the swing at 1.25",
    "free swing of 18 s", "tolerance of 1e-8; with a threshold of 1",
    "rk4", "dopri5", "dop853",
)  # fmt: skip
"""Arguments and thresholds of the scripts; names with digits."""


@cache
def page() -> str:
    """The page from its first claim on, without code and figures; a line for each row of a table, one for the rest."""
    text = (ROOT / "docs" / "paper.md").read_text("utf-8")
    text = text[text.index(SECTION) : text.find(TABLE) if TABLE in text else None]
    text = re.sub(r"^!\[.*$|^#.*$|`[^`]*`", " ", text, flags=re.MULTILINE)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"\(\d+\)|\bC_D\^-1\b", " ", text)  # labels of equations
    return re.sub(r"\s*\n\s*(?!\|)|[ ]+", " ", text)


def pattern(words: str) -> str:
    """What finds a claim; a row of a table is found whole."""
    return NUMBER.join(re.escape(part) for part in words.split("#")) + (r"(?! [\d.]+ \|)" if words[0] == "\n" else "")


@pytest.mark.parametrize(
    "claim", [x for x in CLAIMS if THOROUGH or not x.full], ids=lambda claim: f"{claim.script}: {claim.words[:40]}"
)
def test_number_is_what_the_script_finds(claim: Claim) -> None:
    hits = re.findall(pattern(claim.words), page())
    assert len(hits) == 1, "the page does not say this, or says it twice"
    texts = hits[0] if isinstance(hits[0], tuple) else (hits[0],)
    found = numbers(claim.script)
    for text, key in zip(texts, claim.keys, strict=True):
        if key == SKIPPED:
            continue
        value = claim.factor * (abs(found[key]) if claim.sizes else found[key])
        assert abs(value - float(text)) <= 0.501 * last_digit(text) + claim.rough * abs(value), (text, key, value)


def last_digit(text: str) -> float:
    """One unit of the last digit that stands there."""
    mantissa, _, power = text.partition("e")
    return 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2]))


def test_no_other_number_stands_on_the_page() -> None:
    rest = page()
    for claim in CLAIMS:
        rest = re.sub(pattern(claim.words), " ", rest)
    for words in GIVEN:
        rest = rest.replace(words, " ")
    assert re.findall(r"[^.|]*\d[^.|]*", rest) == []


def test_words_for_numbers() -> None:
    """Turns of the crank, zeros along a turn, how much worse late switches are, the same measure in all units."""
    switching, turn = numbers("switching"), numbers("four_bar_turn")
    assert 10.5 < switching["turning: turns of the crank"] < 11.5
    least = [
        value for name, value in turn.items() if name.startswith("absolute: least rho of ") and "chosen" not in name
    ]
    assert len(least) == 9 and sum(value < 0.001 for value in least) == 8
    assert 100 < switching["turning, threshold 5: error"] / switching["turning, threshold 1.5: error"] < 300
    assert numbers("determinant")["measure: largest change with the units"] < 1e-13
