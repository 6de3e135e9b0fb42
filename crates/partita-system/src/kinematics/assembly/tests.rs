//! Continuation over full turns and to the limit of a loop.

use super::move_to;
use crate::manifold::least_change::{from_afar, near_by, LeastChange};
use crate::manifold::tests::{four_bar, Chains, CRANK_ROCKER};
use crate::manifold::{close, ClosingScratch};
use crate::prelude::*;
use crate::system::SystemError;
use std::f64::consts::TAU;

#[test]
fn a_crank_comes_back_to_where_it_started_after_full_turns() {
    let (lengths, base) = CRANK_ROCKER;
    let (system, start) = (Chains::one(&lengths, base), four_bar(0.3));
    for sign in [1.0, -1.0] {
        let (mut back, far) = (start, start[0] + sign * 3.0 * TAU);
        move_to(&system, 0.0, &mut back, &[(0, far)], 1e-12).unwrap();
        assert!(back[0] == far && (back[1] - start[1]).abs() < 1e-13 && (back[2] - start[2]).abs() < 1e-13);
    }
}

#[test]
fn a_crank_is_driven_to_the_limit_of_its_loop() {
    // no Grashof linkage: the first link comes to where the others are stretched
    let system = Chains::one(&[2.0, 1.0, 1.2], 2.5);
    let limit = ((2.0f64 * 2.0 + 2.5 * 2.5 - 2.2 * 2.2) / (2.0 * 2.0 * 2.5)).acos();
    let mut q = [0.5, 0.1, -0.9];
    let mut rows = LeastChange::new(&system, 0.0, &q, &[]).unwrap();
    rows.lock(&[0]);
    assert!(close(&mut rows, &mut q, &from_afar(1e-12), &mut ClosingScratch::default()).unwrap().is_closed());
    let e = move_to(&system, 0.0, &mut q, &[(0, 2.0)], 1e-12).unwrap_err();
    assert!(matches!(e, SystemError::Assembly { .. }), "{e}");
    assert!((q[0] - limit).abs() < 2e-6 && q[0] < limit, "{} {limit}", q[0]);
    // from where it ended no longer step leads across either
    let mut locked = LeastChange::new(&system, 0.0, &q, &[]).unwrap();
    locked.lock(&[0]);
    let mut beyond = [limit + 0.01, q[1], q[2]];
    let done = close(&mut locked, &mut beyond, &near_by(1e-12), &mut ClosingScratch::default()).unwrap();
    assert!(!done.is_closed());
}

#[test]
fn a_row_that_is_not_finite_is_named() {
    let (lengths, base) = CRANK_ROCKER;
    let system = Chains::one(&lengths, base);
    let Err(SystemError::NotFinite { what, .. }) = LeastChange::new(&system, 0.0, &[0.3, f64::NAN, 0.1], &[]) else {
        panic!("a position that is not finite is taken");
    };
    assert_eq!(what, *system.structure().rows[0].description);
}
