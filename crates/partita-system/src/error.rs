//! Errors of a system, as sentences.

use partita_math::formatted;
use thiserror::Error;

/// An invalid request, or a failed evaluation.
pub type Result<T, E = SystemError> = std::result::Result<T, E>;

/// What the steps across a singular position led to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CrossingOutcome {
    /// After them the velocities were those of another branch.
    Jumped,
    /// Their equations had no solution.
    Unsolved,
    /// None was accurate enough.
    Inaccurate {
        /// Error of the most accurate one, in tolerances.
        off: f64,
        /// The relative tolerance that it meets.
        enough: f64,
    },
    /// What acts has a breakpoint, or a contact begins and ends, inside every one of them.
    Abrupt {
        /// When.
        at: f64,
    },
}

/// Why a system could not be evaluated.
#[derive(Debug, Error)]
pub enum SystemError {
    /// The constraint matrix lost rank here.
    #[error(
        "the constraints lose rank at t = {t}: the smallest scaled pivot is {pivot:.2e} (limit {limit:.0e}); this \
         is a singular position of the mechanism; start elsewhere, or step over it"
    )]
    Singular {
        /// Time.
        t: f64,
        /// Smallest scaled pivot.
        pivot: f64,
        /// Its limit.
        limit: f64,
    },
    /// The mass matrix is not positive definite.
    #[error(
        "the mass matrix is not positive definite at coordinate {name}: pivot {pivot:.3e}; give the body moved by it \
         a mass or a moment of inertia"
    )]
    Mass {
        /// Name of the velocity whose pivot failed.
        name: String,
        /// The pivot.
        pivot: f64,
    },
    /// A degree of freedom that moves no mass.
    #[error(
        "a degree of freedom moves no mass at t = {t}, so its motion is indeterminate: the motion {motion} (rad/s, \
         m/s) involves only {}, without mass or inertia in that direction; give one of them a mass or a moment of \
         inertia, or drive it",
        names(bodies)
    )]
    Unfelt {
        /// Time.
        t: f64,
        /// Its velocities.
        motion: String,
        /// Bodies that move in it.
        bodies: Vec<String>,
    },
    /// A number that is not finite.
    #[error("{what} is not finite at t = {t}; check the forces and functions that enter it")]
    NotFinite {
        /// What.
        what: String,
        /// Time.
        t: f64,
    },
    /// A time outside a table.
    #[error("{what}: t = {t} is outside its table [{from}, {to}]; extend the table or shorten the run")]
    OutsideTable {
        /// Name of the element.
        what: String,
        /// The requested time.
        t: f64,
        /// Start of the table.
        from: f64,
        /// End of the table.
        to: f64,
    },
    /// A spring was wound beyond the range in which its angle is unique.
    #[error(
        "{what}: its angle is {by:.3} rad (or that far from the middle of its range), but the angle of a joint that \
         closes a spatial loop is known only within half a turn; keep the joint in the tree (cut = \"never\", \
         relative coordinates)"
    )]
    Wound {
        /// Name of the element.
        what: String,
        /// By how much.
        by: f64,
    },
    /// A function of an angle was evaluated where it would need whole turns.
    #[error(
        "{what}: its function is not periodic in an angle that is {by:.3} rad, but the angle of a joint that closes \
         a spatial loop is known only within half a turn; keep the joint in the tree (cut = \"never\", relative \
         coordinates), or give a periodic function"
    )]
    Uncounted {
        /// Name of the element.
        what: String,
        /// The angle.
        by: f64,
    },
    /// A bushing was rotated beyond its limit.
    #[error(
        "{what}: its frames are rotated by {by:.3} rad relative to each other; a bushing allows less than half a \
         turn: use a joint for larger rotations"
    )]
    Twisted {
        /// Name of the element.
        what: String,
        /// By how much.
        by: f64,
    },
    /// A coordinate outside a curve.
    #[error("{what}: its curve is evaluated at {x}, outside [{from}, {to}]; extend the curve, or make it periodic")]
    OutsideCurve {
        /// Name of the element.
        what: String,
        /// The requested coordinate.
        x: f64,
        /// Start of the curve.
        from: f64,
        /// End of the curve.
        to: f64,
    },
    /// A friction depends on a reaction that is not determined with rigid bodies.
    #[error(
        "{friction:?} depends on the reaction of joint {joint:?}, which is not determined at t = {}: with rigid \
         bodies its distribution over redundant joints is indeterminate (see `determined` of the joint), and so is \
         the friction; give the friction magnitude itself (dynamic=), or replace joints to remove the redundancy \
         (see the report)",
        six_digits(*t)
    )]
    OpenReaction {
        /// The friction.
        friction: Box<str>,
        /// Its joint.
        joint: Box<str>,
        /// Time.
        t: f64,
    },
    /// Friction and the reaction it follows have no consistent values, or more than one.
    #[error("{}", jammed(friction, joint, *coefficient, *returned, *several, *t))]
    Jammed {
        /// The friction.
        friction: Box<str>,
        /// Its joint.
        joint: Box<str>,
        /// Its coefficient, the larger of the two.
        coefficient: f64,
        /// Amplification of a unit of its effort by the reaction, at this speed.
        returned: f64,
        /// Whether other frictions act on it.
        several: bool,
        /// Time.
        t: f64,
    },
    /// A user function failed.
    #[error("{what}: {source}")]
    Function {
        /// Name of the element.
        what: String,
        /// Its message.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// Closing the loops failed.
    #[error(
        "assembly did not converge in {iterations} iterations: |Phi| = {residual:.3e}, tolerance {tolerance:.1e} \
         (rad, or fractions of the loop's length); not closed: {loops}; {advice}"
    )]
    Assembly {
        /// Iterations done.
        iterations: usize,
        /// Largest residual.
        residual: f64,
        /// The request.
        tolerance: f64,
        /// Rows that are not closed, with their residuals.
        loops: String,
        /// Advice.
        advice: String,
    },
    /// The targets of an assembly cannot be met.
    #[error("{message}")]
    Targets {
        /// The targets, the reason, where they end and the remaining difference.
        message: String,
        /// Closure error of the nearest position; NaN where it is not reported.
        residual: f64,
        /// Iterations done.
        iterations: usize,
        /// The row that remains open.
        loops: String,
    },
    /// The loops converge to an open position from every start: |Φ| cannot be lowered.
    #[error(
        "the lengths do not fit: {} keeps a closure error of {}, a local minimum ({iterations} iterations, {starts} \
         starts); not closed: {loops}; change a length of this loop by at least that much, or place it on the \
         intended branch",
        loop_description, gap(*shortfall, *angle)
    )]
    Lengths {
        /// The joint or row with the largest closure error.
        owner: Box<str>,
        /// The loop, in words.
        loop_description: Box<str>,
        /// Closure error (m).
        shortfall: f64,
        /// Closure error of its directions (rad).
        angle: f64,
        /// Starts tried.
        starts: usize,
        /// Iterations done.
        iterations: usize,
        /// Largest residual.
        residual: f64,
        /// Rows that are not closed, with their residuals.
        loops: Box<str>,
    },
    /// The start is a singular position: the motion from there is not unique.
    #[error("the mechanism is at a singular position at t = {t}: {message}")]
    SingularStart {
        /// Time.
        t: f64,
        /// The observation and the advice.
        message: String,
    },
    /// The requested step ends where the motion is not unique.
    #[error("the step fails at t = {}: {message}", six_digits(*t))]
    Tick {
        /// Time.
        t: f64,
        /// The observation and the advice.
        message: String,
    },
    /// No step led across a singular position on the branch of the motion.
    #[error("{}", not_crossed(*t, *tries, row, *outcome))]
    Crossing {
        /// Time.
        t: f64,
        /// Steps tried.
        tries: usize,
        /// Name of the constraint that depends most on the others there.
        row: Box<str>,
        /// What these steps led to.
        outcome: CrossingOutcome,
    },
    /// A loop cannot close for these values of its inputs.
    #[error("{}", limit(block, *t, *shortfall))]
    Limit {
        /// Which block, in words.
        block: String,
        /// Time.
        t: f64,
        /// Closure error (m); 0 at the limit position itself.
        shortfall: f64,
    },
    /// Fixed independent coordinates do not determine the others here; this concerns the choice, not the lengths of a
    /// loop.
    #[error("the independent coordinates {coordinates} are at a dead point at t = {t}: {seen}; {advice}")]
    DeadPoint {
        /// Names of the coordinates.
        coordinates: String,
        /// Time.
        t: f64,
        /// The observation, and the block.
        seen: String,
        /// Whether other coordinates would serve, and the advice.
        advice: String,
    },
    /// Redundant conditions that contradict each other.
    #[error("{}", contradiction(who, whom, *t, *gap, unit, *drive))]
    Contradiction {
        /// The time.
        t: f64,
        /// The redundant condition that was left out, in words.
        who: Box<str>,
        /// The others, in words, drives first.
        whom: Vec<String>,
        /// Their residual there.
        gap: f64,
        /// Its unit.
        unit: Box<str>,
        /// Whether one of them is a drive.
        drive: bool,
    },
    /// A condition, or its rate, jumps within a step, however short.
    #[error("{}", jump(what, *by, *t, *rate))]
    Jump {
        /// The element to which the condition belongs.
        what: Box<str>,
        /// Time.
        t: f64,
        /// Size of the jump.
        by: f64,
        /// Whether it is the rate that jumps.
        rate: bool,
    },
    /// A tangent basis no longer spans the motion, or a position cannot be found from its tangent coordinates.
    #[error("the tangent basis \"{name}\" fails at t = {t}: {reason}")]
    Basis {
        /// The rule the basis comes from.
        name: String,
        /// Time.
        t: f64,
        /// The observation, with numbers, and the advice.
        reason: String,
    },
    /// A rule chose coordinates that cannot be independent.
    #[error(
        "selection \"{rule}\" chooses {coordinates} as independent at t = {t}, which do not determine the others: \
         {reason}; use selection \"collective\", which accounts for the coordinates already chosen"
    )]
    Choice {
        /// Name of the rule.
        rule: &'static str,
        /// Names of the coordinates.
        coordinates: String,
        /// Time.
        t: f64,
        /// Why not.
        reason: String,
    },
    /// A derivative of a user-defined system belongs to another function.
    #[error(
        "{} is {given:.9e} at t = {t}, but {of} is {found:.9e}; correct {function} (or what it is the derivative of)",
        entry(function, *row, *column)
    )]
    Derivative {
        /// Name of the function.
        function: &'static str,
        /// Its row.
        row: usize,
        /// Its column, where it has columns.
        column: Option<usize>,
        /// The given value.
        given: f64,
        /// The value from differences.
        found: f64,
        /// Time.
        t: f64,
        /// The expected quantity, in words.
        of: String,
    },
    /// An invalid argument.
    #[error("{message}")]
    Argument {
        /// Its name, as the request writes it.
        argument: Box<str>,
        /// The value, why it is invalid, and a valid one.
        message: String,
    },
    /// Evaluated before anything was chosen.
    #[error("no {0} was chosen before the evaluation")]
    Unchosen(&'static str),
}

impl SystemError {
    /// An invalid value of an argument.
    pub fn argument(argument: impl Into<Box<str>>, message: String) -> Self {
        Self::Argument { argument: argument.into(), message }
    }
}

fn entry(function: &str, row: usize, column: Option<usize>) -> String {
    column.map_or_else(|| format!("{function}[{row}]"), |column| format!("{function}[{row}, {column}]"))
}

fn gap(shortfall: f64, angle: f64) -> String {
    match (shortfall > 0.0, angle > 0.0) {
        (true, false) => format!("{} m", formatted(shortfall)),
        (false, true) => format!("{} rad", formatted(angle)),
        _ => format!("{} m and {} rad", formatted(shortfall), formatted(angle)),
    }
}

fn contradiction(who: &str, whom: &[String], t: f64, gap: f64, unit: &str, drive: bool) -> String {
    let others = match whom {
        [] => "the state at the start".to_string(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    };
    let advice = match drive {
        true => "remove one drive, or prescribe compatible motions",
        false => "remove one of them, or give compatible lengths and directions",
    };
    format!(
        "{who} contradicts {others}: no motion satisfies them all; at t = {} s it is violated by {} {unit} when the \
         others are satisfied; {advice}",
        six_digits(t),
        formatted(gap)
    )
}

fn jammed(friction: &str, joint: &str, coefficient: f64, returned: f64, several: bool, t: f64) -> String {
    let others = if several { ", together with the other reaction-dependent frictions," } else { "" };
    format!(
        "joint \"{joint}\" jams at t = {} s: with the coefficient {coefficient} its friction{others} increases the \
         reaction so much that each newton of friction produces a further {:.3} N (\"{friction}\"); from 1 on the \
         motion of rigid bodies with this friction does not exist or is not unique (Painleve's paradox); use a lower \
         coefficient or a longer bearing, load it nearer to its axis, or give the friction magnitude itself \
         (dynamic=)",
        six_digits(t),
        returned
    )
}

/// Six digits of a time, for messages.
pub fn six_digits(x: f64) -> f64 {
    format!("{x:.5e}").parse().unwrap_or(x)
}

fn not_crossed(t: f64, tries: usize, row: &str, outcome: CrossingOutcome) -> String {
    let place = format!(
        "the mechanism crosses a singular position at t = {}, where branches meet ({row} depends on the other \
         constraints there)",
        six_digits(t)
    );
    let other = "where in a step the position lies depends on rtol, method and coordinates, and on the initial state: \
                 change one of them";
    let steps = match tries {
        0 => "the next step".to_string(),
        1 => "one step across it".to_string(),
        _ => format!("{tries} steps across it, of different lengths and from different starts,"),
    };
    match outcome {
        CrossingOutcome::Jumped => format!("{place}: after {steps} the velocities jump to another branch; {other}"),
        CrossingOutcome::Unsolved => format!("{place}: {steps} led to no solution; {other}"),
        CrossingOutcome::Inaccurate { off, enough } => format!(
            "{place}: the most accurate of {tries} steps across it misses by {} times the tolerance, since next to the \
             position round-off is amplified; repeat with rtol = {enough:.0e}, for which that step is accurate enough",
            formatted(off)
        ),
        CrossingOutcome::Abrupt { at } => format!(
            "{place}, and what acts changes abruptly at t = {}, inside {steps}; such a step follows smooth loads only: \
             let the table, the stop or the contact act farther from that position",
            six_digits(at)
        ),
    }
}

fn limit(block: &str, t: f64, shortfall: f64) -> String {
    let advice = "stop the inputs before it, or use other coordinates as inputs";
    if shortfall == 0.0 {
        return format!("{block} has reached a limit position at t = {t} and cannot close beyond it; {advice}");
    }
    format!(
        "{block} cannot close at t = {t}: its lengths miss closing by {} m (a limit position of the mechanism); \
         {advice}",
        formatted(shortfall)
    )
}

impl SystemError {
    /// Whether the same evaluation could succeed at a nearby point (so that a shorter step may help).
    pub fn is_local(&self) -> bool {
        matches!(
            self,
            Self::Singular { .. }
                | Self::NotFinite { .. }
                | Self::Mass { .. }
                | Self::Limit { .. }
                | Self::DeadPoint { .. }
                | Self::Basis { .. }
                | Self::Choice { .. }
                | Self::Jump { .. }
                | Self::Jammed { .. }
                | Self::Crossing { .. }
        ) || self.leaves_a_range()
    }

    /// Whether a reading lies outside the range over which a function of it is given. A trial step may go there where
    /// the motion does not.
    pub fn leaves_a_range(&self) -> bool {
        matches!(self, Self::OutsideCurve { .. } | Self::Wound { .. } | Self::Uncounted { .. } | Self::Twisted { .. })
    }
}

fn jump(what: &str, by: f64, t: f64, rate: bool) -> String {
    let (by, t) = (formatted(by), six_digits(t));
    match rate {
        true => format!(
            "the rate of {what} jumps by {by}/s at t = {t}, which would need an infinite force; the prescribed \
             motion and its rate must be continuous: smooth the discontinuity over a short time or length"
        ),
        false => format!(
            "{what} jumps by {by} at t = {t}, which no body can follow; the prescribed motion and its rate must be \
             continuous"
        ),
    }
}

/// Names in a sentence.
fn names(of: &[String]) -> String {
    match of {
        [] => "nothing".into(),
        [one] => format!("\"{one}\""),
        [rest @ .., last] => {
            let first: Vec<String> = rest.iter().map(|x| format!("\"{x}\"")).collect();
            format!("{} and \"{last}\"", first.join(", "))
        }
    }
}
