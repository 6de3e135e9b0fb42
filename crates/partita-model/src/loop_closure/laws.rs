//! Couplings over coordinates of the tree, which give one of them from the others: a gear, a rack, a screw, a cam.
//!
//! ```text
//! Σ f_i q_i = offset:   q_k = (offset − Σ' f_i q_i) / f_k       for any k
//! q_0 = f(q_1):         q_0                                     from q_1
//! ```
//!
//! Whole turns pass through a law, so its coordinates keep them. Other couplings, and readings that are not coordinates
//! of the tree, are left to the implicit blocks, whose rows of C contain all of them.

use super::graph::{Graph, Home};
use crate::coupling::{Law, Says};
use crate::evaluator::Evaluator;
use crate::measurement::Quantity;
use crate::model::Model;
use crate::value;
use partita_math::scalar::Scalar;
use partita_system::prelude::*;
use partita_system::SystemError;

/// A law and the edges whose coordinates it relates.
#[derive(Clone, Debug)]
pub(super) struct TreeLaw {
    /// Number of the condition.
    condition: usize,
    /// Edges of its readings, each once.
    edges: Vec<usize>,
    /// Coordinates in q.
    q: Vec<usize>,
    /// Change of the law for a large displacement of each; 0 where the coordinate does not follow from it.
    weight: Vec<f64>,
}

/// A law solved for one of its coordinates.
#[derive(Clone, Debug)]
pub(super) struct SolvedLaw {
    condition: usize,
    q: Vec<usize>,
    /// Index of the reading.
    index: usize,
    /// Edge of that reading.
    pub edge: usize,
    /// Its share in the sum of the law, 1 at best.
    pub pivot: f64,
}

impl TreeLaw {
    /// All of a model.
    pub fn all(model: &Model, graph: &Graph) -> Vec<Self> {
        let edge_of = |at: usize| graph.edges.iter().position(|e| matches!(e.home, Home::Tree { q, .. } if q == at));
        let mut found = Vec::new();
        for (condition, c) in model.own.full.conditions.iter().enumerate() {
            let Says::Law(law, readings) = &c.says else { continue };
            let coordinate = |quantity: &Quantity<_>| match quantity {
                Quantity::Coordinate { q, v } => Some((*q, *v)),
                _ => None,
            };
            let Some(at) = readings.iter().map(|r| coordinate(&r.quantity)).collect::<Option<Vec<_>>>() else {
                continue;
            };
            let weight: Vec<f64> = match law {
                Law::Linear { factors, .. } => {
                    factors.iter().zip(&at).map(|(f, x)| f.abs() * model.structure().displacement(x.1)).collect()
                }
                Law::Curve { .. } => vec![1.0, 0.0],
                Law::Motion { .. } | Law::Rate(_) | Law::Function(_) => continue,
            };
            let q: Vec<usize> = at.iter().map(|x| x.0).collect();
            let Some(edges) = q.iter().map(|&q| edge_of(q)).collect::<Option<Vec<_>>>() else { continue };
            if (1..edges.len()).all(|i| !edges[..i].contains(&edges[i])) {
                found.push(Self { condition, edges, q, weight });
            }
        }
        found
    }

    /// The law solved for its one unknown coordinate; none where there are more, or where the law does not determine
    /// it.
    pub fn solved(&self, known: impl Fn(usize) -> bool) -> Option<SolvedLaw> {
        let mut unknown = (0..self.edges.len()).filter(|&i| !known(self.edges[i]));
        let index = unknown.next()?;
        if unknown.next().is_some() || self.weight[index] == 0.0 {
            return None;
        }
        let size = self.weight.iter().map(|w| w * w).sum::<f64>().sqrt();
        Some(SolvedLaw {
            condition: self.condition,
            q: self.q.clone(),
            index,
            edge: self.edges[index],
            pivot: self.weight[index] / size,
        })
    }
}

impl SolvedLaw {
    /// Its coordinate from the others in q.
    pub fn value<S: Scalar>(&self, e: &Evaluator<S>, q: &[S]) -> Result<S, SystemError> {
        let c = &e.full.conditions[self.condition];
        match &c.says {
            Says::Law(Law::Linear { factors, offset, .. }, _) => {
                let others = (0..self.q.len()).filter(|&i| i != self.index);
                let rest = others.fold(*offset, |rest, i| rest - factors[i] * q[self.q[i]]);
                Ok(rest / factors[self.index])
            }
            Says::Law(Law::Curve { curve, abscissa, .. }, _) => {
                Ok(value::curve_at(curve, *abscissa, q[self.q[1]], &c.name)?[0])
            }
            Says::Law(..) | Says::Rolling(..) | Says::Turning(_) => {
                let message = format!("\"{}\" has no closed form", c.name);
                Err(SystemError::argument("closing", message))
            }
        }
    }

    /// The coordinate in q.
    pub fn coordinate(&self) -> usize {
        self.q[self.index]
    }

    /// In the terms of the description.
    pub fn words(&self, model: &Model) -> String {
        model.own.full.conditions[self.condition].owner.words(&model.spec)
    }
}
