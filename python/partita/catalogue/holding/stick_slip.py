"""A block on a belt, held by a spring: it sticks, slips back, and sticks again."""

from __future__ import annotations

from ...mechanism import Mechanism
from ...results import Result
from ...state import State
from ..entry import Check, Entry, path_error
from .records import OPTIONS, times

EVENTS = (
    ("rub", "slip", 0.654),
    ("rub", "stick", 1.54341177505311661),
    ("rub", "slip", 2.06661177505311661),
    ("rub", "stick", 2.95602355010623323),
    ("rub", "slip", 3.47922355010623323),
    ("rub", "stick", 4.36863532515934984),
    ("rub", "slip", 4.89183532515934984),
)
PULL = {0.5: (7.5,), 1.0: (5.886,), 2.0: (8.81082337420325,), 4.0: (5.886,)}
"""Of friction on the block [N], by time."""


def build() -> Mechanism:
    """2 kg on a belt of 0.3 m/s, at a spring of 50 N/m; friction 0.5 of the weight at rest, 0.3 sliding."""
    m = Mechanism("stick-slip", gravity=None)
    belt = m.add_body("belt", mass=1.0, inertia=(1, 1, 1))
    block = m.add_body("block", mass=2.0, inertia=(0.01, 0.01, 0.01))
    m.add_prismatic("rollers", m.ground, belt, axis=(1, 0, 0))
    m.add_prismatic("slide", belt, block, axis=(1, 0, 0))
    m.add_drive("rollers", velocity=0.3, name="motor")
    m.add_spring("spring", m.ground, (-0.5, 0, 0), block, (0, 0, 0), stiffness=50.0)
    m.add_friction("slide", 0.3 * 2.0 * 9.81, static=0.5 * 2.0 * 9.81, name="rub")
    return m


def start(m: Mechanism) -> State:
    """The block rides on the belt, the spring relaxed."""
    return m.assemble(rates={"rollers": 0.3, "slide": 0.0})


def pull(result: Result) -> float:
    """Largest error over the tabled times."""
    return path_error(result.force("rub").effort[:, None], result, PULL)


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="stick-slip",
        title="block on a belt, held by a spring: stick-slip",
        source="closed form: it slips where the spring pulls with static friction, then swings as a harmonic "
        "oscillator until it is as fast as the belt",
        duration=5.0,
        build=build,
        start=start,
        times=tuple(PULL),
        options=OPTIONS,
        checks=(times(EVENTS), Check("friction [N]", 1e-9, "ten times rtol of 10 N", pull)),
        notes="From the first slip on it is a limit cycle of 1.412611775 s.",
    )
