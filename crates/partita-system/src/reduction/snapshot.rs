//! A choice with what it is judged by, kept so that evaluations can be made with it again.

use super::Reduction;
use crate::system::ConstrainedSystem;
use partita_math::elimination::Plan;
use std::mem::size_of;

/// Rows, coordinates and the order of the elimination, scales, and the round-off within which loops are closed.
#[derive(Clone, Debug)]
pub struct ReductionSnapshot {
    plan: Option<Plan>,
    independent: Vec<usize>,
    /// s², s of the velocities; scales, sizes and round-off of the rows.
    numbers: Vec<f64>,
}

impl ReductionSnapshot {
    /// Memory that it takes, about.
    pub fn bytes(&self) -> usize {
        let plan = self.plan.as_ref().map_or(0, |plan| 2 * size_of::<f64>() * plan.pivot_rows().len());
        size_of::<Self>() + plan + size_of::<f64>() * (self.independent.len() + self.numbers.len())
    }
}

impl<S: ConstrainedSystem> Reduction<'_, S> {
    /// Number of what evaluations depend on besides their arguments: the choice, and the round-off of its rows.
    pub fn version(&self) -> u64 {
        self.counts.version
    }

    /// The choice in use.
    pub fn snapshot(&self) -> ReductionSnapshot {
        let numbers = [&self.scale.s2, &self.scale.s, &self.scale.row_scale, &self.scale.row_size, &self.scale.noise];
        ReductionSnapshot {
            plan: self.planned.plan.clone(),
            independent: self.planned.partition.independent.clone(),
            numbers: numbers.into_iter().flatten().copied().collect(),
        }
    }

    /// Take this choice.
    pub fn restore(&mut self, from: &ReductionSnapshot) {
        let mut numbers = &from.numbers[..];
        for to in [
            &mut self.scale.s2,
            &mut self.scale.s,
            &mut self.scale.row_scale,
            &mut self.scale.row_size,
            &mut self.scale.noise,
        ] {
            let (of, rest) = numbers.split_at(to.len());
            to.copy_from_slice(of);
            numbers = rest;
        }
        let known = self.planned.plan.as_ref().zip(from.plan.as_ref()).is_some_and(|(now, plan)| now.is_same(plan));
        if known && self.planned.partition.independent == from.independent {
            return;
        }
        self.counts.plans += 1;
        if let Some(plan) = &from.plan {
            self.adopt(plan.clone(), &from.independent);
        }
    }
}
