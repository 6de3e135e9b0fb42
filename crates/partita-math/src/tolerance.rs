//! The tolerances that several modules share: one constant for one meaning, free of units.
//!
//! A constant of a single algorithm stays in its file. Every constant states its meaning, its scale, and the reason for
//! its size. Lengths are measured in characteristic lengths, coordinates in characteristic displacements, rows of C and
//! velocities in natural scales.

// ---- rounding of numbers

/// Numbers that differ by less are equal to rounding. Scale: fraction of the size of the numbers. Reason: some units in
/// the last place; an exactly flat polygon and a closed loop have such an error.
pub const ROUNDING: f64 = 4.0 * f64::EPSILON;
/// Sums that come out smaller are rounding. Scale: fraction of their terms. Reason: some tens of terms, each rounded.
pub const SUM_ROUNDING: f64 = 1e-14;
/// Solutions of linear equations, and positions at the end of a chain of frames, that come out smaller are rounding.
/// Scale: fraction of the terms they are sums of. Reason: a thousand units in the last place, for equations of moderate
/// condition.
pub const SOLUTION_ROUNDING: f64 = 1e-13;
/// Rounding next to the worst admissible position. Scale: fraction of the quantities that are added up. Reason: 1e-16
/// times a condition of 1e9, the reciprocal of [`REDUNDANT`].
pub const WORST_ROUNDING: f64 = 1e-7;
/// Numbers nearer than this are one after some ten operations. Scale: fraction of the largest of them. Reason: a unit
/// in the last place or two for each; products of some ten frames, and nodes of a step, are off by as much.
pub const TEN_ROUNDINGS: f64 = 16.0 * f64::EPSILON;
/// Results of thousands of operations, and moments of inertia, that come out smaller are rounding. Scale: fraction of
/// their terms. Reason: ten thousand roundings, as for closed loops; moments are differences of products.
pub const LONG_ROUNDING: f64 = 1e-12;

// ---- numbers that were given

/// Given numbers that differ by less are intended to be equal. Scale: fraction of their size; radians for axes. Reason:
/// ten printed digits have this error, far above rounding.
pub const EQUAL: f64 = 1e-9;
/// Directions and values that differ by less are equal to six digits. Scale: fraction of their size; radians for
/// directions. Reason: the sixth digit.
pub const EQUAL_IN_SIX_DIGITS: f64 = 1e-6;
/// Directions are parallel, perpendicular or in a plane up to this. Scale: sine of the angle. Reason: directions in
/// double precision, rotated a few times; it moves no position by more than [`CLOSED`].
pub const PARALLEL: f64 = 1e-12;
/// Directions that are off by less were intended to be parallel or perpendicular. Scale: multiples of the drawing
/// tolerance. Reason: both may be off by one, and errors of several joints add up along a loop.
pub const INTENDED_PARALLEL: f64 = 4.0;
/// Directions that cross at less define no plane or point of their own. Scale: sine of the angle. Reason: a tenth of a
/// degree; three digits of what they define are lost.
pub const AXES_CROSS: f64 = 2e-3;
/// Below this angle series replace quotients. Scale: rad. Reason: quotients lose two digits there, and the remainder of
/// the series is below rounding.
pub const SERIES_ANGLE: f64 = 0.1;
/// Below this a rotation is computed by two terms of its series. Scale: rad. Reason: the remainder, of the sixth power,
/// is below rounding.
pub const SHORT_TURN: f64 = 1e-3;
/// Largest reliable angle measured from a pose. Scale: rad. Reason: a little less than half a turn, so that no step
/// passes unseen the point where the angle jumps by a turn.
pub const HALF_TURN: f64 = 3.0;

// ---- closed positions

/// A loop is closed if its error is below this. Scale: characteristic displacement. Reason: ten thousand times the
/// round-off of one number; sums along loops of a thousand links stay below.
pub const CLOSED: f64 = 1e-12;
/// Conditions that are redundant, or that compete with others, are satisfied if their error is below this. Scale: size
/// of the row. Reason: ten times [`CLOSED`], so that closed positions pass.
pub const FITS: f64 = 1e-11;
/// Largest residual of a position that no iteration closed: computed in closed form, or drawn. Scale: characteristic
/// displacement. Reason: round-off, amplified a hundred thousand times next to a limit position; twelve digits of a
/// drawing.
pub const CLOSED_FORM: f64 = 1e-10;
/// Constraint violations below this count as closed over a whole run. Scale: size of the row. Reason: the accuracy
/// required of whole runs.
pub const CLOSED_IN_RUN: f64 = 1e-9;
/// Conditions with a larger error belong to another position. Scale: size of the row. Reason: a hundredth can still be
/// treated as small; no step closes more.
pub const FAR_OPEN: f64 = 1e-2;
/// Constraint violations above this count as open. Scale: size of the row. Reason: a thousand times [`CLOSED_IN_RUN`],
/// so that badly conditioned rows stay below.
pub const OPEN: f64 = 1e-6;
/// Rows with a larger closure error are open. Scale: multiples of their own round-off. Reason: an assembly leaves a
/// thousandth of it.
pub const OPEN_ROUNDINGS: f64 = 1e4;
/// Violations of constraint rates above this count as open. Scale: fraction of the fastest velocity. Reason: next to a
/// singular position the root of [`OPEN`]; conditions on rates alone must satisfy [`OPEN`].
pub const OPEN_RATE: f64 = 1e-3;
/// Accelerations with a larger error violate a condition. Scale: fraction of the strongest acceleration. Reason: tables
/// through exact points err there by the square of their spacing.
pub const OPEN_ACCELERATION: f64 = 1e-2;
/// Drift of conditions that are not corrected. Scale: multiples of the relative tolerance. Reason: the error of a step,
/// added up over the steps of a motion and grown with it.
pub const DRIFT: f64 = 1e4;
/// Errors up to this are explained by the tolerance. Scale: multiples of the tolerance. Reason: errors of steps grow
/// with the motion by two digits, and the estimates that steps are accepted by are off by a few.
pub const ERROR_GROWTH: f64 = 100.0;
/// What is off by less adds no error that is seen. Scale: fraction of the tolerance. Reason: hundreds of such errors add
/// up to less than one tolerance.
pub const NEGLIGIBLE_ERROR: f64 = 1e-3;
/// Velocities are consistent when conditions on them are met to this. Scale: fraction of the fastest velocity requested
/// or prescribed. Reason: of sixteen digits a condition of a million leaves ten.
pub const RATES_MET: f64 = 1e-9;

// ---- rank

/// Pivots of a symmetric matrix below this are lost. Scale: fraction of the diagonal entry they came from (for rows, a
/// squared sine). Reason: a hundred roundings of a sum of squares.
pub const LOST_PIVOT: f64 = 1e-14;
/// Rows below this are combinations of the others. Scale: squared sine, in natural scales. Reason: rounding in an
/// assembled position leaves about 1e-16 times the condition; true redundancy is seen at 1e-20 to 1e-25.
pub const REDUNDANT: f64 = 1e-9;
/// Least ratio between the last pivot kept and the first one dropped. Scale: ratio of squared sines. Reason: one and a
/// half digits of the sine.
pub const RANK_GAP: f64 = 1e3;
/// Singular values below this are null. Scale: fraction of the largest. Reason: of sixteen digits a condition of a
/// million leaves ten.
pub const NULL_VALUE: f64 = 1e-10;
/// Derivatives and singular values computed from differences are rounding below this. Scale: fraction of the largest of
/// them. Reason: the root of rounding.
pub const DIFFERENCE_ROUNDING: f64 = 1e-8;
/// Rows, columns and equations below this add nothing to the others. Scale: fraction of the largest. Reason: results
/// computed from the remaining ones keep ten digits.
pub const DEPENDENT: f64 = 1e-6;
/// Components below this take no part. Scale: fraction of the largest. Reason: round-off of closing and solving stays
/// below, and six digits show no less.
pub const TAKES_PART: f64 = 1e-6;
/// Components below this are zero. Scale: fraction of the largest. Reason: far above rounding, and below every
/// displayed digit.
pub const NEGLIGIBLE: f64 = 1e-9;
/// Damping of least-change and least-norm steps. Unit: squares of singular values in natural scales. Reason: rows
/// weaker than its root, 1e-5, count as repeated; a singular loop is closed by displacements of at most 5e4 residuals.
pub const DAMPING: f64 = 1e-10;
/// A position counts as singular below this distance from a singular one. Scale: fraction of the distance at the ends
/// of the step. Reason: beside it velocities are exact to 1e-12 and accelerations to 1e-8; nodes of a crossing step keep
/// ten times as far from it.
pub const AT_SINGULARITY: f64 = 1e-3;
/// Of two distances (from a singular position, from two branches) or changes one is much smaller below this. Scale:
/// ratio. Reason: half a digit, which outweighs a change of rows and the error of a prediction; rounding grows by its
/// square, a digit.
pub const MUCH_SMALLER: f64 = 0.3;
/// No ordinary step, and no tick, may end nearer to a singular position. Scale: distance in natural scales. Reason:
/// rounding of the closure over the square of the distance leaves six digits of rates, and none a little nearer.
pub const LANDED: f64 = 1e-5;
/// Larger errors of positions, or of dimensions, decide between branches. Scale: squared distance from the singular
/// position. Reason: two branches x y = 0 with an error e become x y = e, whose arms lead from one to the other at the
/// distance sqrt(2 e).
pub const BRANCH_BY_ERROR: f64 = 0.1;
/// A change of velocities counts above this. Scale: fraction of the fastest velocity, or of all. Reason: one block of
/// many that passes to its other branch is seen, and so is a load that becomes active.
pub const VISIBLE_CHANGE: f64 = 0.1;
/// Pivots below this mean that the constraints have lost rank. Scale: natural scales. Reason: rounding (1e-16) is then
/// amplified to 1e-9 in one evaluation, the accuracy required of whole runs.
pub const SINGULAR_PIVOT: f64 = 1e-7;
/// Of two measures the larger one must lead by this. Scale: fraction of the measure. Reason: round-off, and with it
/// units, cannot decide between equals.
pub const TIE: f64 = 1e-9;
/// Of two measures one is clearly larger by this factor. Scale: ratio. Reason: one digit.
pub const CLEARLY: f64 = 10.0;
/// A mobility, or the gain of an exchange of rows or coordinates, has grown by this. Scale: ratio. Reason: one bit is
/// lost; below, no choice changes.
pub const DOUBLED: f64 = 2.0;
/// A choice of coordinates with a smaller volume than another is too weak. Scale: ratio of volumes. Reason: it leads to
/// dead points, and has σ below this, because `σ ≤ 1 / max |Â|`.
pub const WEAK_CHOICE: f64 = 0.05;

// ---- moves and steps

/// Slower rates count as rest. Scale: characteristic displacements per second. Reason: in a run of hours the
/// displacement remains invisible.
pub const STANDING: f64 = 1e-10;
/// Displacements below this end an iteration. Scale: characteristic displacement. Reason: the next displacement of
/// Newton's method would be its square, below round-off.
pub const LAST_MOVE: f64 = 1e-9;
/// An iteration whose error decreases by less does not converge, or has reached rounding. Scale: ratio of successive
/// errors or steps. Reason: Newton's method at least halves them, also next to a singular position, and collocation
/// gains a digit or two.
pub const CONVERGES: f64 = 0.5;
/// A direction, a length, a prediction or a pivot that loses more of itself from one position to the next does not
/// continue, and neither does a value where a change loses less over ever shorter times. Scale: fraction of itself.
/// Reason: more than half of a direction belongs to others then; a pivot may pass zero in one more step; no geometric
/// error changes a length by as much, and no smooth function changes by as much at once.
pub const HALF_LOST: f64 = 0.5;
/// A continuation ends where steps of this length do not succeed. Scale: characteristic displacement. Reason: the end
/// is then known to six digits.
pub const SHORTEST_STEP: f64 = 1e-6;
/// A step within this factor of what is left goes to the end. Scale: ratio of steps. Reason: no sliver is left behind.
pub const TO_THE_END: f64 = 1.01;
/// Step of a finite motion by which rank is verified. Unit: characteristic displacement. Reason: short enough to stay
/// on its branch; a closure error of order p is a power p of it, far above rounding.
pub const RANK_MOVE: f64 = 0.1;
/// Longest step towards a target in closed form. Unit: characteristic displacement. Reason: no angle of a healthy loop
/// turns by pi meanwhile.
pub const STRIDE: f64 = 0.1;
/// Targets farther away are treated as typing errors. Scale: characteristic displacement. Reason: a thousand turns.
pub const FARTHEST: f64 = 1e4;

// ---- errors of steps

/// Round-off of errors and displacements next to a singular position. Scale: natural scales. Reason: rounding over the
/// square of the distance, 1e-12 in a typical crossing, this in one of a thousand crossings of forty loops.
pub const SINGULAR_ROUNDING: f64 = 1e-10;
/// Default relative tolerance of a run. Unit: fraction of each coordinate and velocity. Reason: a thousandth of what a
/// figure shows, over the steps of a run.
pub const RTOL: f64 = 1e-8;
/// Default absolute tolerance of a run. Unit: characteristic displacements, and those per second. Reason: a hundredth
/// of the relative one, for quantities that are small or pass zero.
pub const ATOL: f64 = 1e-10;
