//! Assembly from rough drawings: families of linkages from 3 to 3000 velocities, drawn wrong by 0.1 % to 30 %.

use crate::families::*;
use crate::linkages::*;
use partita_math::tolerance;
use partita_model::spec::JointKind::Revolute;
use partita_model::Model;
use partita_system::kinematics::assembly::{self};
use partita_system::prelude::*;
use partita_system::SystemError;

/// Largest |Φ| in parts of the rows' lengths.
fn closure_error(model: &Model, q: &[f64]) -> f64 {
    let size = model.size();
    let (mut phi, mut a, mut c) = (vec![0.0; size.holonomic], vec![0.0; size.rows], vec![0.0; model.pattern().nnz()]);
    model.position(0.0, q, &mut model.scratch(), &mut phi, &mut c, &mut a).unwrap();
    phi.iter().enumerate().fold(0.0, |m: f64, (i, x)| m.max(x.abs() / model.structure().rows[i].displacement.unwrap()))
}

#[test]
fn rough_drawings_close() {
    let families: Vec<(Drawing, usize)> = vec![
        (four_bar([1.0, 0.3, 0.9, 0.7], 1.0, 1.0), 100),
        (slider_crank(), 100),
        (watt(), 100),
        (stephenson(), 100),
        (squeezer(), 100),
        (jansen(1.0), 100),
        (jansen(4.0), 100),
        (klann(0.5), 100),
        (klann(3.0), 100),
        (three_rrr(), 100),
        (rssr("S"), 100),
        (rssr("U"), 100),
        (bricard(), 100),
        (scissors(5), 40),
        (scissors(50), 10),
        (uprights(3, |_| 1.0), 40),
        (uprights(40, |i| 1.0 + 0.2 * (i as f64).sin()), 20),
        (uprights(240, |_| 1.0), 4),
        (uprights(260, |_| 1.0), 4),
        (uprights(1500, |_| 1.0), 1),
        (side_by_side(10), 20),
        (side_by_side(1000), 1),
        (on_the_last_rocker(10), 20),
        (on_the_last_rocker(100), 4),
        (ring(50), 10),
        (ring(500), 1),
        (spatial_cranks(1), 40),
        (spatial_cranks(40), 4),
    ];
    let mut rng = fastrand::Rng::with_seed(20);
    for (p, part) in [1e-3, 1e-2, 0.1, 0.3].into_iter().enumerate() {
        let (mut closed, mut all, mut failed) = (0, 0, Vec::new());
        for (d, count) in &families {
            let model = d.clone().model();
            assert!(closure_error(&model, &model.initial()) < tolerance::CLOSED, "{} is drawn closed", model.spec.name);
            all += count;
            for _ in 0..*count {
                let mut q = rough(&model, &mut rng, part);
                match assembly::close(&model, 0.0, &mut q, tolerance::CLOSED, &[]) {
                    Ok(report) => {
                        assert!(closure_error(&model, &q) <= tolerance::CLOSED);
                        // quadratic at the end, and no more iterations for a thousand loops than for one
                        assert!(report.iterations <= [10, 12, 20, 40][p], "{}: {report:?}", model.spec.name);
                        closed += 1;
                    }
                    Err(e) => failed.push(format!("{}: {e}", model.spec.name)),
                }
            }
        }
        assert!(100 * closed >= 99 * all, "drawn wrong by {part}: {closed} of {all}; {failed:?}");
    }
}

#[test]
fn lengths_that_do_not_fit_are_named_with_their_shortfall() {
    // crank, coupler and rocker of 0.1 never span 1: 0.7 are missing, whatever the unit
    for unit in [1e-6, 1.0, 1e6] {
        let model = drawing("short")
            .pin("A", "ground", "crank", [0.0; 2])
            .pin("B", "crank", "coupler", [0.0, 0.1 * unit])
            .pin("D", "ground", "rocker", [unit, 0.0])
            .joint("C", Revolute, "coupler", "rocker", [0.1 * unit, 0.1 * unit, 0.0], Z);
        let mut spec = model.0;
        spec.joints.last_mut().unwrap().child_point = Some([unit, 0.1 * unit, 0.0]);
        let model = Drawing(spec).model();
        let mut q = model.initial();
        match assembly::close(&model, 0.0, &mut q, tolerance::CLOSED, &[]) {
            Err(SystemError::Lengths { owner, shortfall, loop_description, angle, .. }) => {
                assert!((shortfall / unit - 0.7).abs() < 1e-6, "{shortfall}");
                assert_eq!((&*owner, angle), ("C", 0.0));
                assert!(["A", "B", "D"].iter().all(|j| loop_description.contains(j)), "{loop_description}");
            }
            other => panic!("{other:?}"),
        }
    }
}

/// Every link turned by up to a radian: one drawing in some comes to rest open, and closes from a start beside it.
#[test]
fn far_drawings_close_from_starts_around_them() {
    let drawings = [
        four_bar([1.0, 0.3, 0.9, 0.7], 1.0, 1.0),
        watt(),
        stephenson(),
        squeezer(),
        jansen(1.0),
        klann(0.5),
        three_rrr(),
    ];
    let mut rng = fastrand::Rng::with_seed(21);
    let (mut closed, mut all, mut again) = (0, 0, 0);
    for d in drawings {
        let model = d.model();
        for _ in 0..200 {
            let mut q = rough(&model, &mut rng, 1.0);
            all += 1;
            if let Ok(report) = assembly::close(&model, 0.0, &mut q, tolerance::CLOSED, &[]) {
                assert!(closure_error(&model, &q) <= tolerance::CLOSED);
                closed += 1;
                again += usize::from(report.restarts > 0);
            }
        }
    }
    assert!(100 * closed >= 99 * all, "{closed} of {all}, {again} after a restart");
    assert!(again > 0, "none of {all} came to rest open");
}

/// However coarse the tolerance by which a way is judged, its end is closed to round-off.
#[test]
fn closed_drawings_are_closed_to_round_off() {
    let mut rng = fastrand::Rng::with_seed(21);
    let linkages =
        [four_bar([1.0, 0.3, 0.9, 0.7], 1.0, 1.0), watt(), slider_crank(), jansen(1.0), rssr("S"), rssr("U")];
    for d in linkages.into_iter().chain([spatial_cranks(4), uprights(40, |i| 1.0 + 0.2 * (i as f64).sin())]) {
        let model = d.model();
        for _ in 0..5 {
            let mut q = rough(&model, &mut rng, 0.01);
            assembly::close(&model, 0.0, &mut q, 1e-3, &[]).unwrap();
            // in parts of the rows' lengths, which their sums exceed by no more than ten times
            assert!(closure_error(&model, &q) < 1e-14, "{}: {:e}", model.spec.name, closure_error(&model, &q));
        }
    }
}
