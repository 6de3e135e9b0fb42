use super::{Dense, ErrorWeights, Tableau};

/// Dormand and Prince's pair of orders five and four: six new evaluations a step.
///
/// A sound choice for tolerances from 1e-3 to 1e-7 and for motions with many discontinuities; DOP853 is cheaper below.
/// Dense output: Shampine's quartic, without further evaluations.
pub static DOPRI5: Tableau = Tableau {
    name: "dopri5",
    source: "Dormand, Prince, J. Comput. Appl. Math. 6 (1980); Shampine, Math. Comp. 46 (1986)",
    order: 5,
    error_order: 4,
    stages: 7,
    a: &[
        &[],
        &[1.0 / 5.0],
        &[3.0 / 40.0, 9.0 / 40.0],
        &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
        &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0],
        &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0],
        &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
    ],
    b: &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0, 0.0],
    c: &[0.0, 1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0, 1.0],
    error: ErrorWeights::One(&[
        71.0 / 57600.0,
        0.0,
        -71.0 / 16695.0,
        71.0 / 1920.0,
        -17253.0 / 339_200.0,
        22.0 / 525.0,
        -1.0 / 40.0,
    ]),
    fsal: true,
    pi_beta: 0.04,
    dense: Dense {
        order: 4,
        nodes: &[],
        a: &[],
        weights: &[&[
            -12_715_105_075.0 / 11_282_082_432.0,
            0.0,
            87_487_479_700.0 / 32_700_410_799.0,
            -10_690_763_975.0 / 1_880_347_072.0,
            701_980_252_875.0 / 199_316_789_632.0,
            -1_453_857_185.0 / 822_651_844.0,
            69_997_945.0 / 29_380_423.0,
        ]],
    },
};
