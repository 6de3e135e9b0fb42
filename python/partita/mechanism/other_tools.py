"""The methods `export_casadi`, `to_jax` and `to_sympy`: the equations in tools that take derivatives themselves."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ..analyses.still import run_of
from ..builder.compiled import CompiledModel
from ..builder.joints import scalars
from ..builder.records import Description, TorqueRecord
from ..builder.values import Constant
from ..errors import ArgumentError
from ..extras import wanted as importable
from ..naming import index_of
from ..numeric import is_list, shown
from ..options import velocities, yes_or_no
from ..replay import CasadiEquations, JaxEquations, Output, Recorded, SympyEquations, Tape
from ..results.run import Run
from ..results.sensitivities import Observing
from ..sensing.instant import StateSignals
from ..state import State
from .inputs import Courses, Input, inputs_of
from .models import Modelled, layout_of
from .set_valued import without_holding
from .solve import assemble, convert

_DERIVATIVES = {"effort": ("",), "position": ("", ".rate", ".acceleration")}
_OF_RATES = ("", ".acceleration")
_AXES = "xyz"
_WHOLE = ("v", "vdot", "multipliers", "phi", "excess")
_SYMBOLIC = ("mass", "inertia", "stiffness", "damping")


def export_casadi(
    self: Modelled,
    *,
    inputs: Iterable[Any] = (),
    parameters: Iterable[str] = (),
    outputs: Iterable[str] = (),
    independent: Iterable[str] | None = None,
    initial: State | None = None,
    closing_rate: float = 0.0,
) -> CasadiEquations:
    """Return the equations of motion as CasADi functions of (t, x, u, p), whose derivatives CasADi takes itself.

    Prefer it for optimal control, for estimation and for fitting parameters; `simulate` and `ensemble` are faster and
    change coordinates where needed. The state is x = (q, v_I): all coordinates, and the independent velocities of one
    choice of coordinates, the one that a run would begin with at `initial`. `rates` is x'; `close` corrects the
    dependent coordinates, `velocities` gives all velocities, `residual` is M, h, C, a, b, phi for all of q and v as
    variables. Needs CasADi: `pip install 'partita[casadi]'`.

    Args:
        inputs: u. Names of torques and forces that are numbers (`m.inputs`; "F.x" for a component), an effort [N m, N];
            of joints with one coordinate, an effort along it, at first 0; of drives of a position three numbers (value,
            NAME.rate, NAME.acceleration), of a rate two (value, NAME.acceleration). Of a driven position x holds what u
            prescribes: `close` makes it so. Forces and drives come before joints of the same name.
        parameters: p. Names of numbers as in `m.compile().parameters`; those of several become "A.point.x", ...
        outputs: "BODY.position" (3), "BODY.rotation" (3, 3), "JOINT.point" (3), "JOINT.force" and "JOINT.moment" (3) on
            its child, or one component, "JOINT.force.x"; "energy.kinetic", "energy.potential", "v", "vdot",
            "multipliers", "phi"; all in world axes, SI. Also sensors, which come first where names are the same, if
            they read positions, rates or forces. "excess" is above 0 where the choice of coordinates does not serve.
        independent: names of the independent velocities; None: the best choice at `initial`.
        initial: a state on the branch of the loops; None: the drawing, assembled, at rest.
        closing_rate: rate [1/s] at which `rates` reduces closure errors by a first-order term, for integrators that
            cannot call `close`; choose some ten times the fastest rate of the motion. 0: none.

    Raises:
        MissingDependencyError: CasADi is not installed.
        UnknownNameError: there is no such input, parameter or output.
        ArgumentError: an output is a reaction that the motion does not determine; an effort is asked of what a drive
            prescribes; names or numbers of the wrong kind.
        DescriptionError: elements that cannot be recorded, by name: Python functions, friction that follows reactions,
            elements that hold at times; parameters of a repaired drawing; a degree of freedom that moves no mass.
        AssemblyError: the loops do not close. SingularityError: a singular position.

    It takes milliseconds, and some ten microseconds for each operation when a function is first used
    (`operations`); a table costs five choices for each of its intervals.

    >>> import partita as pt
    >>> m = pt.catalogue.load("four-bar")
    >>> f = m.export_casadi(inputs=["A"], parameters=["coupler.mass"], outputs=["D.force.x"])
    >>> f.rates
    Function(rates:(t,x[4],u,p)->(xdot[4]) SXFunction)
    >>> f.state_names, f.inputs, f.parameters
    (('A', 'D', 'B', "A'"), ('A',), ('coupler.mass',))
    >>> f.rates(x=f.x0, u=f.u0, p=f.p0)["xdot"].shape
    (4, 1)
    >>> f.rates.jacobian().name_out(1)
    'jac_xdot_x'
    """
    importable(("casadi",), "casadi", "export_casadi")
    made = _recorded(self, inputs, parameters, outputs, independent, initial, "export_casadi")[0]
    return CasadiEquations(made, _rate(closing_rate))


def to_jax(
    self: Modelled,
    *,
    inputs: Iterable[Any] = (),
    parameters: Iterable[str] = (),
    outputs: Iterable[str] = (),
    independent: Iterable[str] | None = None,
    initial: State | None = None,
    closing_rate: float = 0.0,
) -> JaxEquations:
    """Return the equations of motion as pure JAX functions of (t, x, u, p) in 64 bits, for `jit`, `vmap` and `grad`.

    Prefer it to run many members inside an engine that exists in JAX (diffrax, a learning loop), and for gradients
    through motions; `ensemble` is faster on a processor without an accelerator. The state is x = (q, v_I): all
    coordinates, and the independent velocities of one choice of coordinates. `rates(t, x, u, p)` is x', `close`
    corrects the dependent coordinates, `velocities` gives all velocities, `further` the outputs, `residual` the
    equations in all velocities. Needs JAX: `pip install 'partita[jax]'`, and before the call
    `jax.config.update("jax_enable_x64", True)`.

    Args, errors and names are those of `export_casadi`.

    Derivatives through choices (contacts, stops, tables) are those of the branch that is taken, never NaN from the
    other. The functions are straight lines of scalar operations, which XLA compiles once for each shape: on one core
    about a tenth of a second for a four-bar, a few seconds for 2000 operations (`operations`), five to ten times that
    for a Jacobian by `jacfwd`; keep what `jit` returns.

    >>> import partita as pt
    >>> import jax
    >>> jax.config.update("jax_enable_x64", True)
    >>> f = pt.catalogue.load("planar-pendulum").to_jax(parameters=["bob.mass"])
    >>> f.state_names, f.rates(0.0, f.x0).shape
    (('pivot', "pivot'"), (2,))
    >>> slope = jax.jit(jax.jacfwd(f.rates, argnums=1))(0.0, f.x0)
    >>> slope.shape
    (2, 2)
    """
    importable(("jax",), "jax", "to_jax")
    made = _recorded(self, inputs, parameters, outputs, independent, initial, "to_jax")[0]
    return JaxEquations(made, _rate(closing_rate))


def to_sympy(
    self: Modelled,
    *,
    symbols: Iterable[str] | Mapping[str, Any] | None = None,
    inputs: Iterable[Any] = (),
    initial: State | None = None,
    simplify: bool = True,
) -> SympyEquations:
    """Return the equations of motion in SymPy's symbols: M, h, C, a, b, Phi of M v' = h + C^T lambda. In a notebook
    they are displayed as formulas.

    Prefer it for teaching and for checks on paper, for mechanisms of a few bodies; numbers are faster by `compile`,
    derivatives by `export_casadi`. Needs SymPy: `pip install 'partita[sympy]'`.

    Args:
        symbols: which parameters (`m.compile().parameters`) are symbols: a list of names, or a dict that says what each
            is: a name for a symbol, an expression or a number of SymPy, for parameters of several numbers a list of
            these. Numbers of a listed parameter that are 0 stay 0. None: gravity, masses, inertias, stiffnesses,
            dampings; geometry is numbers.
        inputs: as in `export_casadi`, symbols u.
        initial: as in `export_casadi`.
        simplify: write products of sines and cosines by sums of angles, and common factors before the rest. False: as
            recorded, which is faster.

    Raises:
        MissingDependencyError: SymPy is not installed.
        UnknownNameError: there is no such parameter or input.
        ArgumentError: the equations written out have more than 200000 operations; names of the wrong kind.
        DescriptionError, AssemblyError, SingularityError: as `export_casadi`.

    It takes a second for a four-bar. Numbers have 12 digits, of which LaTeX shows 4. Formulas of more than 4000
    operations are not simplified.

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum", gravity="-y")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=3.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> f = m.to_sympy(symbols={"gravity": (0, "-g", 0), "rod.mass": "m", "rod.com": ("l", 0, 0)})
    >>> f.M[0], f.h[0]
    (l**2*m + 1/4, -g*l*m*cos(q_{A}))
    """
    importable(("sympy",), "sympy", "to_sympy")
    model = layout_of(self, "relative")[0]
    known = _known(model)
    chosen: dict[str, Any]
    if symbols is None:
        massless = {name for name, values in known.items() if name.endswith(".mass") and not np.any(values)}
        massless = {name.removesuffix(".mass") for name in massless}
        repaired = bool(model.summary.get("repaired"))
        chosen = {
            name: None
            for name, values in known.items()
            if (name == "gravity" or name.rpartition(".")[2] in _SYMBOLIC)
            and len(values) in (1, 3, 9)
            and np.any(values)
            and name.rpartition(".")[0] not in massless
            and not repaired
        }
    elif isinstance(symbols, Mapping):
        chosen = {str(name): what for name, what in symbols.items()}
    else:
        chosen = dict.fromkeys(_listed("symbols", symbols))
    made, present = _recorded(self, inputs, chosen, (), None, initial, "to_sympy", "symbols")
    return SympyEquations(made, chosen, present, yes_or_no("simplify", simplify))


def _rate(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= sys.float_info.max:
        raise ArgumentError(f"closing_rate must be a number from 0 up, not {shown(value)}", argument="closing_rate")
    return float(value)


def _listed(what: str, given: Any) -> list[str]:
    if not is_list(given):
        raise ArgumentError(f"{what} must be a list of names, not {shown(given)}", argument=what)
    names = [str(name) for name in given]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise ArgumentError(f"{what}: {twice!r} is named twice", argument=what)
    return names


def _known(model: CompiledModel) -> dict[str, Any]:
    """All parameters with their numbers."""
    return {name: np.array(values, dtype=float) for name, values in model.core.parameters()}


def _recorded(
    self: Modelled,
    inputs: Iterable[Any],
    parameters: Iterable[str],
    outputs: Iterable[str],
    independent: Iterable[str] | None,
    initial: State | None,
    caller: str,
    argument: str = "parameters",
) -> tuple[Recorded, dict[str, Any]]:
    """What is replayed, and the numbers of the parameters."""
    if initial is not None and not isinstance(initial, State):
        raise ArgumentError(f"initial must be a State, not {shown(initial)}", argument="initial")
    without_holding(self, caller)
    start = assemble(self) if initial is None else convert(self, initial, "relative")
    description, acting = _prepared(self._description, _listed("inputs", inputs))
    changed = Modelled(self.name, (0.0, 0.0, 0.0), self.drawing_tolerance)
    changed._description = description
    model, layout = layout_of(changed, "relative")
    q, v = start.q, start.v
    if start.names != model.names:
        q, v = model.core.transferred(layout_of(self, "relative")[0].core, start.q, start.v)
    state = State(start.t, q, v, layout=layout)
    model.core.acceleration(state.t, state.q, state.v)  # refuses what has no accelerations there, by name
    courses = Courses(acting, model)
    first = courses.first(StateSignals(model.core, state.t, state.q, state.v, model.summary))[0]
    names, u0, counts = _numbers_of(acting, first)
    present = _parameters(model, _listed(argument, parameters), acting, argument)
    fixed = None
    if independent is not None:
        known = model.velocity_names
        fixed = [known.index(name) for name in velocities("independent", independent, known)]
    varied = [(name, len(values)) for name, values in present.items()]
    wanted_outputs = _listed("outputs", outputs)
    observed, sensed = _observed(model, state, [name for name in wanted_outputs if name in model.sensors])
    raw, chosen, operations = model._taped(
        state.t, state.q, courses.indices, first.tolist(), counts, varied, fixed, json.dumps(observed)
    )
    tapes = {name: Tape.of(operations, one) for name, one in raw.items()}
    shown_outputs = [sensed.get(name) or _output(model, tapes["motion"], name) for name in wanted_outputs]
    _determined(model, state, shown_outputs)
    own = layout_of(self, "relative")[0]
    made = Recorded(
        mechanism=self.name,
        tapes=tapes,
        q_names=tuple(model.names),
        v_names=tuple(model.velocity_names),
        v_independent=tuple(chosen),
        inputs=tuple(names),
        parameters=tuple(_flat(present)),
        outputs=tuple(shown_outputs),
        rows=tuple(model.row_names),
        t0=float(state.t),
        x0=np.concatenate([state.q, state.v[chosen]]),
        u0=np.array(u0, dtype=float),
        p0=np.concatenate([np.zeros(0), *present.values()]),
        fits=lambda one: one.is_of(own.summary) or one.is_of(model.summary),
    )
    return made, present


def _prepared(d: Description, names: list[str]) -> tuple[Description, dict[str, Input]]:
    """The mechanism with a torque for each joint that is an input, and the inputs."""
    copy, found = d.copy(), dict[str, Input]()
    known = inputs_of(d)
    joints = [name for name, joint in d.joints.items() if scalars(joint) == 1 and name not in known]
    for name in names:
        choice = [*known, *joints]
        name = choice[index_of(name, choice, "input")]
        if name in known:
            found[name] = known[name]
            continue
        drive = next((each.name for each in d.drives.values() if each.measure.get("joint") == name), None)
        if drive is not None:
            raise ArgumentError(
                f"inputs: {name!r} is driven by {drive!r}, so an effort there moves nothing; name the drive, or remove "
                "it",
                argument="inputs",
            )
        own = f"input {name}"
        while own in copy.forces:
            own += "'"
        copy.store(copy.forces, TorqueRecord(own, name, 0, Constant(0.0)))
        found[name] = Input(own, 0)
    return copy, found


def _numbers_of(acting: Mapping[str, Input], first: Any) -> tuple[list[str], list[float], list[int]]:
    """Names and present values of the numbers of u, and how many each input has."""
    names, values, counts = list[str](), list[float](), list[int]()
    place = 0
    for name, one in acting.items():
        suffixes = _DERIVATIVES.get(one.level, _OF_RATES)
        if one.component is not None:
            values.append(float(first[place]))
            place += 1
        else:
            # the course: since when, value, rate, ...
            values += [float(first[place + 1]), float(first[place + 2]), 0.0][: len(suffixes)]
            place += 5
        names += [f"{name}{suffix}" for suffix in suffixes]
        counts.append(len(suffixes))
    return names, values, counts


def _parameters(model: CompiledModel, names: list[str], acting: Mapping[str, Input], argument: str) -> dict[str, Any]:
    known = _known(model)
    found = {}
    for name in names:
        name = list(known)[index_of(name, list(known), "parameter")]
        owner = name.rpartition(".")[0]
        if any(one.component is not None and one.name == owner and name.endswith(".value") for one in acting.values()):
            raise ArgumentError(f"{argument}: {name} is an input; it cannot be a parameter too", argument=argument)
        found[name] = known[name]
    return found


def _flat(present: Mapping[str, Any]) -> list[str]:
    """A name for each number."""
    found = list[str]()
    for name, values in present.items():
        if len(values) == 1:
            found.append(name)
        else:
            found += [f"{name}.{_AXES[i] if len(values) == 3 else i}" for i in range(len(values))]
    return found


def _output(model: CompiledModel, tape: Tape, name: str) -> Output:
    if name in _WHOLE:
        return Output(name, name, 0, (tape.spans[name][1],))
    if name in ("energy.kinetic", "energy.potential"):
        return Output(name, "energy", int(name == "energy.potential"), ())
    of, _, part = name.rpartition(".")
    bodies = {each["name"]: i for i, each in enumerate(model.summary["bodies"])}
    joints = {each["name"]: i for i, each in enumerate(model.summary["joints"])}
    match part:
        case "position" | "rotation" if of in bodies:
            at = 12 * bodies[of]
            return Output(name, "bodies", at, (3,)) if part == "position" else Output(name, "bodies", at + 3, (3, 3))
        case "point" if of in joints:
            return Output(name, "joints", 3 * joints[of], (3,))
        case "force" | "moment" if of in joints:
            return Output(name, "reactions", 6 * joints[of] + (0 if part == "force" else 3), (3,))
        case "x" | "y" | "z" if of.rpartition(".")[0] in joints and of.endswith((".force", ".moment")):
            joint, _, kind = of.rpartition(".")
            at = 6 * joints[joint] + 3 * (kind == "moment") + _AXES.index(part)
            return Output(name, "reactions", at, ())
    known = [f"{body}.{part}" for body in bodies for part in ("position", "rotation")]
    known += [f"{joint}.{part}" for joint in joints for part in ("point", "force", "moment")]
    known += ["energy.kinetic", "energy.potential", *_WHOLE, *model.sensors]
    return _output(model, tape, known[index_of(name, known, "output")])


def _instant(model: CompiledModel, state: State) -> Run:
    """The state as a run of one output."""
    vdot, multipliers = model.core.acceleration(state.t, state.q, state.v)
    return run_of(Run, model, np.array([state.t]), state.q[None], state.v[None], vdot[None], multipliers[None])


def _observed(model: CompiledModel, state: State, names: list[str]) -> tuple[list[Any], dict[str, Output]]:
    """Sensors as what the core observes, and where each is found among them."""
    found, sensed = list[Any](), dict[str, Output]()
    if not names:
        return found, sensed
    observing = Observing(_instant(model, state))
    for name in names:
        one = observing.sensor(name)
        sensed[name] = Output(name, "sensors", len(found), (len(one),) if isinstance(one, list) else ())
        found += one if isinstance(one, list) else [one]
    return found, sensed


def _determined(model: CompiledModel, state: State, outputs: list[Output]) -> None:
    """Refuse reactions that the motion does not determine."""
    reactions = [output for output in outputs if output.part == "reactions"]
    if not reactions:
        return
    run = _instant(model, state)
    for output in reactions:
        number, at = divmod(output.first, 6)
        joint = model.summary["joints"][number]["name"]
        kind = "force" if at < 3 else "moment"
        known = np.asarray(run.joint(joint).determined, dtype=bool)
        asked = range(at, at + (output.shape or (1,))[0])
        missing = [_AXES[i % 3] for i in asked if not known[i]]
        if missing:
            rest = [f"{joint}.{kind}.{_AXES[i % 3]}" for i in asked if known[i]]
            raise ArgumentError(
                f"outputs: the motion does not determine the {kind} of joint {joint!r} along {', '.join(missing)}, "
                "because constraints are redundant (report says which); "
                + (f"take the other components, {', '.join(rest)}" if rest else "free one of them, or leave it out"),
                argument="outputs",
            )
