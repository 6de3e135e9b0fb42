"""Modes of a linearisation: eigenvalues, frequencies, shapes, and where the energy is."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..extras import extra
from ..notebook import table
from ..numeric import shown
from ..options import one_of

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

    from ..plots.files import PathLike

SHOWN = 12
"""Modes that are shown before the rest is counted."""

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


class Shapes(Protocol):
    """The motion of joints and bodies that belongs to displacements (m, nv) of the state."""

    @property
    def names(self) -> Sequence[str]:
        """Names of the displacements."""

    def joints(self, displacements: Array) -> dict[str, Array]:
        """Changes of the coordinates of each joint, (m, dof) by name."""

    def kinetic(self, displacements: Array) -> dict[str, Array]:
        """Kinetic energy of each body at velocities equal to these displacements, (m,) by name."""

    def elastic(self, displacements: Array) -> dict[str, tuple[Array, str | None]]:
        """Strain energy of each spring at these displacements, (m,) by name, and the joint that it is in."""

    def animated(self, displacement: ComplexArray, amplitude: float, period: float) -> Any:
        """A `Result` of one period of the motion along a displacement."""


@dataclass(frozen=True, eq=False, repr=False)
class Mode:
    """One real eigenvalue, or a conjugate pair.

    Attributes:
        number: place among the modes.
        eigenvalue: complex; of a pair the one with positive imaginary part [1/s].
        frequency: |eigenvalue| / (2 pi) of a pair [Hz], 0 without oscillation.
        damping: damping ratio -Re / |eigenvalue|; 0 for a zero eigenvalue, negative where it grows.
        kind: "oscillating", "decaying", "growing" or "zero".
        motion: the joint coordinate that moves most.
        displacements: change of each displacement (nv,), complex: amplitudes with phases.
    """

    number: int
    eigenvalue: complex
    frequency: float
    damping: float
    kind: str
    motion: str
    displacements: ComplexArray

    def __repr__(self) -> str:
        return f"<mode {self.number}: {'zero, ' if self.kind == 'zero' else ''}{_words(self)}>"


class Modes:
    """Modes of linearised equations of motion, the slowest first.

    Attributes:
        eigenvalues: all eigenvalues of A, complex (nx,).
        modes: one `Mode` for each real eigenvalue and each conjugate pair.
        frequency: natural frequencies [Hz] of the modes, 0 where one does not oscillate.
        damping: their damping ratios.
        zero: how many eigenvalues are zero: free motions, and cyclic coordinates.
    """

    def __init__(self, eigenvalues: ComplexArray, modes: tuple[Mode, ...], shapes: Shapes) -> None:
        self.eigenvalues, self.modes, self._shapes = eigenvalues, modes, shapes
        self.frequency: Array = np.array([mode.frequency for mode in modes])
        self.damping: Array = np.array([mode.damping for mode in modes])
        self.zero = sum(1 for value in eigenvalues if value == 0.0)

    @classmethod
    def of(cls, found: Mapping[str, Any], shapes: Shapes) -> Modes:
        """From the core's eigenvalues and displacements."""
        values = np.asarray(found["real"]) + 1j * np.asarray(found["imaginary"])
        moved = np.asarray(found["shape_real"]) + 1j * np.asarray(found["shape_imaginary"])
        small = float(found["zero"])
        values = np.where(np.abs(values) <= small, 0.0, values)
        # half of a pair stands for both; of the zeros each one is named
        kept = [i for i, value in enumerate(values) if value.imag >= 0.0]
        modes = []
        for number, i in enumerate(kept):
            value, size = complex(values[i]), abs(values[i])
            motion = _largest(shapes, moved[i])
            scale = np.abs(moved[i]).max(initial=0.0) or 1.0
            pair = value.imag != 0.0
            kind = "zero" if size == 0.0 else "oscillating" if pair else "growing" if value.real > 0.0 else "decaying"
            modes.append(
                Mode(
                    number,
                    value,
                    size / (2.0 * math.pi) if pair else 0.0,
                    (0.0 - value.real) / size if size else 0.0,  # 0, not -0, without damping
                    kind,
                    motion,
                    moved[i] / scale,
                )
            )
        return cls(values, tuple(modes), shapes)

    def __len__(self) -> int:
        return len(self.modes)

    def __iter__(self) -> Iterator[Mode]:
        return iter(self.modes)

    def __getitem__(self, number: int) -> Mode:
        return self.modes[self._number(number)]

    def shape(self, number: int) -> dict[str, ComplexArray]:
        """Amplitude of every joint coordinate in a mode, complex (dof,) by the name of the joint: |z| is the amplitude,
        its angle the phase; the displacement of the state that is largest has the amplitude 1."""
        moved = self[number].displacements
        found = self._shapes.joints(np.array([moved.real, moved.imag]))
        return {name: np.asarray(parts[0] + 1j * parts[1]) for name, parts in found.items()}

    def energy(self, number: int, of: str = "bodies") -> dict[str, float]:
        """Shares in the energy of a mode by name, averaged over a cycle; they add up to 1 (to 0 where nothing is
        strained).

        Args:
            number: of the mode.
            of: "bodies": of the kinetic energy; "springs": of the strain energy 1/2 k d^2 of springs and torsion
                springs, d the change of their length or angle; "joints": the same of the springs in each joint.

        >>> import partita as pt
        >>> m = pt.catalogue.load("four-bar-spring")
        >>> modes = m.linearize(m.equilibrium()).modes()
        >>> modes.energy(0, of="springs")
        {'diagonal': 1.0}
        """
        wanted = one_of("of", of, ("bodies", "springs", "joints"))
        moved = self[number].displacements
        both = np.array([moved.real, moved.imag])
        if wanted == "bodies":
            parts = {name: float(part.sum()) for name, part in self._shapes.kinetic(both).items()}
        else:
            parts = {}
            for name, (part, joint) in self._shapes.elastic(both).items():
                owner = name if wanted == "springs" else joint
                if owner is not None:
                    parts[owner] = parts.get(owner, 0.0) + float(part.sum())
        total = sum(parts.values()) or 1.0
        return {name: part / total for name, part in parts.items()}

    def plot(self, path: PathLike | None = None) -> Figure:
        """The eigenvalues in the complex plane, and of each mode the shares of bodies and of springs in its energy.

        Args:
            path: also write the figure to this file.

        Returns the Matplotlib figure; `MissingDependencyError` without Matplotlib.

        >>> import partita as pt
        >>> m = pt.catalogue.load("four-bar-spring")
        >>> figure = m.linearize(m.equilibrium()).modes().plot()
        >>> [ax.get_xlabel() for ax in figure.axes]
        ['real part [1/s]', 'share of the kinetic energy', 'share of the strain energy']
        """
        from ..plots.modes import plot_modes

        return plot_modes(self, path)

    def to_xarray(self) -> xarray.Dataset:
        """Frequencies, damping and shapes along "mode", with the shares of energy, as an `xarray.Dataset`; real and
        imaginary parts along "part". `MissingDependencyError` without xarray."""
        xarray = extra("xarray", "xarray", "to_xarray")

        def parts(values: ComplexArray) -> Array:
            return np.stack([values.real, values.imag], axis=-1)

        count, names = len(self), list(self._shapes.names)
        shapes = np.array([mode.displacements for mode in self.modes], dtype=complex).reshape(count, len(names))
        data: dict[str, Any] = {
            "eigenvalue": (
                ("mode", "part"),
                parts(np.array([mode.eigenvalue for mode in self.modes])),
                {"units": "1/s"},
            ),
            "frequency": ("mode", self.frequency, {"units": "Hz"}),
            "damping": ("mode", self.damping, {"units": "1", "long_name": "damping ratio"}),
            "kind": ("mode", np.array([mode.kind for mode in self.modes], dtype=str)),
            "shape": (("mode", "displacement", "part"), parts(shapes)),
        }
        labels: dict[str, Any] = {"mode": np.arange(count), "displacement": names, "part": ["real", "imaginary"]}
        for what, axis in (("bodies", "body"), ("springs", "spring")):
            shares = [self.energy(i, of=what) for i in range(count)]
            known = list(shares[0]) if shares else []
            data[f"{axis}_energy"] = (("mode", axis), np.array([[one[k] for k in known] for one in shares]))
            labels[axis] = np.array(known, dtype=str)
        return xarray.Dataset(data, coords=labels)

    def to_html(self, path: Any, number: int = 0, *, amplitude: float = 0.3, period: float = 2.0, **drawn: Any) -> Any:
        """Write a page with the animated motion of a mode, its loops closed.

        Args:
            path: the page.
            number: of the mode.
            amplitude: the largest displacement, in radians or fractions of the size of the mechanism.
            period: shown length of one period [s].
            drawn: `shapes` and `points`, as in `Result.to_html`.

        Returns the path. Raises `AssemblyError` where the loops do not close with such an amplitude.

        >>> import os, tempfile
        >>> import partita as pt
        >>> m = pt.catalogue.load("four-bar-spring")
        >>> modes = m.linearize(m.equilibrium()).modes()
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     modes.to_html(os.path.join(folder, "mode.html")).name
        'mode.html'
        """
        mode = self[number]
        rate = f": {mode.frequency:.4g} Hz, shown with a period of {period:g} s" if mode.frequency else ""
        shown_as = f"mode {mode.number}{rate}"
        moved = self._shapes.animated(mode.displacements, amplitude, period)
        return moved.to_html(path, title=drawn.pop("title", shown_as), **drawn)

    def _number(self, number: int) -> int:
        wanted = operator.index(number)
        if not -len(self.modes) <= wanted < len(self.modes):
            raise ArgumentError(
                f"there is no mode {shown(number)}; there are {len(self.modes)}, numbered from 0", argument="number"
            )
        return wanted

    def __repr__(self) -> str:
        lines = [f"<Modes: {len(self.modes)}, of them {sum(m.kind == 'zero' for m in self.modes)} zero"]
        lines += [f"  {mode!r}" for mode in self.modes[:SHOWN]]
        if len(self.modes) > SHOWN:
            lines.append(f"  ... and {len(self.modes) - SHOWN} more")
        return "\n".join(lines) + ">"

    def _repr_html_(self) -> str:
        """A small table, in a notebook."""
        rows = [(f"mode {mode.number}", _words(mode)) for mode in self.modes[:SHOWN]]
        more = len(self.modes) - SHOWN
        return table("Modes", [*rows, *([("", f"and {more} more")] if more > 0 else [])])


def _words(mode: Mode) -> str:
    if mode.kind == "zero":
        return f"free motion of {mode.motion}"
    if mode.frequency:
        return f"{mode.frequency:.6g} Hz, damping {mode.damping:.3g}, mostly {mode.motion}"
    return f"{mode.kind}, {mode.eigenvalue.real:.6g} /s, mostly {mode.motion}"


def _largest(shapes: Shapes, moved: ComplexArray) -> str:
    """Name of the displacement that is largest."""
    return shapes.names[int(np.argmax(np.abs(moved)))] if moved.size else ""
