//! Balances of forces and of energy along arrays, judged as at the end of a run.

use crate::arrays::entries_of;
use crate::run::reported;
use numpy::PyReadonlyArray1;
use partita_analysis::run::balance::{self, BalanceOptions, Energy};
use partita_model::spec::Spec;
use pyo3::prelude::*;

type Vector<'py> = PyReadonlyArray1<'py, f64>;
type Reported = Vec<(bool, f64, String)>;

/// Findings from Newton-Euler residuals (nt,): invalid, t, sentence.
#[pyfunction]
pub fn reaction_findings(t: Vector<'_>, residual: Vector<'_>, asked: (f64, bool)) -> Reported {
    let (tolerance, drifts) = asked;
    let (t, residual) = (entries_of(&t), entries_of(&residual));
    let found =
        balance::of_reactions(t.iter().copied().zip(residual.iter().copied()), BalanceOptions { tolerance, drifts });
    reported(found.as_slice())
}

/// Findings from the energy balance over outputs (nt,), relative to `least` at least: broken, t, sentence.
#[pyfunction]
pub fn energy_findings(
    t: Vector<'_>,
    energies: (Vector<'_>, Vector<'_>, Vector<'_>),
    tolerance: f64,
    steps: u64,
    least: f64,
) -> Reported {
    let columns = [t, energies.0, energies.1, energies.2];
    let [t, kinetic, potential, work] = columns.each_ref().map(entries_of);
    let energy = |i: usize| {
        Some(Energy { t: *t.get(i)?, kinetic: *kinetic.get(i)?, potential: *potential.get(i)?, work: *work.get(i)? })
    };
    let at: Vec<Energy> = (0..t.len()).map_while(energy).collect();
    reported(balance::of_energy(&at, BalanceOptions { tolerance, drifts: false }, steps, least).as_slice())
}

/// Smallest reference energy (J) of the balance of a mechanism; 0 for a text that is not a description.
#[pyfunction]
pub fn energy_floor(description: &str, atol: f64) -> f64 {
    Spec::from_json(description).map_or(0.0, |spec| balance::energy_floor(&spec, atol))
}
