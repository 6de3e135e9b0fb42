//! Whole turns that positions alone do not determine: couplings satisfied by their rates, and elements whose angle has
//! wound up.

use crate::coupling::{Law, Says};
use crate::model::Model;
use partita_math::tolerance;
use partita_system::prelude::*;
use partita_system::SystemError;
use std::f64::consts::TAU;

impl Model {
    /// Refuse a path between two positions on which a coupling loses its phase.
    ///
    /// # Errors
    /// `Argument`: "coordinates".
    pub fn held_on(&self, from: &[f64], to: &[f64]) -> Result<(), SystemError> {
        let linear = |says: &Says<_>| matches!(says, Says::Law(Law::Linear { .. }, _));
        let of_rates = || self.own.full.conditions.iter().filter(|c| !c.holonomic && linear(&c.says));
        if of_rates().next().is_none() {
            return Ok(());
        }
        let (mut s, rest) = (self.scratch(), vec![0.0; self.size().nv]);
        let mut read = |q: &[f64]| -> Vec<Vec<f64>> {
            self.own.look(q, &rest, s.equations());
            let values = |c: &crate::coupling::Condition<_>| {
                c.readings().iter().map(|r| r.value(&self.own.full, &s.equations().full, q)).collect()
            };
            of_rates().map(values).collect()
        };
        let (before, after) = (read(from), read(to));
        for (c, (x, y)) in of_rates().zip(before.iter().zip(&after)) {
            let Says::Law(Law::Linear { factors, .. }, readings) = &c.says else { continue };
            let (mut phase, mut size) = (0.0, 0.0f64);
            for (i, r) in readings.iter().enumerate() {
                let moved = y[i] - x[i];
                phase += factors[i] * if r.wraps { moved - (moved / TAU).round() * TAU } else { moved };
                size = size.max(factors[i].abs() * if r.wraps { 1.0 } else { self.own.placed.length });
            }
            if phase.abs() > tolerance::CLOSED_IN_RUN * size {
                let message = format!(
                    "\"{}\" constrains only rates in these coordinates, because the whole turns of its joints are \
                     not known and its factors have no common period: up to this position its phase would change by \
                     {phase:.6}; assemble in relative coordinates with its joints in the tree (cut = \"never\") and \
                     start the run from that state",
                    c.name
                );
                return Err(SystemError::argument("coordinates", message));
            }
        }
        Ok(())
    }

    /// Refuse the value x of a joint angle at which an element is wound beyond the half turn known from the pose.
    ///
    /// # Errors
    /// `Wound`.
    pub fn check_turns_at(&self, joint: usize, coordinate: usize, x: f64) -> Result<(), SystemError> {
        let name = self.spec.joints[joint].name.as_str();
        for (what, middle, within) in self.own.full.elements.iter().filter_map(|e| e.turn_range()) {
            let counts = self.spec.forces.iter().any(|f| f.name() == what && f.over() == Some((name, coordinate)));
            let by = x - middle;
            if counts && by.abs() > within {
                return Err(SystemError::Wound { what: what.to_string(), by });
            }
        }
        Ok(())
    }
}
