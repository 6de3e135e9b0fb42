//! The coefficients by which a step was taken, for derivatives of it: those of the Runge–Kutta method, and where its stages
//! were solved for, the states there.
//!
//! ```text
//! y_i = y_old + h Σ_j a_ij f(t_old + c_j h, y_j)      y_new = y_old + h Σ_j b_j f(t_old + c_j h, y_j)
//! ```

use crate::collocation::Nodes;
use crate::tableau::{self, Tableau};

/// Coefficients of a Runge–Kutta method.
#[derive(Clone, Debug, PartialEq)]
pub struct Scheme {
    /// Nodes.
    pub c: Vec<f64>,
    /// A row for each node; of an explicit method row i has i entries.
    pub a: Vec<Vec<f64>>,
    /// Weights of the step.
    pub b: Vec<f64>,
    /// Whether stages depend on later ones.
    pub implicit: bool,
}

/// A step as it was taken.
#[derive(Clone, Debug, PartialEq)]
pub struct Taken {
    /// By these coefficients.
    pub scheme: Scheme,
    /// Of an implicit method the states of the stages, one after the other; else nothing, as they follow from its start.
    pub states: Vec<f64>,
}

impl Scheme {
    /// Of a table; a last stage that serves the next step alone is left out.
    pub fn of_table(table: &Tableau) -> Self {
        let stages = if table.fsal { table.stages - 1 } else { table.stages };
        Self {
            c: table.c[..stages].to_vec(),
            a: table.a[..stages].iter().map(|row| row.to_vec()).collect(),
            b: table.b[..stages].to_vec(),
            implicit: false,
        }
    }

    /// For steps that remember earlier ones, and for the way to a time between two steps: DOP853.
    pub fn accurate() -> Self {
        Self::of_table(&tableau::DOP853)
    }

    /// Of Gauss collocation.
    pub(crate) fn of_nodes(nodes: &Nodes) -> Self {
        Self { c: nodes.c.clone(), a: nodes.a.clone(), b: nodes.b.clone(), implicit: true }
    }
}
