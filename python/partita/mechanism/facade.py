"""The facade: `Mechanism`, its description and its methods."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING, Any

from .. import options
from ..builder.explained import explain
from ..builder.records import DRAWING_TOLERANCE
from ..comparison import compare_mechanism
from ..io import Reading, RemarkGroup, Writing, save
from ..numeric import MaybeNone
from . import models, seen, solve
from . import stepper as stepping
from .assemblies import assemblies
from .check import check
from .cycle import cycle
from .ensemble import ensemble
from .equilibrium import equilibria, equilibrium
from .exporting import export_c
from .fmu import to_fmu
from .gradient import gradient
from .inverse import inverse_dynamics
from .kinematics import kinematics
from .linear import linearize
from .models import Modelled
from .placement import placement
from .playground import to_playground
from .poses import assemble_many
from .preload import preload
from .report import report
from .singularities import singularities
from .unknown import unknown
from .workspace import workspace


class Mechanism(Modelled):
    """Rigid bodies, joints, forces and drives: a description that can be compiled and simulated.

    SI units and radians (see `partita.units`). Data of joints are in world axes, in the drawn position; data of bodies
    are in body axes. If a loop does not quite close in the drawing, `assemble` closes it.

    Args:
        name: shown in reports and results.
        gravity: acceleration of gravity in world axes [m/s^2]: three numbers; a direction such as "-z": 9.81 m/s^2
            along it; None: no gravity; or, if it varies, in the forms of a force in `add_force`: components that are
            tables (times, values) or functions f(t, state), one table (times (n,), values (n, 3)), or one function that
            returns three numbers. Varying gravity has no potential; its power counts as work.
        drawing_tolerance: allowed geometric error of the drawing, in radians and in fractions of the characteristic
            lengths (0 to 0.01). If moving joint frames by at most twice this amount lets an over-constrained mechanism
            move, it is repaired when it is compiled; `report`, the notes of a result and its certificate name the
            changes. 0: every digit is taken literally.

    Raises:
        DescriptionError: the name is not text, gravity is not three finite numbers, or drawing_tolerance is not a
            number from 0 to 0.01.

    >>> import partita as pt
    >>> m = pt.Mechanism("four-bar")
    >>> crank = m.add_rod("crank", start=(0, 0, 0), end=(0, 0.3, 0), mass=0.3)
    >>> coupler = m.add_rod("coupler", start=(0, 0.3, 0), end=(0.8, 0.7, 0), mass=0.9)
    >>> rocker = m.add_rod("rocker", start=(1, 0, 0), end=(0.8, 0.7, 0), mass=0.7)
    >>> a = m.add_revolute("A", m.ground, crank, point=(0, 0, 0))
    >>> b = m.add_revolute("B", crank, coupler, point=(0, 0.3, 0))
    >>> c = m.add_revolute("C", coupler, rocker, point=(0.8, 0.7, 0))
    >>> d = m.add_revolute("D", m.ground, rocker, point=(1, 0, 0))
    >>> m
    Mechanism('four-bar': 3 bodies, 4 joints, 0 drives, 0 forces)
    >>> m.compile().mobility
    1
    """

    reading: Reading | MaybeNone = None
    """What became of the file that it was read from (`load`): used, changed, dropped; None where it was drawn."""

    def __init__(
        self, name: str, gravity: Any = (0.0, -9.81, 0.0), *, drawing_tolerance: float = DRAWING_TOLERANCE
    ) -> None:
        super().__init__(name, gravity, drawing_tolerance)

    @property
    def remarks(self) -> tuple[RemarkGroup, ...]:
        """Remarks on the file that it was read from, equal ones together, those that change the motion first; see
        `Reading.remarks`."""
        return () if self.reading is None else self.reading.remarks

    compile = models.compile
    assemble = solve.assemble
    assemblies = assemblies
    assemble_many = assemble_many
    kinematics = kinematics
    convert = solve.convert
    simulate = solve.simulate
    ensemble = ensemble
    gradient = gradient
    inverse_dynamics = inverse_dynamics
    inputs = property(stepping.inputs)
    stepper = stepping.stepper
    compare = compare_mechanism
    equilibrium = equilibrium
    equilibria = equilibria
    preload = preload
    cycle = cycle
    linearize = linearize
    singularities = singularities
    workspace = workspace
    placement = placement
    report = report
    check = check
    to_fmu = to_fmu
    export_c = export_c
    to_playground = to_playground
    show = seen.show
    plot = seen.plot
    to_html = seen.to_html
    _repr_html_ = seen._repr_html_

    if not TYPE_CHECKING:  # a type checker knows what there is

        def __getattr__(self, name: str) -> Any:
            if name.startswith("_"):
                raise AttributeError(name)
            raise unknown(type(self), name)

    def save(self, path: str | PathLike[str], *, strict: bool = False) -> Writing:
        """Write a model file; the suffix says which kind: .toml, which holds all of it and which `partita.load` reads
        back to the last bit; .urdf, with a .yaml beside it where loops are closed; .mjcf or .xml (MuJoCo's MJCF);
        .usda, .usd or .usdc (USD physics).

        Robots' formats hold bodies, joints, loops, springs of joints and couplers of two joints (docs/robots.md). The
        returned `Writing` lists changes and losses; for losses a `LossyFileWarning` is issued as well. Numbers are
        written with all their digits. Each file is written completely or not at all.

        Args:
            path: the file; an existing one is replaced.
            strict: raise an error instead of a warning if the format cannot represent the model.

        Raises:
            DescriptionError: a force or drive is a Python function, which a file cannot contain; use a table.
            FileFormatError: there is no writer for this suffix, or, if `strict`, something would be lost.
            MissingFileError: the folder does not exist.

        >>> import os, tempfile
        >>> import partita as pt
        >>> m = pt.Mechanism("pendulum")
        >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
        >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     written = m.save(os.path.join(folder, "pendulum.toml"))
        ...     pt.load(os.path.join(folder, "pendulum.toml")).bodies
        ...     m.save(os.path.join(folder, "pendulum.mjcf"), strict=True).changed[0][:35]
        <bodies: rod>
        'body "rod" has mass 1 kg, moments 2'
        """
        return save(self, path, options.yes_or_no("strict", strict))


explain(
    Mechanism, "assemble", "assemble_many", "kinematics", "simulate", "stepper", "equilibrium", "cycle", "linearize"
)
