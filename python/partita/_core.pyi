"""The compiled core: a description goes in, arrays come out. Private; `partita` is the public face.

Sizes: nq coordinates, nv velocities, `rows` kept constraint rows, k = nv - rank independent velocities. SI,
    radians,
world axes. A callback's own exceptions pass through unchanged.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Goal = tuple[str, str, int, int, tuple[float, ...]]

class Options:
    """Options of runs, read once from JSON."""

    def __init__(self, text: str) -> None: ...

EventList = tuple[str, Sequence[Callable[[float, Array, Array], float]], int]
"""Events as text, the functions that they call, and how many may occur."""

class Stepper:
    """A motion stepped tick by tick under inputs."""

    def __init__(
        self,
        model: Model,
        options: Options,
        dt: float,
        steps: int,
        inputs: list[tuple[int, int | None]],
        held: list[float],
        t: float,
        q: Array,
        v: Array,
        keeps: bool,
        events: EventList | None = None,
        acting: tuple[str, str, list[tuple[str, Callable[[float, Array, Array], str]]]] | None = None,
    ) -> None:
        """For ticks of `dt`, each of so many `steps`; inputs are forces of the description and components, or
        drives; `held` has a number for each, five of the course of a drive: since when, and a cubic. `acting`: the
        drives by which events act (JSON), what these do, and functions that decide about it."""

    def step(self, inputs: Array) -> tuple[float, Array, Array]:
        """One tick with these numbers held; t, q, v after it."""

    def occurred(self) -> tuple[list[tuple[int, bool, float, list[float], list[float]]], list[tuple[Any, ...]] | None]:
        """Events of the last tick: number, whether the function rises, t, q, v; or, where they act, what happened."""

    def begin(self, inputs: Array, t: float, q: Array, v: Array) -> None:
        """Stand at a closed state, with these numbers held."""

    def state(self) -> tuple[float, Array, Array]:
        """Where it stands: t, q, v."""

    def here(self) -> tuple[dict[str, Any], Model]:
        """What a run would have left that stands here, and the model as it is now."""

    def result(self, breaks: list[float], values: list[list[float]]) -> tuple[dict[str, Any], Model]:
        """What a run would have left, and the model with the inputs as tables."""

class Actuated:
    """The equations in the rates of as many actuators as degrees of freedom."""

    def at(self, t: float, q: Array, v: Array) -> dict[str, Any]:
        """M, bias, ratios and rates, by name."""

    def gravity(self, t: float, q: Array, v: Array) -> Array:
        """Efforts that carry the constant gravity."""

    def margin(self, t: float, q: Array) -> float:
        """How far the set is from a position in which a motion escapes it."""

    def cost(self, t: float, q: Array, v: Array) -> float:
        """Seconds of one evaluation."""

class Inverse:
    """A mechanism with a set of actuators."""

    def __init__(self, model: Model, actuators: str, silent: list[tuple[int, int | None]]) -> None:
        """`actuators` as JSON; forces of the description, and components, whose efforts are replaced by actuators."""

    @property
    def model(self) -> Model:
        """The model whose multipliers are found, with a row for each measurement along which an actuator acts."""

    def at(self, t: float, q: Array) -> Actuated:
        """The equations in the rates of the actuators, for positions like (t, q)."""

    def columns(self, t: float, q: Array) -> Array:
        """E at (t, q): a row for each actuator (s, nv)."""

    def efforts(
        self,
        t: Array,
        q: Array,
        v: Array,
        vdot: Array,
        weights: Array,
        preload: Array,
        limits: Array | None,
        least_use: bool,
    ) -> dict[str, Any]:
        """Efforts, multipliers, margin, remainder, null space, rates, gaps and k for a motion, by name."""

    def regressor(
        self,
        seen: Inverse,
        held: list[int],
        t: Array,
        q: Array,
        v: Array,
        vdot: Array,
        names: list[str],
        values: list[list[float]],
        along: list[list[float]],
        channels: str,
    ) -> dict[str, Any]:
        """Along a motion: "values" of channels, JSON, (nt, channels), "derivatives" along the directions `along` of all
        numbers of the parameters (nt, channels, directions), and "gaps"; `seen`: the same actuators and further
        coordinates; `held`: those of them that are measured."""

def least_squares(
    derivatives: Array, residuals: Array, sizes: Array, noise: Array, scales: Array, preference: Array
) -> dict[str, Any]:
    """Identification by least squares: derivatives (nt, channels, n), residuals (nt, channels), root mean squares and
    noise (NaN: from the residuals) of the channels, natural sizes of the parameters, and which are expressed by others
    first. "rank", "base", "dependent", "coefficients", "changes", "base_changes", "base_deviations", "deviations",
    "directions", "direction_deviations", "drowned", "singular", "noise" and "left"."""

def singularities(
    model: Model,
    actuators: Inverse | None,
    outputs: list[Goal],
    t: float,
    goals: list[Goal],
    limits: Array,
    seeds: Array,
    one_branch: bool,
) -> dict[str, Any]:
    """Singular positions of the actuators, or of the outputs, or of the constraints where there is neither, within the
    limits of the goals: "curves" (q, goals, measure, ends), "samples" and "complete". `seeds`: where to begin;
    `one_branch`: to stay on their branch."""

def measures(model: Model, actuators: Inverse, t: float, q: Array) -> dict[str, Any]:
    """At the positions in the rows of q: "actuators" (n, k, s), what each can do without units, "constraints" (n), and
    the "length" of the mechanism."""

class Model:
    """A compiled mechanism: constant; states are handed in."""

    def __init__(self, spec: str, functions: Sequence[Callable[..., Any]], coordinates: str = "relative") -> None:
        """`spec`: JSON of the description; `functions`: what its {"function": i} refer to."""

    def with_parameters(self, changes: list[tuple[str, list[float]]]) -> Model:
        """The same mechanism with other parameters: names and numbers."""

    def recorded(self, parameters: list[str], t: float, q: Array) -> tuple[bytes, str]:
        """The equations as JavaScript with these parameters as inputs; what a page must know of them (JSON)."""

    def parameters(self) -> list[tuple[str, list[float]]]:
        """All parameters with their numbers."""

    def operation_counts(self, t: float, q: Array, inputs: list[int] | None) -> dict[str, dict[str, int]]:
        """Operations of one evaluation at the closed q, by formulation and kind; `inputs` index v."""

    @property
    def description(self) -> str:
        """JSON of the description with its present parameters."""

    @property
    def nq(self) -> int: ...
    @property
    def nv(self) -> int: ...
    @property
    def rows(self) -> int: ...
    @property
    def rank(self) -> int: ...
    @property
    def mobility(self) -> int: ...
    @property
    def planar(self) -> bool: ...
    @property
    def set_valued(self) -> tuple[str, str] | None: ...
    @property
    def summary(self) -> str:
        """JSON: names, sizes and the layout of states."""
    @property
    def calls_functions(self) -> bool:
        """Does it ask functions of the user's?"""

    def initial(self) -> tuple[Array, Array]:
        """q (nq,) of the drawing and v = 0 (nv,)."""

    def assemble(
        self,
        t: float,
        q: Array,
        v: Array,
        targets: list[list[tuple[Goal, float]]],
        rates: list[tuple[int, float]],
        turns: list[tuple[Goal, float]],
        fixed: list[Goal],
        guess: list[tuple[Goal, float]],
        tolerance: float,
    ) -> tuple[Array, Array, str]:
        """q, v that satisfy (S3), (S4) nearest to those given, and a JSON report. Targets by priority; rates index v,
        `turns` are those of coordinates outside of v; `fixed` stays as it is in the guess."""

    def c_functions(
        self, name: str, t: float, q: Array, actuators: list[int] | None, joints: list[int]
    ) -> list[tuple[str, str, str, int]]:
        """Functions in C recorded at the closed position q: name, declaration, text and operations of each. Without
        actuators (velocities) those of the motion, else the map between them and the joints (velocities)."""

    def assemblies(
        self, t: float, q: Array, inputs: list[int] | None
    ) -> tuple[list[tuple[Array, list[int], float]], list[str], list[str]]:
        """(q, branches, residual) of every assembly for the inputs in q; words of the blocks; notes."""

    def poses(
        self, t: float, q: Array, goals: list[Goal], values: Array, grid: Sequence[int] | None = None
    ) -> dict[str, Any]:
        """Positions in which the goals have the values of each row (n, goals), on the branch of the closed position q:
        q (n, nq), reached (n, goals), shortfall, angle, detour (n,), status (n numbers of `words`), reasons
        (number and sentence of each pose that was not assembled), branch (words and sign of each block, or None). A
        goal is its name, "own" (a coordinate of q), "joint", "point" or "turn", the number of the coordinate, joint or
        body, that of the coordinate or axis in it, and numbers: the point in body axes, or the reference orientation
        row by row. The three turns of a body follow each other. Rows of a `grid` of this shape, the last dimension
        fastest, are found from neighbour to neighbour."""

    def ensemble(
        self,
        options: Options,
        t_eval: Array,
        q: Array,
        v: Array,
        parameters: list[tuple[str, int]],
        values: Array,
        assembles: bool,
        workers: int | None,
        progress: Callable[[float], None] | None,
    ) -> dict[str, Any]:
        """Motions of the members: other states in the rows of q and v (one row: for all), other parameters (names and
        how many numbers each has) in the rows of values (members, numbers). `assembles`: members whose parameters open
        the loops are assembled anew. q (members, nt, nq), v, status (words), in_lanes (members,), steps, messages
        (number and sentence of each member that did not finish), refusal (why none ran in lanes, or None)."""

    def rates(
        self, t: float, near: Array, q: Array, goals: list[Goal], rates: Array, accelerations: Array
    ) -> dict[str, Any]:
        """Velocities and accelerations for which the goals move at the rates and accelerations of each row, at the
        closed positions in the rows of q; `near` is a regular one: v, vdot (n, nv), ratios (n, goals, nv), margin (n,),
        missed (goal and what it lacks), determined (n words). The rate of a turn is the angular velocity along an axis
        of the world."""

    def degrees_of_freedom(self, t: float, q: Array) -> tuple[int, int]:
        """Degrees of freedom at the closed position q, and rotations among them that move no other body."""

    def limit(self, t: float, q: Array, goals: list[Goal], to: Array) -> tuple[Array, Array, bool] | None:
        """Where the straight path of the goals from the closed position q to the values `to` ends: q, values of the
        goals, and whether it is located to round-off; None where it does not end."""

    def stationary(self, t: float, q: Array, goals: list[Goal], to: Array, reading: Goal) -> tuple[Array, float] | None:
        """Where `reading` is stationary on the straight path of the goals from the closed position q to the values
        `to`: q and the fraction of the path."""

    def transferred(self, other: Model, q: Array, v: Array) -> tuple[Array, Array]:
        """(q, v) of this model where every body is and moves as in another one of the same description."""

    def linearized(
        self,
        t: float,
        q: Array,
        v: Array,
        efforts: Array,
        independent: list[int] | None = None,
        drives: Sequence[int] = (),
        beside: bool = True,
    ) -> dict[str, Any]:
        """A, B, f0 and their parts about a state, modes, and states beside it for outputs."""

    def equilibrium(self, t: float, q: Array, stable: bool, known: Array) -> dict[str, Any]:
        """The position at rest that a search from the closed position q arrives at, none of the `known` ones in the
        rows."""

    def indifferent(self, t: float, start: Array, end: Array) -> bool:
        """Whether two positions at rest belong to one continuum of them."""

    def resting(self, t: float, q: Array) -> dict[str, Any]:
        """The same of a position at rest that is known."""

    def equilibrium_family(
        self, t: float, q: Array, along: list[tuple[str, list[float], list[float]]], x: float, asked: Array
    ) -> dict[str, Any]:
        """The family of equilibria through q, where parameters have the values of the first list plus x times those
        of the second: positions along it, folds and branchings, positions in which x has the values asked for."""

    def preload(self, t: float, q: Array, unknown: list[tuple[str, tuple[int, int]]]) -> list[list[float]]:
        """Numbers of parameters, their natural sizes by powers of length and energy, with which the closed position q
        is one of rest."""

    def characteristic_displacements(self) -> Array:
        """Size of a large displacement of each velocity (nv,): 1 for an angle, a length otherwise."""

    def displacement_between(self, start: Array, end: Array) -> Array:
        """Displacement (nv,) from one position to another, in characteristic displacements."""

    def displaced(self, t: float, q: Array, displacements: Array) -> Array:
        """q moved by the displacement in each row, its loops closed."""

    def mass_matrix(self, t: float, q: Array) -> Array:
        """M (nv, nv)."""

    def forces(self, t: float, q: Array, v: Array) -> Array:
        """h (nv,)."""

    def constraints(self, t: float, q: Array) -> Array:
        """Phi (rows,)."""

    def jacobian(self, t: float, q: Array) -> Array:
        """C (rows, nv)."""

    def rate(self, t: float, q: Array) -> Array:
        """a (rows,)."""

    def bias(self, t: float, q: Array, v: Array) -> Array:
        """b (rows,)."""

    def acceleration(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """v' (nv,) and multipliers (rows,)."""

    def at(self, t: float, q: Array, v: Array | None) -> dict[str, Any]:
        """S1-S5 and their reduction at one instant, by name."""

    def measure(self, t: float, q: Array) -> Array:
        """rho (nv,)."""

    def simulate(
        self,
        options: Options,
        t_eval: Array,
        q: Array,
        v: Array,
        progress: Callable[[float], None] | None,
        tangent: Any = None,
        step_bytes: int = 0,
        events: EventList | None = None,
    ) -> dict[str, Any]:
        """March from options.t0 to options.t_end; `progress` is called with the fraction done, 0 to 1."""

    def simulate_segments(
        self,
        options: Options,
        t_eval: Array,
        q: Array,
        v: Array,
        progress: Callable[[float], None] | None,
        step_bytes: int,
        events: EventList,
        acts: str,
        decisions: list[tuple[str, Callable[[float, Array, Array], str]]],
    ) -> dict[str, Any]:
        """As `simulate`, where events act: `acts` says which drives hold, and what each event does (JSON); `decisions`
        return such actions at (t, q, v)."""

    def with_more_drives(self, drives: str) -> Model:
        """The same mechanism in the same coordinates with more drives (JSON)."""

    def that_parts(self, joints: list[str]) -> Model:
        """The same mechanism in the same kind of coordinates, with these joints cut, so that events can part them."""

    def evaluation_costs(
        self, options: list[str], steps: list[float], t: Array, q: Array, v: Array, tangent: Any = None
    ) -> list[float]:
        """Seconds of one evaluation for each of the options, at the states (t, q, v), a row each."""

    def motion(
        self, t: Array, q: Array, v: Array, vdot: Array | None = None, multipliers: Array | None = None
    ) -> Motion:
        """A motion through these states, a row each."""

    def suspicious(self) -> list[str]:
        """Data that are possible and unlikely, in sentences."""

    def report(self, t: float, q: Array) -> str:
        """JSON for `Mechanism.report`."""

class Motion:
    """States of a mechanism at nt outputs, kept in the core with what acts there: those of a run, or given ones."""

    @property
    def t(self) -> Array:
        """(nt,)."""

    @property
    def multipliers(self) -> Array:
        """(nt, rows)."""

    def bodies(self, which: list[int] | None = None) -> dict[str, Array]:
        """Poses and twists of the bodies `which`; None: of all."""

    def joints(self, which: list[int] | None = None) -> dict[str, Array]:
        """Coordinates, velocities and points of the joints `which`; None: of all."""

    def joint_accelerations(self, which: list[int] | None = None) -> Array:
        """Accelerations of the degrees of freedom of the joints `which` (nt, dof), in the order of their velocities."""

    def body_accelerations(self, which: list[int]) -> dict[str, Array]:
        """Accelerations of the origins of the bodies `which` and of their turning, world axes."""

    def load(self, number: int) -> dict[str, Array]:
        """Power, potential and effort (NaN: none) of an applied force of the description, (nt,) each, and `point`,
        `force`, `moment` (nt, bodies, 3) of what it does to each body, world axes."""

    def energies(self) -> dict[str, Array]:
        """Kinetic and potential energy."""

    def reaction(self, joint: int) -> dict[str, Array]:
        """Wrench of one joint."""

    def shares_loads(self) -> bool:
        """Is part of the reactions a matter of a rule, for which all joints are asked?"""

    def reactions(self, which: list[int] | None = None) -> dict[str, Array]:
        """Joint wrenches at the outputs `which`; None: at all."""

    def augmented_reactions(self) -> dict[str, Array]:
        """Force and moment (nt, nj, 3) of all joints, by augmented joint coordinates."""

    def checks(self) -> dict[str, Array]:
        """Acceleration closure with its row, worst row of the closure, rank and margin, (nt,) each."""

    def determined(self) -> list[NDArray[np.bool_]]:
        """(nt, nj, 6) in world and in joint axes: which of fx fy fz mx my mz follow from the motion alone; the same of
        the efforts of drives along the degrees of freedom of all joints (nt, dof), and of the multipliers of all
        conditions but the loop closures (nt, conditions)."""

    def self_stresses(self, joint: int) -> Array:
        """(nt, 2, 3, 3): directions (rows) in which self-stresses load a joint by forces and by moments; a component
        along a unit axis is determined where no product with them exceeds 1."""

    def self_stress_basis(self, i: int) -> tuple[Array, Array, float]:
        """Orthonormal self-stresses at output i: wrenches (s, nj, 6) in world axes, efforts of the drives (s, drives),
        and what moments are divided by."""

class SolutionLog:
    """What a run keeps of itself."""

    def describe(self) -> dict[str, Any]:
        """vdot, multipliers, independent, closure, velocity_closure at every output; notes."""

    def assess(self) -> dict[str, Any]:
        """measure, sigma, sqrt_mu at every output, and selector where tangent velocities are frozen."""

    def partitions(self) -> list[dict[str, Any]]:
        """Choices of coordinates, one dictionary each."""

    def work(self) -> Array:
        """Work at every output."""

    def steps_open(self) -> tuple[float, float]:
        """Largest |Phi| and |C v + a| at the ends of accepted steps."""

    def gaps(self) -> tuple[float, float]:
        """The same, relative to sizes."""

    def exchanged(self) -> float:
        """Lower bound of the energy exchanged."""

    def counters(self) -> dict[str, int]:
        """Counts of work."""

    def state(self, t: float) -> tuple[float, Array, Array] | None:
        """t, q and v at a time where a step is kept; elsewhere of the last earlier time at which one is. None where
        there is none."""

    def states(self, times: Array) -> tuple[Array, Array, Array]:
        """The same at these times, a row each; NaN where there is none."""

    def derivatives(
        self, asked: str, times: Array, before: list[bool]
    ) -> tuple[tuple[Array, Array, Array], tuple[list[list[float]], list[list[float]]]]:
        """Of what a text asks, a row for each of these times, `before` of some what happens there: values and rates
        (nt, channels), and derivatives (nt, channels, directions); also values and derivatives of integrals and of
        when something happens."""

    def gradient(self, asked: str, weights: str, times: Array, before: list[bool]) -> Array:
        """Derivatives of a weighed sum of what a text asks, one for each direction, backwards."""

    def observed(self, observables: str, times: Array, before: list[bool]) -> tuple[Array, Array]:
        """Values and rates (nt, channels) of what a text names."""

    def span(self) -> tuple[float, float] | None:
        """When the first step kept begins and the last one ends; None where none is."""

class System:
    """Equations (S1)-(S5) given as callables."""

    def __init__(
        self,
        n: int,
        mass: Callable[[float, Array], Array],
        forces: Callable[[float, Array, Array], Array],
        constraints: Callable[[float, Array], Array],
        jacobian: Callable[[float, Array], Array],
        constraint_rate: Callable[[float, Array], Array] | None,
        bias: Callable[[float, Array, Array], Array],
        names: list[str],
        closing: tuple[Callable[[float, Array], Array], list[int]] | None = None,
        lengths: list[float] | None = None,
        checked: bool = True,
    ) -> None: ...
    @property
    def nq(self) -> int: ...
    @property
    def nv(self) -> int: ...
    def assemble(
        self,
        t: float,
        q: Array,
        v: Array,
        targets: list[tuple[int, float]],
        rates: list[tuple[int, float]],
        tolerance: float,
    ) -> tuple[Array, Array, str]: ...
    def mass_matrix(self, t: float, q: Array) -> Array: ...
    def forces(self, t: float, q: Array, v: Array) -> Array: ...
    def constraints(self, t: float, q: Array) -> Array: ...
    def jacobian(self, t: float, q: Array) -> Array: ...
    def rate(self, t: float, q: Array) -> Array: ...
    def bias(self, t: float, q: Array, v: Array) -> Array: ...
    def acceleration(self, t: float, q: Array, v: Array) -> tuple[Array, Array]: ...
    def at(self, t: float, q: Array, v: Array | None) -> dict[str, Any]:
        """S1-S5 and their reduction at one instant, by name."""
    def measure(self, t: float, q: Array) -> Array: ...
    def simulate(
        self,
        options: Options,
        t_eval: Array,
        q: Array,
        v: Array,
        progress: Callable[[float], None] | None,
        tangent: Any = None,
        step_bytes: int = 0,
        events: EventList | None = None,
    ) -> dict[str, Any]: ...
    def evaluation_costs(
        self, options: list[str], steps: list[float], t: Array, q: Array, v: Array, tangent: Any = None
    ) -> list[float]: ...

def measure(mass: Array, jacobian: Array) -> Array:
    """rho (nv,)."""

def geometry(
    mass: Array, jacobian: Array, fixed: list[int] | None = None, selector: Array | None = None
) -> dict[str, Any]:
    """k, k_constrained, k_tangential, P_c, P_d, M_c, M_d, T_cd, M_s, sqrt_mu, rows; without a selector independent and
    dependent."""

def choose(
    mass: Array,
    jacobian: Array,
    threshold: float,
    weights: Array | None,
    selection: str = "collective",
    fixed: list[int] | None = None,
) -> dict[str, Any]:
    """independent, dependent, A, D, rho, sigma, sqrt_mu, rows."""

def parse_toml(text: str, path: str) -> tuple[str, str]:
    """JSON of the document, and JSON of {"body": [where each begins, in bytes]} for the lists in it."""

def toml_line(text: str, pointer: str) -> int | None:
    """Line, from 1, of the key that a JSON pointer names, or of the nearest one around it."""

def reaction_findings(t: Array, residual: Array, asked: tuple[float, bool]) -> list[tuple[bool, float, str]]:
    """What Newton-Euler residuals (nt,) say, for a tolerance and conditions that drift or not: broken, t,
    sentence."""

def energy_findings(
    t: Array, energies: tuple[Array, Array, Array], tolerance: float, steps: int, least: float
) -> list[tuple[bool, float, str]]:
    """What kinetic and potential energy and work (nt,) say together, for a tolerance: broken, t, sentence."""

def energy_floor(description: str, atol: float) -> float:
    """Energy [J] against which the balance of a mechanism is held at the least."""

METHODS: tuple[str, ...]
FORMULATIONS: tuple[str, ...]
SELECTIONS: tuple[str, ...]
"""Words that options may be, the default first."""

def increasing(times: object, t0: float, t_end: float) -> Array | None:
    """Times that increase from t0 to t_end, as a flat array; None for others."""

def version() -> str: ...
def tapes(
    model: Model,
    t: float,
    q: Array,
    inputs: list[tuple[int, int | None]],
    first: list[float],
    counts: list[int],
    parameters: list[tuple[str, int]],
    independent: list[int] | None,
    observed: str,
) -> tuple[dict[str, tuple[Any, ...]], list[int], list[str]]:
    """The equations as tapes in the coordinates chosen at the closed position q, or in those named: "motion", "closed"
    and "residual", each (codes, operands, constants, outputs, names and sizes of parts of its outputs, tables); also
    the independent velocities, and names of operations. Inputs: force and component, or a drive; `first` their numbers
    as for a stepper; `counts` how many numbers of each are inputs. `observed`: what is observed beside, JSON."""
