"""Prescribed poses: translations and an orientation over time, constant, as a table or as a function."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import EvaluationError
from ..numeric import floats, shown
from ..products import det, matmul, norm
from ..state import Layout
from ..tolerance import EQUAL
from .checks import Array, Element, shape_of, takes, vector
from .frames import as_pair, is_rotation, rotation, transform
from .motion import RoughError, differences
from .pieces import Pieces, Refusals
from .taylor import Jet
from .travelling import check_picklable
from .values import BY_DEFAULT, Constant, Cubics, Curve, Function, Table, finite, one_number, table

_HALF_TURN = math.pi * (1.0 - 1e-6)
"""Between rows of a table farther apart the direction of rotation is ambiguous. Scale: rad. Reason: half a turn, but
for six digits."""
_SHORT = 1e-2
"""A cotangent is replaced by its series below this. Scale: half an angle. Reason: the remainder is below rounding,
which the quotient multiplies by ten thousand."""
_SERIES = 0.1
"""Quotients are computed by series below this. Scale: square of half an angle. Reason: the remainder is below
rounding."""


@dataclass(frozen=True)
class Held:
    """A constant pose: translations (k,) and the rotation matrix."""

    slides: Array
    matrix: Array


@dataclass(frozen=True)
class PoseTable:
    """Poses at times (n,): slides (n, k) and matrices (n, 3, 3). Joined by "monotone" cubics, whose counterpart for
    rotations is `monotone_turns`; or by a "spline", whose counterpart has continuous angular accelerations."""

    times: Array
    slides: Array
    matrices: Array
    curve: Curve

    def slide(self, i: int) -> Table:
        """Translation number i over time."""
        return Table(self.times, self.slides[:, i], self.curve)

    def turning(self) -> dict[str, Any]:
        """The curve of rotations as the core needs it: rotation vectors by cubics, applied after quaternions."""
        if self.curve == "monotone":
            pieces = monotone_turns(self.times, self.matrices)
        else:
            spline = transform().RotationSpline(self.times, transform().Rotation.from_matrix(self.matrices))
            pieces = spline.interpolator.c
        vectors = [Cubics(self.times, pieces[:, :, i].T).spec()["table"] for i in range(3)]
        quaternions = transform().Rotation.from_matrix(self.matrices[:-1]).as_quat()[:, [3, 0, 1, 2]]
        return {"table": {"vectors": vectors, "rotations": quaternions.tolist()}}


@dataclass(frozen=True)
class PoseFunction:
    """A pose by a Python function, part by part."""

    pose: Pose
    slides: int

    def slide(self, i: int) -> Function:
        """Translation number i over time."""
        return Function(_Slide(self.pose, i))

    def turning(self) -> Function:
        """The orientation over time."""
        return Function(_Turning(self.pose))


PoseValue = Held | PoseTable | PoseFunction


def monotone_turns(times: Array, matrices: Array) -> Array:
    """Rotation vectors (4, n - 1, 3) by cubics, highest power first, from each rotation to the next: PCHIP for
    rotations, and PCHIP where all are about one axis.

    The angular velocity at a sample is the weighted harmonic mean of the mean rates a before and b after it,
    `(w1 + w2) (a . b) c / |c|^2` with `c = w1 b + w2 a`, and zero where they point apart.
    """
    rotations = transform().Rotation.from_matrix(matrices)
    steps = (rotations[:-1].inv() * rotations[1:]).as_rotvec()
    h = np.diff(times)
    mean = steps / h[:, None]
    rates = np.zeros((len(times), 3))
    for i in range(1, len(h)):
        a, b, (w1, w2) = mean[i - 1], mean[i], (2.0 * h[i] + h[i - 1], h[i] + 2.0 * h[i - 1])
        along, c = float(matmul(a, b)), w1 * b + w2 * a
        if along > 0.0:
            rates[i] = (w1 + w2) * along * c / (matmul(c, c))
    # three-point estimates at the ends, not faster than three times the mean rate, not backwards
    for end, one, two in ((0, 0, 1), (len(h), len(h) - 1, len(h) - 2)):
        rates[end] = mean[one]
        if len(h) > 1:
            guess = ((2.0 * h[one] + h[two]) * mean[one] - h[one] * mean[two]) / (h[one] + h[two])
            along, size = float(matmul(guess, mean[one])), float(norm(guess))
            if along <= 0.0:
                guess = np.zeros(3)
            elif matmul(mean[one], mean[two]) <= 0.0:
                guess = guess * min(1.0, 3.0 * float(norm(mean[one])) / size)
            rates[end] = guess
    first = rates[:-1]
    last = np.array([_vector_rate(step, rate) for step, rate in zip(steps, rates[1:], strict=True)])
    wide = h[:, None]
    cubic, square = (first + last - 2.0 * mean) / wide**2, (3.0 * mean - 2.0 * first - last) / wide
    return np.array([cubic, square, first, np.zeros_like(first)])


def _vector_rate(vector: Array, spin: Array) -> Array:
    """Rate of a rotation vector whose rotation turns with an angular velocity in the axes that turn."""
    angle = float(norm(vector))
    half = 0.5 * angle
    # (1 - half cot half) / angle^2, by its series near zero
    factor = (1.0 - half / math.tan(half)) / angle**2 if half > _SHORT else (1.0 + half**2 / 15.0) / 12.0
    across = np.cross(vector, spin)
    return np.asarray(spin + 0.5 * across + factor * np.cross(vector, across), dtype=float)


def pose_value(element: Element, given: Any, slides: int, drawn: tuple[Array, Array] | None, curve: Curve) -> PoseValue:
    """A pose as given by the user, for a joint with this many translations. `drawn`: position and rotation of a body as
    drawn, to which its joint is relative, while the pose is given in the world. `curve`: how a table is joined."""
    if callable(given):
        return PoseFunction(Pose(element, given, slides, drawn), slides)
    parts = _parts(element, given, slides)
    if len(parts) == 2:
        position = vector(element, "the position of the pose", parts[0], "m", slides) if slides else np.zeros(0)
        matrix = orientation(element, "the orientation of the pose", parts[1])
        return Held(*_relative(position, matrix, drawn))
    times, positions, turns = parts
    matrices = np.array(
        [orientation(element, f"orientation {i}", turn) for i, turn in enumerate(_each(element, turns))]
    )
    placed = table(element, "positions", (times, positions), curve, ("s", "m"), slides) if slides else None
    clock = (
        placed.times if placed is not None else table(element, "orientations", (times, times), curve, ("s", "s")).times
    )
    if len(matrices) != clock.size:
        element.fail(f"there are {clock.size} times but {len(matrices)} orientations; give one for each")
    where = placed.values if placed is not None else np.zeros((clock.size, 0))
    pairs = [_relative(p, m, drawn) for p, m in zip(where, matrices, strict=True)]
    found = PoseTable(clock, np.array([p for p, _ in pairs]), np.array([m for _, m in pairs]), curve)
    steps = transform().Rotation.from_matrix(found.matrices)
    angles = (steps[:-1].inv() * steps[1:]).magnitude()
    if angles.max() > _HALF_TURN:
        row = int(angles.argmax())
        element.fail(
            f"from t = {clock[row]:g} s to t = {clock[row + 1]:g} s the table rotates by half a turn, so the "
            f"direction of rotation is ambiguous; insert a row between them"
        )
    return found


def as_given(element: Element, given: Any, slides: int) -> Any:
    """A pose as it was given, in SI, in the form that `pose_value` accepts."""
    if callable(given):
        return given
    match pose_value(element, given, slides, None, BY_DEFAULT["position"]):
        case Held(positions, matrix):
            return (positions, matrix) if slides else matrix
        case PoseTable(times, positions, matrices):
            return (times, positions, matrices) if slides else (times, matrices)
    return given


def _parts(element: Element, given: Any, slides: int) -> tuple[Any, ...]:
    """(position, orientation) or (times, positions, orientations)."""
    if as_pair(given) is not given:
        return as_pair(given) if slides else (None, given.rotation)
    if isinstance(given, tuple) and len(given) == 2 and as_pair(given[1]) is not given[1]:
        return (given[0], *as_pair(given[1])) if slides else (given[0], None, given[1].rotation)
    if isinstance(given, Mapping):
        for keys in (("times", "positions", "orientations"), ("position", "orientation")):
            wanted = [key for key in keys if slides or not key.startswith("position")]
            if set(given) == set(wanted):
                return tuple(given.get(key) for key in keys)
    elif isinstance(given, tuple) and len(given) == 3 and slides:
        return given
    elif isinstance(given, tuple) and len(given) == 2:
        return given if slides else (given[0], None, given[1])
    elif not slides and (is_rotation(given) or shape_of(given) in ((3,), (4,), (3, 3))):
        return (None, given)
    word = "(position, orientation)" if slides else "an orientation"
    rows = "(times, positions, orientations)" if slides else "(times, orientations)"
    element.fail(f"pose must be {word}, a table {rows}, or a function of t that returns {word}, not {shown(given)}")


def _each(element: Element, turns: Any) -> list[Any]:
    if is_rotation(turns):
        if turns.single:
            element.fail("orientations contains one rotation; give one for each time")
        return list(turns)
    if shape_of(turns) is None or len(shape_of(turns) or ()) < 2:
        element.fail(f"orientations must be a list of rotations, not {shown(turns)}")
    return list(turns)


def orientation(element: Element, what: str, value: Any) -> Array:
    """A rotation matrix from all that `frames.rotation` takes, or a rotation vector."""
    if shape_of(value) == (3,):
        return np.asarray(
            transform().Rotation.from_rotvec(vector(element, what, value, "rad")).as_matrix(), dtype=float
        )
    return rotation(element, what, value)


def _relative(position: Array, matrix: Array, drawn: tuple[Array, Array] | None) -> tuple[Array, Array]:
    return (position, matrix) if drawn is None else (position - drawn[0], matmul(matrix, drawn[1].T))


class Pose:
    """f(t) -> (position, orientation) with rates and accelerations.

    Exact where f takes a `Jet` (arithmetic, NumPy functions) and returns a rotation vector, a quaternion or a matrix.
    Where it does not (a SciPy `Rotation`) polynomials in `Pieces` through positions and rotation matrices take their
    place; where these are not smooth enough, differences of order 8: of positions, and of the rotation vector that
    leads away from the orientation at t. Its first two derivatives there are the angular velocity and the
    angular acceleration in the axes that turn: no angle is unwrapped, and no position is singular.
    """

    def __init__(
        self, element: Element, function: Callable[..., Any], slides: int, drawn: tuple[Array, Array] | None
    ) -> None:
        self.element, self.function, self.slides, self.drawn = element, function, slides, drawn
        self.notes: list[str] = []
        self._last: tuple[float, tuple[list[tuple[float, float, float]], list[float]]] | None = None
        self._pieces: Pieces | None = None
        self._refusals = Refusals(self._exactly, self._plain)
        takes(element, "its function", function, "one argument, t", 1)
        self.at(0.0)

    def __getstate__(self) -> dict[str, Any]:
        check_picklable(self.element, "function of the pose", self.function)
        return {**self.__dict__, "_last": None, "_pieces": None, "_refusals": None}

    def __setstate__(self, stored: dict[str, Any]) -> None:
        self.__dict__.update(stored, _refusals=Refusals(self._exactly, self._plain))

    def __deepcopy__(self, memo: dict[int, Any]) -> Pose:
        """With the same function, which was tested before: Python copies functions as themselves."""
        twin = Pose.__new__(Pose)
        twin.__dict__.update(self.__dict__, notes=list(self.notes), _last=None, _pieces=None)
        twin._refusals = Refusals(twin._exactly, twin._plain)
        memo[id(self)] = twin
        return twin

    def at(self, t: float) -> tuple[list[tuple[float, float, float]], list[float]]:
        """Translations with two derivatives; rotation row by row, angular velocity and acceleration in its axes.

        The components of one pose are requested one by one at the same time: the last result, which depends on t alone,
        is cached.
        """
        last = self._last
        if last is None or last[0] != t:
            try:
                last = self._last = (t, self._found(t))
            except _NoPoseError as error:
                # the reason is named here alone: the error raised is public
                raise EvaluationError(str(error), t=t, where=self.element.name) from error.__cause__
        return last[1]

    def _found(self, t: float) -> tuple[list[tuple[float, float, float]], list[float]]:
        found = None
        if not self._refusals.at(t):
            try:
                found = self._exactly(t)
            except _NoPoseError:
                raise
            except Exception:  # whatever a user's function does when it meets a number of a kind it does not know
                pass
        if found is None:
            found = self._nearly(t)
        slides, (matrix, spin, growth) = found
        if self.drawn is not None:
            slides = [(x - x0, v, a) for (x, v, a), x0 in zip(slides, self.drawn[0], strict=True)]
            matrix, spin, growth = (
                matmul(matrix, self.drawn[1].T),
                matmul(self.drawn[1], spin),
                matmul(self.drawn[1], growth),
            )
        turned = [*matrix.ravel().tolist(), *spin.tolist(), *growth.tolist()]
        if not (finite(turned) and all(finite(slide) for slide in slides)):
            raise self._error(
                t, "position, orientation and their derivatives are not finite; the function must be smooth"
            )
        return slides, turned

    def _exactly(self, t: float) -> tuple[list[tuple[float, float, float]], tuple[Array, Array, Array]]:
        position, turn = self._split(self.function(Jet(t, 1.0, 0.0)), t)
        slides = [(j.x, j.d1, j.d2) for j in map(_jet, position)]
        if is_rotation(turn):
            raise TypeError("a Rotation carries no derivatives")
        numbers = np.array(turn, dtype=object)
        jets = [_jet(item) for item in numbers.ravel()]
        if numbers.shape == (3, 3):
            value, first, second = (
                np.array([getattr(j, part) for j in jets]).reshape(3, 3) for part in ("x", "d1", "d2")
            )
            matrix = self._matrix(value, t)
            skew, bent = matmul(matrix.T, first), matmul(matrix.T, second)
            spin = _axial(skew)
            return slides, (matrix, spin, _axial(bent))
        if numbers.shape == (3,):
            quaternion = _of_vector(jets)
        elif numbers.shape == (4,):
            norm = (jets[0] * jets[0] + jets[1] * jets[1] + jets[2] * jets[2] + jets[3] * jets[3]).sqrt()
            if not norm.x > 0.0:
                raise self._misshaped(t, "the zero quaternion, which is not a rotation")
            quaternion = [j / norm for j in jets]
        else:
            raise self._misshaped(t, f"an array of shape {numbers.shape}")
        value, first, second = (np.array([getattr(j, part) for j in quaternion]) for part in ("x", "d1", "d2"))
        matrix = np.asarray(transform().Rotation.from_quat(value[[1, 2, 3, 0]]).as_matrix(), dtype=float)
        # q' = q w / 2, q'' = q (w w / 2 + w') / 2, and w w is a number
        return slides, (matrix, 2.0 * _seen(value, first), 2.0 * _seen(value, second))

    def _nearly(self, t: float) -> tuple[list[tuple[float, float, float]], tuple[Array, Array, Array]]:
        """By polynomials through positions and matrices, or else by differences."""
        here, matrix = self._plain(t)
        if self._pieces is None:
            self._pieces = Pieces(self._numbers, np.array([0.0] * self.slides + [1.0] * 9))
        found = self._pieces.at(t, np.concatenate([here, matrix.ravel()]))
        if found is None:
            return self._by_differences(t, here, matrix)
        self._note(float(found.error.max()), t)
        slides = [(float(here[i]), float(found.first[i]), float(found.second[i])) for i in range(self.slides)]
        rate, bend = (part[self.slides :].reshape(3, 3) for part in (found.first, found.second))
        return slides, (matrix, _axial(matmul(matrix.T, rate)), _axial(matmul(matrix.T, bend)))

    def _numbers(self, t: float) -> Array:
        """Position and matrix."""
        position, matrix = self._plain(t)
        return np.concatenate([position, matrix.ravel()])

    def _by_differences(
        self, t: float, here: Array, matrix: Array
    ) -> tuple[list[tuple[float, float, float]], tuple[Array, Array, Array]]:
        seen: dict[float, Array] = {}

        def moved(s: float) -> Array:
            if s not in seen:
                position, other = self._plain(s)
                seen[s] = np.concatenate(
                    [position, transform().Rotation.from_matrix(matmul(matrix.T, other)).as_rotvec()]
                )
            return seen[s]

        def component(i: int) -> Callable[[float], float]:
            return lambda s: float(moved(s)[i])

        try:
            # the entries of rotation matrices are 1, however small the rotation between them
            scales = [0.0] * self.slides + [1.0] * 3
            found = [differences(component(i), t, size) for i, size in enumerate(scales)]
        except _NoPoseError:
            raise
        except RoughError as error:
            raise self._error(t, f"the pose cannot be differentiated: {error}; give one that is smooth") from error
        except Exception as error:
            raise self._error(
                t,
                "the function works there but not slightly before or after, where its derivatives are evaluated "
                f"({type(error).__name__}: {error}); use NumPy functions and return a rotation vector or a quaternion",
            ) from error
        self._note(max(f[3] for f in found), t)
        slides = [(float(here[i]), found[i][1], found[i][2]) for i in range(self.slides)]
        turns = found[self.slides :]
        return slides, (matrix, np.array([f[1] for f in turns]), np.array([f[2] for f in turns]))

    def _note(self, error: float, t: float) -> None:
        """Report once that derivatives are not exact."""
        if self.notes:
            return
        self.notes.append(
            f'drive "{self.element.name}": the pose could not be differentiated exactly, so its derivatives are '
            f"differences of high order of its values, good to about {error:.0e} in the second derivative at "
            f"t = {t:g} s; use NumPy functions, and return a rotation vector, a quaternion or a matrix, not a SciPy "
            "Rotation"
        )

    def _plain(self, t: float) -> tuple[Array, Array]:
        position, turn = self._split(self.function(t), t)
        try:
            where = np.array([one_number(item) for item in position])
        except TypeError as error:
            raise self._misshaped(t, f"a position with {error}") from error
        if is_rotation(turn):
            if not turn.single:
                raise self._misshaped(t, f"{len(turn)} rotations")
            return where, np.asarray(turn.as_matrix(), dtype=float)
        try:
            numbers = floats(turn)
        except (TypeError, ValueError) as error:
            raise self._misshaped(t, f"the orientation {shown(turn)}") from error
        if numbers.shape == (3,):
            return where, np.asarray(transform().Rotation.from_rotvec(numbers).as_matrix(), dtype=float)
        if numbers.shape == (4,) and np.any(numbers):
            return where, np.asarray(transform().Rotation.from_quat(numbers[[1, 2, 3, 0]]).as_matrix(), dtype=float)
        if numbers.shape == (3, 3):
            return where, self._matrix(numbers, t)
        raise self._misshaped(t, f"the orientation {shown(turn)}")

    def _split(self, value: Any, t: float) -> tuple[Any, Any]:
        pair = as_pair(value)
        if self.slides == 0:
            return (), value if pair is value else pair[1]
        value = pair
        if not isinstance(value, tuple | list) or len(value) != 2 or shape_of(value[0]) == ():
            raise self._misshaped(t, shown(value))
        position = list(np.asarray(value[0], dtype=object).ravel())
        if len(position) != self.slides:
            raise self._misshaped(t, f"{len(position)} numbers for the position")
        return position, value[1]

    def _matrix(self, matrix: Array, t: float) -> Array:
        off = float(np.abs(matmul(matrix.T, matrix) - np.eye(3)).max())
        if not off <= EQUAL or det(matrix) < 0.0:
            what = f"a matrix that is not a rotation (its columns deviate from orthonormal by {off:.1e})"
            raise self._misshaped(t, what)
        return matrix

    def _misshaped(self, t: float, what: str) -> EvaluationError:
        wanted = f"(position, orientation), the position as {self.slides} numbers" if self.slides else "an orientation"
        return _NoPoseError(
            f'drive "{self.element.name}" at t = {t:g} s: the function must return {wanted}, the orientation as '
            f"rotation vector, quaternion (w, x, y, z), matrix or SciPy Rotation; it returned {what}",
            t=t,
            where=self.element.name,
        )

    def _error(self, t: float, sentence: str) -> EvaluationError:
        name = self.element.name
        return EvaluationError(f'drive "{name}" at t = {t:g} s: {sentence}', t=t, where=name)


class _NoPoseError(EvaluationError):
    """A function returned something other than a pose, whatever its argument."""


class _Slide:
    """One translation of a pose, as the core calls it."""

    notes: list[str]

    def __init__(self, pose: Pose, i: int) -> None:
        self.pose, self.i, self.notes = pose, i, []

    def bind(self, layout: Layout) -> Callable[[float], tuple[float, float, float]]:
        """Itself: a prescribed motion does not depend on the state."""
        return self

    def __call__(self, t: float) -> tuple[float, float, float]:
        return self.pose.at(t)[0][self.i]


class _Turning:
    """The orientation of a pose, in the form that the core needs."""

    def __init__(self, pose: Pose) -> None:
        self.pose = pose

    @property
    def notes(self) -> list[str]:
        """The notes of the whole pose."""
        return self.pose.notes

    def bind(self, layout: Layout) -> Callable[[float], list[float]]:
        """Itself: a prescribed motion does not depend on the state."""
        return self

    def __call__(self, t: float) -> list[float]:
        return self.pose.at(t)[1]


def turning_of(value: PoseValue) -> dict[str, Any] | Function:
    """The orientation of a pose as the core needs it; a function must still be bound."""
    return {"held": value.matrix.tolist()} if isinstance(value, Held) else value.turning()


def slide_of(value: PoseValue, i: int) -> Constant | Table | Function:
    """Translation number i of a pose."""
    return Constant(float(value.slides[i])) if isinstance(value, Held) else value.slide(i)


def _jet(value: Any) -> Jet:
    return value if isinstance(value, Jet) else Jet(one_number(value))


def _axial(matrix: Array) -> Array:
    """The vector of the skew part."""
    return 0.5 * np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])


def _seen(q: Array, rate: Array) -> Array:
    """Vector part of conj(q) rate."""
    return np.asarray(q[0] * rate[1:] - rate[0] * q[1:] - np.cross(q[1:], rate[1:]), dtype=float)


def _of_vector(vector: list[Jet]) -> list[Jet]:
    """The quaternion of a rotation vector."""
    half = [component * 0.5 for component in vector]
    square = half[0] * half[0] + half[1] * half[1] + half[2] * half[2]
    x = square.x
    if x > _SERIES:
        root = math.sqrt(x)
        cosine, sine = math.cos(root), math.sin(root) / root
        first = (cosine - sine) / (2.0 * x)
        second = (-0.5 * sine - 3.0 * first) / (2.0 * x)
    else:
        cosine, sine, first, second = (_series(x, k) for k in range(4))
    over = square.chain(sine, first, second)
    return [square.chain(cosine, -0.5 * sine, -0.5 * first), *(component * over for component in half)]


def _series(x: float, what: int) -> float:
    """cos(sqrt x), sin(sqrt x)/sqrt x, and the first two derivatives of the latter over x."""
    if what == 0:
        return sum((-x) ** n / math.factorial(2 * n) for n in range(8))
    terms = [(-1.0) ** n / math.factorial(2 * n + 1) for n in range(9)]
    return float(np.polynomial.Polynomial(terms).deriv(what - 1)(x)) if what > 1 else float(np.polyval(terms[::-1], x))
