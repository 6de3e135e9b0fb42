use super::{Dense, ErrorWeights, Tableau};

/// Tsitouras' pair of orders five and four: six new evaluations a step, with smaller error terms than DOPRI5.
///
/// Dense output: its own quartic. Any quartic with the right values and slopes at both ends is the cubic of Hermite
/// plus a multiple of `θ² (1−θ)²`, so only the leading coefficients of the published polynomials are needed.
pub static TSIT5: Tableau = Tableau {
    name: "tsit5",
    source: "Tsitouras, Comput. Math. Appl. 62 (2011)",
    order: 5,
    error_order: 4,
    stages: 7,
    a: &[
        &[],
        &[0.161],
        &[-0.008480655492356989, 0.335480655492357],
        &[2.8971530571054935, -6.359448489975075, 4.3622954328695815],
        &[5.325864828439257, -11.748883564062828, 7.4955393428898365, -0.09249506636175525],
        &[5.86145544294642, -12.92096931784711, 8.159367898576159, -0.071584973281401, -0.028269050394068383],
        &[0.09646076681806523, 0.01, 0.4798896504144996, 1.379008574103742, -3.290069515436081, 2.324710524099774],
    ],
    b: &[0.09646076681806523, 0.01, 0.4798896504144996, 1.379008574103742, -3.290069515436081, 2.324710524099774, 0.0],
    c: &[0.0, 0.161, 0.327, 0.9, 0.9800255409045097, 1.0, 1.0],
    error: ErrorWeights::One(&[
        -0.001780011052225777,
        -0.0008164344596567469,
        0.007880878010261995,
        -0.1447110071732629,
        0.5823571654525552,
        -0.45808210592918697,
        1.0 / 66.0,
    ]),
    fsal: true,
    pi_beta: 0.04,
    dense: Dense {
        order: 4,
        nodes: &[],
        a: &[],
        weights: &[&[
            -1.0530884977290216,
            0.1017,
            2.490627285651253,
            -16.548102889244902,
            47.37952196281928,
            -34.87065786149661,
            2.5,
        ]],
    },
};
