//! The identities of partition and measure on random systems in random units, each against another way to compute it.

use crate::instants::{between, block, forward, inverse, log_det, log_det_general, lower, tangent, vector, Instant};
use partita_math::dense::{self, Matrix};
use partita_math::factor;
use partita_system::equations::UserSystem;
use partita_system::manifold::orthogonal::MassProjection;
use partita_system::partition::{criterion, switch};
use partita_system::reduction::Reduction;

/// Worst condition of M in its own units.
const CONDITION: f64 = 1e6;
/// Partitions worse than this amplify everything that goes through them; their identities hold just as well, but say
/// less in sixteen digits.
const WORST: f64 = 1e-2;
/// Round-off (1e-16, a dozen operations an entry) times the condition of M, with the amplification 1/√μ <= 100 of the
/// worst partition left out: it strikes only quantities that are compared against their amplified size.
const TOLERANCE: f64 = 1e-8;
/// Sums of products compared with the sum of their magnitudes: n ε, and A itself is off by ε times the condition of the
/// scaled C_D, at most 1/√μ times that of M_c.
const ROUND_OFF: f64 = 1e-9;

/// A random system evaluated at a random partition of some quality.
struct Case<'s> {
    system: &'s UserSystem<Instant>,
    r: Reduction<'s, UserSystem<Instant>>,
    minv: Matrix,
    /// M_c.
    mc: Matrix,
    sqrt_mu: f64,
    sigma: f64,
}

impl Case<'_> {
    fn mass(&self) -> &Matrix {
        &self.system.equations.mass
    }
    fn c(&self) -> &Matrix {
        &self.system.equations.c
    }
    fn md(&self) -> Matrix {
        Matrix::from_vec(self.r.k(), self.r.k(), self.r.at.md.clone())
    }
    fn independent(&self) -> &[usize] {
        &self.r.planned.partition.independent
    }
    /// D in ascending order, as opposed to the order of elimination.
    fn dependent(&self) -> Vec<usize> {
        let mut d = self.r.planned.partition.dependent.clone();
        d.sort_unstable();
        d
    }
    fn all_rows(&self) -> Vec<usize> {
        (0..self.c().rows()).collect()
    }
    /// B of (25): all columns.
    fn b(&self) -> Matrix {
        let mut b = forward(&lower(&self.md()), &tangent(&self.r));
        for i in 0..b.rows() {
            for j in 0..b.cols() {
                b[(i, j)] /= self.r.scale.s2[j].sqrt();
            }
        }
        b
    }
}

/// Run `check` on many random systems, one random admissible partition each.
fn on_random_systems(seed: u64, mut check: impl FnMut(&mut fastrand::Rng, Case)) {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut done = 0;
    while done < 150 {
        let n = rng.usize(2..10);
        let m = rng.usize(1..n);
        let condition = 10f64.powf(between(&mut rng, 0.0, CONDITION.log10()));
        let system = Instant::random(&mut rng, n, m, condition).user_system();
        let mut order: Vec<usize> = (0..n).collect();
        rng.shuffle(&mut order);
        let mut independent = order[..n - m].to_vec();
        independent.sort_unstable();
        let (q, v) = (vector(&mut rng, n), vector(&mut rng, n - m));
        let mut r = Reduction::new(&system, m);
        r.position(0.0, &q).unwrap();
        r.refresh_scales(0.0, &q).unwrap();
        // natural speeds: of the size that one unit of energy gives
        let v: Vec<f64> = v.iter().zip(&independent).map(|(v, &i)| v * r.scales()[i]).collect();
        if r.set_partition(0.0, &independent).is_err() || r.evaluate(0.0, &q, &v).is_err() {
            continue;
        }
        let quality = r.quality(0.0, &q).unwrap();
        if quality.sqrt_mu < WORST {
            continue;
        }
        let minv = inverse(&system.equations.mass);
        let mc = system.equations.c.matmul(&minv).matmul(&system.equations.c.transpose());
        check(&mut rng, Case { system: &system, r, minv, mc, sqrt_mu: quality.sqrt_mu, sigma: quality.sigma });
        done += 1;
    }
}

/// |x − y| within `tolerance` times `size`.
#[track_caller]
fn near(x: f64, y: f64, size: f64, tolerance: f64) {
    assert!((x - y).abs() <= tolerance * size, "{x:e} against {y:e}: off by {:e} of {size:e}", (x - y).abs() / size);
}

/// Every entry within `tolerance` of the sum of magnitudes of the terms it was added up from.
#[track_caller]
fn product_near(x: &Matrix, a: &Matrix, b: &Matrix, tolerance: f64) {
    for i in 0..a.rows() {
        for j in 0..b.cols() {
            let sum: f64 = (0..a.cols()).map(|k| a[(i, k)] * b[(k, j)]).sum();
            let size: f64 = (0..a.cols()).map(|k| (a[(i, k)] * b[(k, j)]).abs()).sum();
            near(x[(i, j)], sum, size, tolerance);
        }
    }
}

#[test]
fn tangent_and_constraints_are_orthogonal() {
    on_random_systems(1, |_, case| {
        // (10) D Cᵀ = 0
        let d = tangent(&case.r);
        product_near(&Matrix::new(d.rows(), case.c().rows()), &d, &case.c().transpose(), ROUND_OFF);
        // (15) the mixed block of T M Tᵀ, with T = [C M⁻¹; D]
        let cm = case.c().matmul(&case.minv);
        let md = case.mass().matmul(&d.transpose());
        product_near(&Matrix::new(cm.rows(), d.rows()), &cm, &md, TOLERANCE);
    });
}

#[test]
fn velocities_and_accelerations_satisfy_the_constraints() {
    on_random_systems(2, |_, case| {
        // (9) in (3), (10) in (4): C v + a = 0, C v' + b = 0
        let e = &case.system.equations;
        let mut vdot = vec![0.0; e.mass.rows()];
        case.r.full_acceleration(&mut vdot);
        for (x, offset) in [(&case.r.at.v, &e.a), (&vdot, &e.b)] {
            for (i, o) in offset.iter().enumerate() {
                let terms: Vec<f64> = e.c.row(i).iter().zip(x).map(|(c, x)| c * x).collect();
                near(terms.iter().sum::<f64>(), -o, terms.iter().map(|t| t.abs()).sum::<f64>(), ROUND_OFF);
            }
        }
        // (9), (10): the independent ones are handed on untouched
        for (j, &i) in case.independent().iter().enumerate() {
            assert_eq!(vdot[i], case.r.at.vdot_independent[j]);
        }
    });
}

#[test]
fn reduced_equations_by_blocks() {
    on_random_systems(3, |_, case| {
        let (i, d) = (case.independent(), &case.r.planned.partition.dependent);
        let a = Matrix::from_vec(d.len(), i.len(), case.r.at.a_matrix.clone());
        let m = case.mass();
        let (mid, mdd) = (block(m, i, d), block(m, d, d));
        let mixed = mid.matmul(&a);
        let last = a.transpose().matmul(&mdd).matmul(&a);
        // (13)
        for x in 0..i.len() {
            for y in 0..i.len() {
                let terms = [m[(i[x], i[y])], mixed[(y, x)], mixed[(x, y)], last[(x, y)]];
                // A Mᴅᴅ A hides its own cancellation: measured by its diagonal
                let size = terms.iter().map(|t| t.abs()).sum::<f64>() + (last[(x, x)] * last[(y, y)]).sqrt();
                near(case.r.at.md[x * i.len() + y], terms.iter().sum(), size, ROUND_OFF);
            }
        }
        // (14) and (12)
        let xi: Vec<f64> = d.iter().map(|&j| case.r.at.delta[j]).collect();
        let h = &case.system.equations.h;
        let (f, g) = (mid.matvec(&xi), mdd.matvec(&xi));
        for x in 0..i.len() {
            let mut terms = vec![h[i[x]], -f[x]];
            terms.extend((0..d.len()).flat_map(|y| [a[(y, x)] * h[d[y]], -a[(y, x)] * g[y]]));
            let size = terms.iter().map(|t| t.abs()).sum::<f64>();
            near(case.r.reduced_force()[x], terms.iter().sum(), size, ROUND_OFF);
            let products: Vec<f64> =
                (0..i.len()).map(|y| case.r.at.md[x * i.len() + y] * case.r.at.vdot_independent[y]).collect();
            let size = size + products.iter().map(|t| t.abs()).sum::<f64>();
            near(products.iter().sum(), case.r.reduced_force()[x], size, ROUND_OFF);
        }
    });
}

#[test]
fn measure_from_both_sides() {
    on_random_systems(4, |_, case| {
        let (n, k) = (case.mass().rows(), case.r.k());
        let b = case.b();
        // (19)
        for i in 0..n {
            near(case.r.scale.s2[i], case.minv[(i, i)], case.minv[(i, i)], TOLERANCE);
        }
        let mut rho = vec![0.0; n];
        criterion::measure_tangent(
            &case.r.at.dt,
            k,
            &case.r.at.md_factor,
            &case.r.scale.s2,
            &mut vec![0.0; k],
            &mut rho,
        );
        let other = criterion::measure_constraint(case.mass(), case.c()).unwrap();
        // (20) by the dense projector, not by its factor
        let w = case.c().matmul(&case.minv);
        let projected = w.transpose().matmul(&inverse(&case.mc)).matmul(&w);
        for i in 0..n {
            assert!((0.0..=1.0).contains(&rho[i]), "{rho:?}");
            near(rho[i].powi(2), other[i].powi(2), 1.0, TOLERANCE); // (23)
            near(rho[i].powi(2) + projected[(i, i)] / case.minv[(i, i)], 1.0, 1.0, TOLERANCE); // (22)
            let column: f64 = (0..k).map(|j| b[(j, i)].powi(2)).sum(); // (25): |b_i| = ρ_i
            near(column.sqrt(), rho[i], 1.0, TOLERANCE);
        }
    });
}

#[test]
fn determinants() {
    on_random_systems(5, |_, case| {
        let (i, d) = (case.independent(), case.dependent());
        let cd = 2.0 * log_det_general(&block(case.c(), &case.all_rows(), &d));
        let (m, mc, md) = (log_det(case.mass()), log_det(&case.mc), log_det(&case.md()));
        near(cd + md, m + mc, 1.0, TOLERANCE); // (24)
        let scales: f64 = i.iter().map(|&i| case.minv[(i, i)].ln()).sum();
        let vol = 2.0 * log_det_general(&block(&case.b(), &(0..i.len()).collect::<Vec<_>>(), i));
        near(vol, -(md + scales), 1.0, TOLERANCE); // (28), tangent side
        near(vol, cd - (m + mc + scales), 1.0, TOLERANCE); // (28), constraint side
        let angles = -(md + log_det(&block(&case.minv, i, i)));
        near(angles, cd - (mc + log_det(&block(case.mass(), &d, &d))), 1.0, TOLERANCE); // (29)
        let (tangent, constrained) = principal_cosines(&case);
        for cosines in [&tangent, &constrained] {
            near(angles, cosines.iter().map(|c| 2.0 * c.ln()).sum(), 1.0, TOLERANCE);
        }
    });
}

/// Cosines between the span of the chosen gradients and the tangent space, and between the span of the dependent base
/// vectors and the constrained space.
fn principal_cosines(case: &Case) -> (Vec<f64>, Vec<f64>) {
    let (i, d) = (case.independent(), case.dependent());
    let k = i.len();
    // L_d⁻¹ D_I L_k⁻ᵀ with D_I = 1
    let x = forward(&lower(&case.md()), &Matrix::identity(k));
    let x = forward(&lower(&block(&case.minv, i, i)), &x.transpose());
    // L_c⁻¹ C_D L_DD⁻ᵀ
    let y = forward(&lower(&case.mc), &block(case.c(), &case.all_rows(), &d));
    let y = forward(&lower(&block(case.mass(), &d, &d)), &y.transpose());
    (factor::svd(&x).unwrap().s, factor::svd(&y).unwrap().s)
}

#[test]
fn quality_numbers() {
    on_random_systems(6, |_, case| {
        let i = case.independent();
        let k = i.len();
        let (tangent, constrained) = principal_cosines(&case);
        // (27): the smallest cosine from either side; all lie in [√μ, 1]
        for cosines in [&tangent, &constrained] {
            let smallest = cosines.iter().copied().fold(1.0, f64::min);
            near(smallest, case.sqrt_mu, case.sqrt_mu, TOLERANCE / WORST);
            assert!(cosines.iter().all(|c| *c <= 1.0 + TOLERANCE));
        }
        // (26)
        let s = factor::svd(&block(&case.b(), &(0..k).collect::<Vec<_>>(), i)).unwrap().s;
        near(s[k - 1], case.sigma, case.sigma, TOLERANCE / WORST);
        // (30)
        let mut scaled = case.md();
        let mut correlation = block(&case.minv, i, i);
        for x in 0..k {
            for y in 0..k {
                let n = (case.r.scale.s2[i[x]] * case.r.scale.s2[i[y]]).sqrt();
                scaled[(x, y)] *= n;
                correlation[(x, y)] /= n;
            }
        }
        let (values, _) = factor::symmetric_eigen(&scaled).unwrap();
        let condition = (s[0] / s[k - 1]).powi(2);
        near(values[k - 1] / values[0], condition, condition, 1e-6); // the smallest eigenvalue is lost to cond ε = 1e-10
        assert!(condition <= k as f64 / case.sigma.powi(2) * (1.0 + TOLERANCE));
        let (r, _) = factor::symmetric_eigen(&correlation).unwrap();
        assert!(case.sqrt_mu * r[0].sqrt() <= case.sigma * (1.0 + 1e-6));
        assert!(case.sigma <= case.sqrt_mu * r[k - 1].sqrt() * (1.0 + 1e-6));
        if k == 1 {
            near(case.sigma, case.sqrt_mu, case.sigma, TOLERANCE);
        }
    });
}

#[test]
fn a_switch_multiplies_the_volume_by_its_gain() {
    let mut seen = 0;
    on_random_systems(7, |rng, mut case| {
        let (i, d) = (case.independent().to_vec(), case.r.planned.partition.dependent.clone());
        let rows: Vec<usize> = (0..i.len()).collect();
        let b = case.b();
        // (31): B_I Âᵀ = B_D
        let s = case.r.scales();
        let hat = |p: usize, j: usize| case.r.at.a_matrix[p * i.len() + j] * s[i[j]] / s[d[p]];
        let hat_t =
            Matrix::from_vec(i.len(), d.len(), (0..i.len() * d.len()).map(|e| hat(e % d.len(), e / d.len())).collect());
        product_near(&block(&b, &rows, &d), &block(&b, &rows, &i), &hat_t, TOLERANCE);
        let best = switch::best(&case.r.at.a_matrix, s, &d, &i).unwrap();
        let largest = hat_t.data().iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        near(best.gain, largest, largest, 2e-9); // ties within 1e-9 go to the first
                                                 // a random switch, not only the best; gains below 1e-3 lead to
                                                 // partitions that sixteen digits do not carry
        let (p, j) = (rng.usize(0..d.len()), rng.usize(0..i.len()));
        let gain = hat(p, j).abs();
        if gain < 1e-3 {
            return;
        }
        let before = log_det_general(&block(&b, &rows, &i));
        let mut next = i.clone();
        next[j] = d[p];
        next.sort_unstable();
        case.r.set_partition(0.0, &next).unwrap();
        case.r.tangent(0.0).unwrap();
        let q = vec![0.0; case.mass().rows()];
        case.r.acceleration(0.0, &q).unwrap();
        let after = log_det_general(&block(&case.b(), &rows, &next));
        near(after - before, gain.ln(), 1.0, 1e-6); // a gain of 1e-3 amplifies the round-off of the new partition
        seen += 1;
    });
    assert!(seen > 100, "{seen}");
}

#[test]
fn three_formulas_for_the_multipliers() {
    on_random_systems(8, |rng, mut case| {
        let e = &case.system.equations;
        let (n, m) = (e.mass.rows(), e.c.rows());
        let q = vec![0.0; n];
        let mut vdot = vec![0.0; n];
        case.r.full_acceleration(&mut vdot);
        let mut from_dependent = vec![0.0; m];
        case.r.multipliers(0.0, &q, &vdot, &mut from_dependent).unwrap(); // (41)
        let p = MassProjection::new(case.system, 0.0, e.mass.data(), &e.c).unwrap();
        let solve = |x: Vec<f64>| {
            let mut x = x;
            dense::cholesky_solve(&p.mc, m, &mut x);
            x
        };
        let cm = e.c.matmul(&case.minv);
        let free = cm.matvec(&e.h);
        let range: Vec<f64> = solve(free.iter().zip(&e.b).map(|(f, b)| -(f + b)).collect()); // (40)
        let residual: Vec<f64> = e.mass.matvec(&vdot).iter().zip(&e.h).map(|(m, h)| m - h).collect();
        let fitted = solve(cm.matvec(&residual)); // (42)
                                                  // in natural units: a unit multiplier has the mass norm 1
        let w: Vec<f64> = (0..m).map(|i| case.mc[(i, i)].sqrt()).collect();
        let size = (0..m).fold(0.0, |s: f64, i| s.max((range[i] * w[i]).abs()));
        let (scaled, _) = factor::symmetric_eigen(&Matrix::from_vec(
            m,
            m,
            (0..m * m).map(|x| case.mc[(x / m, x % m)] / (w[x / m] * w[x % m])).collect(),
        ))
        .unwrap();
        // what nearly dependent rows share is lost in proportion to their condition
        let tolerance = 1e-13 * CONDITION * (scaled[m - 1] / scaled[0]).sqrt() / case.sqrt_mu;
        for i in 0..m {
            near(from_dependent[i] * w[i], range[i] * w[i], size, tolerance);
            near(fitted[i] * w[i], range[i] * w[i], size, tolerance);
        }
        // (41) amplifies what is wrong with M v' − h by 1/√μ at the most, (42) by one
        let wrong: Vec<f64> = (0..n).map(|i| between(rng, -1.0, 1.0) / case.r.scale.s2[i].sqrt()).collect();
        let norm = dense::dot(&wrong, &case.minv.matvec(&wrong)).sqrt();
        let mut x: Vec<f64> = case.r.planned.partition.dependent.iter().map(|&i| wrong[i]).collect();
        case.r.solve_transposed(&mut x);
        let mut lambda = vec![0.0; m];
        case.r.planned.partition.rows.iter().zip(&x).for_each(|(&row, x)| lambda[row] = *x);
        let mc_norm = |x: &[f64]| dense::dot(x, &case.mc.matvec(x)).sqrt();
        assert!(mc_norm(&lambda) <= norm / case.sqrt_mu * (1.0 + 1e-6));
        assert!(mc_norm(&solve(cm.matvec(&wrong))) <= norm * (1.0 + 1e-6));
    });
}

#[test]
fn oblique_corrections_are_at_most_one_over_root_mu_longer() {
    let mut worst: f64 = 0.0;
    on_random_systems(9, |rng, mut case| {
        let e = &case.system.equations;
        let (n, m) = (e.mass.rows(), e.c.rows());
        let p = MassProjection::new(case.system, 0.0, e.mass.data(), &e.c).unwrap();
        let mass_norm = |x: &[f64]| dense::dot(x, &e.mass.matvec(x)).sqrt();
        for _ in 0..5 {
            // (33) and (34) for the same Φ
            let phi: Vec<f64> = (0..m).map(|i| between(rng, -1.0, 1.0) * case.mc[(i, i)].sqrt()).collect();
            let orthogonal = mass_norm(&p.correction(&phi));
            let mut x: Vec<f64> = case.r.planned.partition.rows.iter().map(|&i| -phi[i]).collect();
            case.r.solve(&mut x, 1);
            let mut oblique = vec![0.0; n];
            case.r.planned.partition.dependent.iter().zip(&x).for_each(|(&i, x)| oblique[i] = *x);
            let ratio = mass_norm(&oblique) / orthogonal;
            assert!(ratio >= 1.0 - 1e-6, "{ratio}");
            assert!(ratio <= (1.0 + 1e-6) / case.sqrt_mu, "{ratio} with √μ = {}", case.sqrt_mu);
            worst = worst.max(ratio * case.sqrt_mu);
            // a wrong v_I: |Dᵀ δv|² <= δvᵀ ([M⁻¹]_II)⁻¹ δv / μ
            let i = case.independent().to_vec();
            let wrong: Vec<f64> = i.iter().map(|&i| between(rng, -1.0, 1.0) * case.r.scales()[i]).collect();
            case.r.at.gamma.fill(0.0);
            case.r.spread(&wrong);
            let block = inverse(&block(&case.minv, &i, &i));
            let free = dense::dot(&wrong, &block.matvec(&wrong)).sqrt();
            assert!(mass_norm(&case.r.at.v) <= free / case.sqrt_mu * (1.0 + 1e-6));
            assert!(mass_norm(&case.r.at.v) >= free * (1.0 - 1e-6));
        }
    });
    // with one constraint the bound is reached
    assert!(worst > 0.999, "{worst}");
}
