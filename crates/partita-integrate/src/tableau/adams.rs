use super::{Dense, ErrorWeights, Tableau};

/// The start of [`ADAMS`](crate::method::ADAMS): Heun's method of order two with Euler's, of order one, inside.
pub static HEUN_EULER: Tableau = Tableau {
    name: "adams",
    source: "Shampine, Gordon, Computer Solution of Ordinary Differential Equations (1975)",
    order: 2,
    error_order: 1,
    stages: 2,
    a: &[&[], &[1.0]],
    b: &[0.5, 0.5],
    c: &[0.0, 1.0],
    error: ErrorWeights::One(&[-0.5, 0.5]),
    fsal: false,
    pi_beta: 0.0,
    dense: Dense { order: 3, nodes: &[], a: &[], weights: &[] },
};
