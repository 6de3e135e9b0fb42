"""A point mass on a massless rod, released from the horizontal."""

from __future__ import annotations

from ..mechanism import Mechanism
from ..results import Result
from ..state import State
from .entry import Check, Entry, path_error

PERIOD = 2.3678419475762374493  # closed form: 4 K(sin^2 45 deg) sqrt(l / g)

# t: x, y
PATH = {
    1.0: (0.986291751131875319, -0.165010853125541169),
    5.0: (-0.942305435043757335, -0.334754338414000581),
    10.0: (-0.27508746257611686, -0.961419205099125064),
    100.0: (-0.181513351427031385, -0.983388480334057505),
}


def build() -> Mechanism:
    """The drawing: the mass at (-1, 0), the pivot at the origin."""
    m = Mechanism("planar-pendulum", gravity=(0, -9.81, 0))
    bob = m.add_body("bob", mass=1.0, inertia=(0, 0, 0), position=(-1, 0, 0))
    m.add_revolute("pivot", m.ground, bob, point=(0, 0, 0), axis=(0, 0, 1))
    return m


def start(m: Mechanism) -> State:
    """At rest as drawn."""
    return m.assemble()


def path(result: Result) -> float:
    """Largest error of x, y over the tabled times that the run reached."""
    end = float(result.t[-1])
    return path_error(result.body("bob").position[:, :2], result, {t: p for t, p in PATH.items() if t <= end})


def returns(result: Result) -> float:
    """Distance from the starting point after one period: at rest there, it is of second order in the time error."""
    return path_error(result.body("bob").position[:, :2], result, {PERIOD: (-1.0, 0.0)})


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="planar-pendulum",
        title="planar pendulum: a point mass of 1 kg on a massless rod of 1 m",
        source="Library of Computational Benchmark Problems (IFToMM), problem A01; closed form with elliptic functions",
        duration=10.0,
        build=build,
        start=start,
        times=(1.0, PERIOD, 5.0, 10.0),
        options={"rtol": 1e-11, "atol": 1e-12},
        checks=(
            Check("path of the mass [m]", 1e-8, "rtol 1e-11 over 400 steps, growing with time; some margin", path),
            Check("back at the start after one period [m]", 1e-10, "at rest there, so only local errors show", returns),
        ),
    )
