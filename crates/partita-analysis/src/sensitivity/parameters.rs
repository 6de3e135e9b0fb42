//! The numbers of parameters that directions change.

use super::legs::Leg;
use super::Direction;
use crate::error::AnalysisError;
use partita_model::carried::{Carried, CARRIED};

/// Numbers of parameters.
pub struct Parameters {
    /// Names and counts.
    pub all: Vec<(String, usize)>,
    /// Their numbers.
    pub values: Vec<f64>,
    /// Of each direction the change of each.
    pub seeds: Vec<Vec<f64>>,
}

impl Parameters {
    /// Those of these directions, of the mechanism of a leg.
    ///
    /// # Errors
    /// Parameters that do not exist.
    pub fn new(leg: &Leg, directions: &[Direction]) -> Result<Self, AnalysisError> {
        let named: Vec<Direction> = directions.to_vec();
        let mut found: Vec<(String, Vec<Carried>)> = Vec::new();
        // each with its values, whatever their derivatives
        for chunk in named.chunks(CARRIED) {
            for one in super::seeded(&leg.model, chunk)? {
                if !found.iter().any(|x| x.0 == one.0) {
                    found.push(one);
                }
            }
        }
        let all: Vec<(String, usize)> = found.iter().map(|(name, x)| (name.clone(), x.len())).collect();
        let values: Vec<f64> = found.iter().flat_map(|x| x.1.iter().map(|x| x.re)).collect();
        let offset = |name: &str| -> Option<usize> {
            let i = all.iter().position(|x| x.0 == name)?;
            Some(all[..i].iter().map(|x| x.1).sum())
        };
        let seed = |direction: &Direction| {
            let mut seed = vec![0.0; values.len()];
            for (name, change) in &direction.parameters {
                if let Some(from) = offset(name) {
                    seed[from..from + change.len()].iter_mut().zip(change).for_each(|(to, x)| *to += x);
                }
            }
            seed
        };
        let seeds = directions.iter().map(seed).collect();
        Ok(Self { all, values, seeds })
    }

    /// The directions of single numbers, as many as are carried together at a time.
    pub fn units(&self) -> Vec<Vec<Direction>> {
        let mut units = Vec::with_capacity(self.values.len());
        for (name, count) in &self.all {
            for i in 0..*count {
                let mut change = vec![0.0; *count];
                change[i] = 1.0;
                // what is a number of its own stays, as where a joint is on its child
                let others = self.all.iter().filter(|x| x.0 != *name).map(|x| (x.0.clone(), vec![0.0; x.1]));
                let parameters = std::iter::once((name.clone(), change)).chain(others).collect();
                units.push(Direction { parameters, ..Direction::default() });
            }
        }
        units.chunks(CARRIED).map(<[Direction]>::to_vec).collect()
    }
}
