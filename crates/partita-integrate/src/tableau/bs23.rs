use super::{Dense, ErrorWeights, Tableau};

/// Bogacki and Shampine's pair of orders three and two: three new evaluations a step.
///
/// For tolerances of 1e-3 and looser, for forces that are not smooth, and for animations; above that DOPRI5 is cheaper.
/// Between the ends the cubic of Hermite, of order three, without further evaluations.
pub static BS23: Tableau = Tableau {
    name: "bs23",
    source: "Bogacki, Shampine, Appl. Math. Lett. 2 (1989)",
    order: 3,
    error_order: 2,
    stages: 4,
    a: &[&[], &[1.0 / 2.0], &[0.0, 3.0 / 4.0], &[2.0 / 9.0, 1.0 / 3.0, 4.0 / 9.0]],
    b: &[2.0 / 9.0, 1.0 / 3.0, 4.0 / 9.0, 0.0],
    c: &[0.0, 1.0 / 2.0, 3.0 / 4.0, 1.0],
    // the step less the one of order two, whose weights are 7/24, 1/4, 1/3, 1/8
    error: ErrorWeights::One(&[-5.0 / 72.0, 1.0 / 12.0, 1.0 / 9.0, -1.0 / 8.0]),
    fsal: true,
    pi_beta: 0.04,
    dense: Dense { order: 3, nodes: &[], a: &[], weights: &[] },
};
