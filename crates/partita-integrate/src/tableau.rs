//! Explicit Runge–Kutta methods as tables of numbers.
//!
//! ```text
//! k_i = f(t + c_i h, y + h Σ_{j<i} a_ij k_j)      y_new = y + h Σ b_j k_j      error = h Σ e_j k_j
//! ```
//!
//! The tests check every table against the order conditions of all rooted trees up to its order, for the step, for
//! the error estimate and for dense output. A new method is a new file here and one entry in [`METHODS`].

mod adams;
mod bs23;
mod dop853;
mod dopri5;
mod rk4;
mod tsit5;

pub use adams::HEUN_EULER;
pub use bs23::BS23;
pub use dop853::DOP853;
pub use dopri5::DOPRI5;
pub use rk4::RK4;
pub use tsit5::TSIT5;

/// Every method of this crate, the recommended one first.
pub static METHODS: [&Tableau; 5] = [&DOP853, &DOPRI5, &TSIT5, &BS23, &RK4];

/// The method called `name`, if there is one.
pub fn by_name(name: &str) -> Option<&'static Tableau> {
    METHODS.into_iter().find(|method| method.name == name)
}

/// Names of the methods that control their error, in words.
pub(crate) fn adaptive() -> String {
    let names: Vec<&str> = METHODS.iter().filter(|method| method.error_order > 0).map(|method| method.name).collect();
    names.join(", ")
}

/// The coefficients of an explicit Runge–Kutta method.
///
/// Stages are numbered in *slots*: first the `stages` of the method; then the slope `f_new` at the end of the step,
/// unless it is the last stage anyway (`fsal`); then the stages that only dense output needs.
#[derive(Debug)]
pub struct Tableau {
    /// Name used in options, results and messages.
    pub name: &'static str,
    /// Where the coefficients were published.
    pub source: &'static str,
    /// Order of the step.
    pub order: usize,
    /// Order `q` of the error estimate, which shrinks like `h^(q+1)`; 0 without one.
    pub error_order: usize,
    /// Number of stages, a last one at the end of the step included.
    pub stages: usize,
    /// Rows `a_ij`; row `i` has `i` entries, zeros included.
    pub a: &'static [&'static [f64]],
    /// Weights of the step, one for each stage.
    pub b: &'static [f64],
    /// Nodes, one for each stage.
    pub c: &'static [f64],
    /// The error estimate.
    pub error: ErrorWeights,
    /// Whether the last stage is the slope at the new state and serves as the first stage of the next step.
    pub fsal: bool,
    /// Integral share `β` of the step size controller.
    pub pi_beta: f64,
    /// Dense output.
    pub dense: Dense,
}

/// Weights of the error estimate, one for each stage.
#[derive(Debug)]
pub enum ErrorWeights {
    /// None: the method runs with a fixed step only.
    None,
    /// `err = ‖h Σ e_j k_j‖`.
    One(&'static [f64]),
    /// Estimates of order five and three combined: `err = ‖E5‖² / sqrt(‖E5‖² + 0.01 ‖E3‖²)`, which shrinks like `h^8`
    /// and does not vanish by accident of one of them.
    FifthAndThird {
        /// Weights of the estimate of order five.
        fifth: &'static [f64],
        /// Weights of the estimate of order three.
        third: &'static [f64],
    },
}

/// Dense output: what a method adds to the cubic of Hermite through both ends of the step.
///
/// ```text
/// y = y_old + θ (F0 + (1−θ) (F1 + θ (F2 + (1−θ) (F3 + θ (F4 + …)))))
/// ```
///
/// `F0, F1, F2` follow from the ends alone; row `i` of `weights` gives `F_(3+i) = h Σ d_j k_j`.
#[derive(Debug)]
pub struct Dense {
    /// Order of the interpolant: its error inside a step shrinks like `h^(order+1)`.
    pub order: usize,
    /// Nodes of the additional stages.
    pub nodes: &'static [f64],
    /// Rows of the additional stages over all slots before them.
    pub a: &'static [&'static [f64]],
    /// Rows `d` over all slots.
    pub weights: &'static [&'static [f64]],
}

impl Tableau {
    /// Slot of the slope `f_new` at the end of the step.
    pub fn end_slot(&self) -> usize {
        if self.fsal {
            self.stages - 1
        } else {
            self.stages
        }
    }

    /// Number of slots in all.
    pub fn slots(&self) -> usize {
        self.end_slot() + 1 + self.dense.nodes.len()
    }
}
