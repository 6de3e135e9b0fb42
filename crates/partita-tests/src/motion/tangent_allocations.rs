//! After the first call an evaluation with tangent velocities allocates nothing.

use crate::counting::allocations;
use crate::mechanisms::{compile, in_space};
use partita_model::zero_position::Coordinates;
use partita_model::Model;
use partita_system::formulation::{registry, Depth};
use partita_system::options::{FormulationOptions, TangentMap};
use partita_system::prelude::*;
use partita_system::reduction::Reduction;
use partita_system::{start, SystemError};
use std::sync::{Arc, Mutex};

/// The tangent of a partition, as a user might hand it over.
struct Partitioned<'m>(Mutex<Reduction<'m, Model>>);

impl TangentMap for Partitioned<'_> {
    fn tangent(&self, t: f64, q: &[f64], dt: &mut [f64]) -> Result<(), SystemError> {
        let mut r = self.0.lock().unwrap();
        r.position(t, q)?;
        r.tangent(t)?;
        dt.copy_from_slice(&r.at.dt);
        Ok(())
    }
}

fn count(model: &'static Model, what: &str) {
    let mut q = model.initial();
    partita_system::kinematics::assembly::close(model, 0.0, &mut q, 1e-10, &[]).unwrap();
    let size = model.size();
    let rank = start::analyse(model, 0.0, &q).unwrap().rank;
    let mut r = Reduction::dense(model, rank);
    start::choose_partition(&mut r, 0.0, &q, None, None).unwrap();
    let speeds: Vec<f64> = (0..r.k()).map(|i| 0.3 + 0.1 * i as f64).collect();
    r.evaluate(0.0, &q, &speeds).unwrap();
    let v = r.at.v.clone();
    let tangent: Arc<dyn TangentMap> = Arc::new(Partitioned(Mutex::new(r)));
    let options = FormulationOptions { tangent: Some(tangent), ..FormulationOptions::default() };
    let bases = ["zero-eigenvalue", "svd", "qr", "liang-lance", "gram-schmidt", "tangent-space", "user-tangent"];
    for name in bases.into_iter().chain(["multipliers", "sparse-multipliers"]) {
        let mut f = registry::by_name(name, model, rank, &options).unwrap();
        let (mut y, mut dy) = (vec![0.0; f.layout().dim()], vec![0.0; f.layout().dim()]);
        f.start(0.0, &q, &v, &mut y).unwrap();
        f.rates(0.0, &y, &mut dy, Depth::Rates).unwrap();
        let start = y.clone();
        let ((), counted) = allocations(|| {
            for i in 0..20 {
                // stages: a little off the closed position, at other speeds
                y.iter_mut().zip(&start).for_each(|(y, s)| *y = s * (1.0 + 1e-5 * f64::from(i)));
                y[0] += 1e-4 * f64::from(i);
                f.rates(1e-3 * f64::from(i), &y, &mut dy, Depth::Rates).unwrap();
            }
        });
        assert_eq!(counted, 0, "{what}, {name}: {} allocations (nq {})", counted, size.nq);
    }
}

#[test]
fn evaluations_allocate_nothing() {
    let leaked = |coordinates| -> &'static Model { Box::leak(Box::new(compile(&in_space(), coordinates).unwrap())) };
    count(leaked(Coordinates::Relative), "relative");
    // three balls, closing rows of every kind
    count(leaked(Coordinates::Absolute), "absolute");
}
