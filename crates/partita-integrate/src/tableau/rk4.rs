use super::{Dense, ErrorWeights, Tableau};

/// The classical method of order four: four evaluations a step, no error estimate.
///
/// For fixed steps and for comparison; between the ends the cubic of Hermite, of order three.
pub static RK4: Tableau = Tableau {
    name: "rk4",
    source: "Kutta, Z. Math. Phys. 46 (1901)",
    order: 4,
    error_order: 0,
    stages: 4,
    a: &[&[], &[0.5], &[0.0, 0.5], &[0.0, 0.0, 1.0]],
    b: &[1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0],
    c: &[0.0, 0.5, 0.5, 1.0],
    error: ErrorWeights::None,
    fsal: false,
    pi_beta: 0.0,
    dense: Dense { order: 3, nodes: &[], a: &[], weights: &[] },
};
