//! The coefficients of Radau IIA with three stages (Hairer and Wanner, Solving Ordinary Differential Equations II, IV.8).
//!
//! ```text
//! Z_i = h Σ_j A_ij f(t + c_j h, y + Z_j)      A⁻¹ T = T Λ,   Λ = diag(γ, [α β; −β α])
//! ```

use std::sync::LazyLock;

/// Stages.
pub(super) const S: usize = 3;

/// Order of its estimate. Unit: order. Reason: Hairer's and Wanner's.
pub(super) const ESTIMATE_ORDER: usize = 3;

/// A matrix over stages.
pub(super) type Stages = [[f64; S]; S];

/// γ, the real eigenvalue of A⁻¹. Unit: number. Reason: Hairer's and Wanner's.
pub(super) const REAL: f64 = 3.637_834_252_744_496;
/// α and β of the other eigenvalues, α ± i β. Unit: number. Reason: Hairer's and Wanner's.
pub(super) const COMPLEX: [f64; 2] = [2.681_082_873_627_752, 3.050_430_199_247_41];
/// T.
pub(super) const T: Stages = [
    [0.094_438_762_488_975_24, -0.141_255_295_020_954_2, 0.030_029_194_105_147_42],
    [0.250_213_122_965_333_3, 0.204_129_352_293_799_93, -0.382_942_112_757_261_9],
    [1.0, 1.0, 0.0],
];
/// T⁻¹.
pub(super) const T_INVERSE: Stages = [
    [4.178_718_591_551_905, 0.327_682_820_761_062_4, 0.523_376_445_499_449_5],
    [-4.178_718_591_551_905, -0.327_682_820_761_062_4, 0.476_623_554_500_550_5],
    [0.502_872_634_945_786_8, -2.571_926_949_855_605, 0.596_039_204_828_224_9],
];
/// `f + Σ e_i Z_i / h` is γ times the estimate of order three, times the rate.
pub(super) const ERROR: [f64; S] = [-10.048_809_399_827_415, 1.382_142_733_160_748_5, -1.0 / 3.0];

/// c, A and A⁻¹.
pub(super) struct Nodes {
    pub(super) c: [f64; S],
    pub(super) a: Stages,
    pub(super) inverse: Stages,
    /// The second divided difference of the slopes at c, for Z over a step of length 1.
    pub(super) second: [f64; S],
}

pub(super) static NODES: LazyLock<Nodes> = LazyLock::new(|| {
    let root = 6f64.sqrt();
    let c = [(4.0 - root) / 10.0, (4.0 + root) / 10.0, 1.0];
    let a = [
        [(88.0 - 7.0 * root) / 360.0, (296.0 - 169.0 * root) / 1800.0, (3.0 * root - 2.0) / 225.0],
        [(296.0 + 169.0 * root) / 1800.0, (88.0 + 7.0 * root) / 360.0, (-2.0 - 3.0 * root) / 225.0],
        [(16.0 - root) / 36.0, (16.0 + root) / 36.0, 1.0 / 9.0],
    ];
    let inverse = [
        [3.224_744_871_391_589, 1.167_840_084_690_405_5, -0.253_197_264_742_180_83],
        [-3.567_840_084_690_405_5, 0.775_255_128_608_411, 1.053_197_264_742_180_8],
        [5.531_972_647_421_808, -7.531_972_647_421_808, 5.0],
    ];
    let weight = |i: usize| 1.0 / (0..S).filter(|&j| j != i).map(|j| c[i] - c[j]).product::<f64>();
    let second = std::array::from_fn(|j| (0..S).map(|i| weight(i) * inverse[i][j]).sum::<f64>());
    Nodes { c, a, inverse, second }
});

impl Nodes {
    /// Weights of Z at part θ of the step, for the polynomial of the stages through y: 0, Z_1, Z_2, Z_3 at 0, c_1, c_2, 1.
    pub(super) fn weights(&self, theta: f64) -> [f64; S] {
        std::array::from_fn(|i| {
            let own = self.c[i];
            let others = (0..S).filter(|&j| j != i).map(|j| (theta - self.c[j]) / (own - self.c[j]));
            theta / own * others.product::<f64>()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(a: &Stages, b: &Stages) -> Stages {
        std::array::from_fn(|i| std::array::from_fn(|j| (0..S).map(|l| a[i][l] * b[l][j]).sum()))
    }

    #[test]
    fn the_transformation_separates_the_stages() {
        let [re, im] = COMPLEX;
        let blocks = [[REAL, 0.0, 0.0], [0.0, re, im], [0.0, -im, re]];
        let made = times(&times(&T, &blocks), &T_INVERSE);
        let one = times(&NODES.a, &NODES.inverse);
        for i in 0..S {
            for j in 0..S {
                assert!((made[i][j] - NODES.inverse[i][j]).abs() < 3e-14, "{i} {j}");
                assert!((one[i][j] - f64::from(u8::from(i == j))).abs() < 1e-14, "{i} {j}");
            }
        }
    }

    #[test]
    fn quadrature_by_the_nodes_is_exact_to_degree_four() {
        for power in 0..5 {
            let sum: f64 = NODES.c.iter().zip(&NODES.a[2]).map(|(c, b)| b * c.powi(power)).sum();
            assert!((sum - 1.0 / f64::from(power + 1)).abs() < 1e-15, "{power}");
        }
    }

    #[test]
    fn the_polynomial_of_the_stages_passes_through_them() {
        for i in 0..S {
            let weights = NODES.weights(NODES.c[i]);
            (0..S).for_each(|j| assert!((weights[j] - f64::from(u8::from(i == j))).abs() < 1e-15));
        }
        assert_eq!(NODES.weights(0.0), [0.0; S]);
    }

    #[test]
    fn the_estimate_is_a_third_difference_of_slopes() {
        // y' = a cubic: the slope at 0 and the increments of the stages
        let all = [0.0, NODES.c[0], NODES.c[1], NODES.c[2]];
        let third: [f64; S + 1] =
            std::array::from_fn(|i| 1.0 / (0..=S).filter(|&j| j != i).map(|j| all[i] - all[j]).product::<f64>());
        let slope = |x: f64| 1.0 + 2.0 * x - x * x + 5.0 * x * x * x;
        let value = |x: f64| x + x * x - x * x * x / 3.0 + 1.25 * x.powi(4);
        let slopes = all.map(slope);
        let found: f64 = third.iter().zip(slopes).map(|(w, f)| w * f).sum();
        assert!((found - 5.0).abs() < 1e-13);
        let z: [f64; S] = std::array::from_fn(|i| (0..S).map(|j| NODES.a[i][j] * slope(NODES.c[j])).sum());
        assert!((z[2] - value(1.0)).abs() < 1e-14);
        let estimate = slope(0.0) + ERROR.iter().zip(z).map(|(e, z)| e * z).sum::<f64>();
        assert!((estimate.abs() - 0.1 * 5.0).abs() < 1e-13, "{estimate}");
        let second: f64 = NODES.second.iter().zip(z).map(|(w, z)| w * z).sum();
        // of the cubic at three nodes: -1 and 5 times their sum
        assert!((second - (-1.0 + 5.0 * NODES.c.iter().sum::<f64>())).abs() < 1e-12, "{second}");
    }
}
