//! Explicit closing of mechanisms drawn by chance: whatever closes in closed form does it rightly, the rest implicitly.

use crate::linkages::{assert_tangent, branches, position};
use crate::mechanisms::{between, on_coupled_mechanisms, on_random_mechanisms, Moment, Wishes};
use partita_model::Model;
use partita_system::closing::Closing;
use partita_system::prelude::*;
use partita_system::start;

/// Close near a closed position, for inputs chosen freely; returns (explicit, implicit) velocities.
fn check(rng: &mut fastrand::Rng, model: &Model, m: &Moment) -> (usize, usize) {
    let mut closing = match model.loop_closing(m.t, &m.q, None) {
        Ok(closing) => closing,
        Err(e) => panic!("{e}\n{:?}", model.spec.joints.iter().map(|j| (&j.name, j.kind)).collect::<Vec<_>>()),
    };
    let nv = model.size().nv;
    let inputs = closing.inputs().to_vec();
    assert_eq!(inputs.len() + m.rank, nv);
    // every dependent velocity is in one block, every block has as many rows as unknowns
    let mut seen: Vec<usize> = closing.blocks().iter().flat_map(|b| b.unknown.clone()).collect();
    assert!(closing.blocks().iter().all(|b| b.rows.len() == b.unknown.len()));
    seen.extend(&inputs);
    seen.sort_unstable();
    assert_eq!(seen, (0..nv).collect::<Vec<_>>());
    // at the position itself nothing moves
    let mut q = m.q.clone();
    closing.close(m.t, &mut q).unwrap();
    let own = branches(&closing);
    let apart = q.iter().zip(&m.q).fold(0.0, |x: f64, (a, b)| x.max((a - b).abs()));
    // the state is closed to 1e-12; weak blocks magnify that, and a pivot p of a block by 1/p²
    assert!(apart < 1e-6, "moved by {apart:.2e}");
    // inputs moved a little
    let mut dv = vec![0.0; nv];
    for &i in &inputs {
        dv[i] = 1e-3 * between(rng, -1.0, 1.0) * model.structure().displacement(i);
    }
    model.step(&mut q, &dv);
    if closing.close(m.t, &mut q).is_ok() {
        let (closure_error, _) = position(model, m.t, &q);
        assert!(closure_error < 1e-12, "open by {closure_error:.2e}");
        assert_eq!(own, branches(&closing));
        // derivatives of weak blocks are large
        if closing.state().iter().all(|s| s.pivot > 0.1) && closing.is_explicit() && model.drives().is_empty() {
            assert_tangent(model, &mut closing, m.t, &q);
        }
    }
    let implicit = closing.blocks().iter().filter(|b| !b.explicit).map(|b| b.unknown.len()).sum();
    (nv - inputs.len() - implicit, implicit)
}

#[test]
fn planar_mechanisms() {
    let (mut explicit, mut implicit) = (0, 0);
    let wishes = Wishes { planar: true, bound: true, drives: true };
    on_random_mechanisms(71, 60, wishes, |rng, model, m| {
        let found = check(rng, model, m);
        explicit += found.0;
        implicit += found.1;
    });
    // one or two loops are nearly always dyads for the right inputs
    assert!(explicit > 10 * implicit, "{explicit} {implicit}");
}

#[test]
fn spatial_mechanisms() {
    let wishes = Wishes { planar: false, bound: true, drives: true };
    on_random_mechanisms(72, 60, wishes, |rng, model, m| {
        check(rng, model, m);
    });
}

/// Gears of two and three coordinates, a cam by its curve, a function, a distance, a displacement.
#[test]
fn coupled_mechanisms() {
    for planar in [true, false] {
        let wishes = Wishes { planar, bound: true, drives: true };
        let mut seen = 0;
        on_coupled_mechanisms(74, 30, wishes, &[0, 1, 2, 3, 4, 5], |rng, model, m| {
            // angles of two cut joints whose factors have no common part are held by their rates
            if model.equations().full.conditions.iter().all(|c| c.holonomic) {
                check(rng, model, m);
                seen += 1;
            }
        });
        assert!(seen > 20, "{seen}");
    }
}

/// Conditions on rates leave positions open.
#[test]
fn conditions_on_rates_are_refused() {
    let wishes = Wishes { planar: true, bound: true, drives: false };
    on_coupled_mechanisms(75, 4, wishes, &[7, 8], |_, model, m| {
        let refused = model.loop_closing(m.t, &m.q, None).err().unwrap().to_string();
        assert!(refused.contains("constrains rates only") && refused.contains("projective"), "{refused}");
    });
}

/// The choice of inputs follows the measure where loops are all implicit or all explicit: never a singular one.
#[test]
fn chosen_inputs_determine_the_others() {
    let wishes = Wishes { planar: true, bound: false, drives: false };
    on_random_mechanisms(73, 30, wishes, |_, model, m| {
        let closing = model.loop_closing(m.t, &m.q, None).unwrap();
        let mut r = partita_system::reduction::Reduction::new(model, m.rank);
        start::choose_partition(&mut r, m.t, &m.q, None, Some(closing.inputs())).unwrap();
    });
}
