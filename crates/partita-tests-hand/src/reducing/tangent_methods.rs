//! The general selector (36) on random systems in random units: its identities, and that every rule for S gives the motion that
//! the equations with multipliers give.

use crate::instants::{between, commit, inverse, sample, vector, GivenTangent, Instant};
use partita_math::dense::{self, Matrix};
use partita_math::factor::{self, FactorError};
use partita_system::equations::UserSystem;
use partita_system::formulation::motion::TangentVelocities;
use partita_system::formulation::motion::UserTangent;
use partita_system::formulation::registry::by_name;
use partita_system::formulation::Formulation;
use partita_system::formulation::{Depth, StepDecision};
use partita_system::options::FormulationOptions;
use partita_system::record::Correction;
use partita_system::reduction::Reduction;
use partita_system::tangent::basis::{Basis, Rule};
use partita_system::tangent::frozen::Frozen;
use partita_system::tangent::TangentChoice;
use partita_system::tangent::TangentLevels;
use partita_system::SystemError;
use std::sync::Arc;

/// Worst condition of M in its own units: the reference inverts M and then M_c, each to ε times it.
const CONDITION: f64 = 1e3;
/// Sums of products against the sum of their magnitudes: n ε, times the condition of the scaled [S; C].
const ROUND_OFF: f64 = 1e-11;

/// Rows of the identity: a partition seen as a selector.
struct Picked(Vec<usize>);

impl Basis for Picked {
    fn name(&self) -> &'static str {
        "picked"
    }
    fn basis(&self, mass: &Matrix, _: &Matrix, _: Option<&Matrix>) -> Result<Matrix, FactorError> {
        let mut s = Matrix::new(self.0.len(), mass.rows());
        self.0.iter().enumerate().for_each(|(j, &i)| s[(j, i)] = 1.0);
        Ok(s)
    }
}

fn rules() -> [Box<dyn Basis>; 5] {
    [Rule::ZeroEigenvalue, Rule::SingularValues, Rule::OrthogonalTriangular, Rule::LiangLance, Rule::GramSchmidt]
        .map(|rule| Box::new(rule) as Box<dyn Basis>)
}

/// Random systems with a velocity of natural size that satisfies C v + a = 0.
fn on_random_systems(seed: u64, mut check: impl FnMut(&mut fastrand::Rng, &UserSystem<Instant>, &[f64], &[f64])) {
    let mut rng = fastrand::Rng::with_seed(seed);
    for _ in 0..60 {
        let n = rng.usize(2..10);
        let m = rng.usize(1..n);
        let condition = 10f64.powf(between(&mut rng, 0.0, CONDITION.log10()));
        let system = Instant::random(&mut rng, n, m, condition).user_system();
        let (q, speeds) = (vector(&mut rng, n), vector(&mut rng, n - m));
        let mut r = Reduction::new(&system, m);
        partita_system::start::choose_partition(&mut r, 0.0, &q, None, None).unwrap();
        let speeds: Vec<f64> =
            speeds.iter().zip(&r.planned.partition.independent).map(|(v, &i)| v * r.scales()[i]).collect();
        r.evaluate(0.0, &q, &speeds).unwrap();
        let v = r.at.v.clone();
        check(&mut rng, &system, &q, &v);
    }
}

/// √(xᵀ G x).
fn length(g: &Matrix, x: &[f64]) -> f64 {
    g.matvec(x).iter().zip(x).map(|(a, b)| a * b).sum::<f64>().max(0.0).sqrt()
}

fn uncorrected() -> FormulationOptions {
    FormulationOptions { correction: Correction::None, ..FormulationOptions::default() }
}

fn minus(x: &[f64], y: &[f64]) -> Vec<f64> {
    x.iter().zip(y).map(|(x, y)| x - y).collect()
}

/// S frozen at q, and all levels there with velocities v; u.
fn evaluated(x: &mut Frozen<UserSystem<Instant>>, q: &[f64], v: &[f64]) -> Vec<f64> {
    x.start(0.0, &mut q.to_vec(), v).unwrap();
    let mut u = vec![0.0; x.count()];
    x.select(v, &mut u);
    x.reduction().position(0.0, q).unwrap();
    x.tangent(0.0, q, false).unwrap();
    x.spread(&u);
    x.accelerate(0.0, q, &u).unwrap();
    u
}

/// D_Sᵀ: the velocities without those of time alone for each u of one; leaves those of u.
fn columns(x: &mut Frozen<UserSystem<Instant>>, u: &[f64]) -> Matrix {
    let (n, k) = (x.seen().at.v.len(), u.len());
    let mut d = Matrix::new(n, k);
    let mut unit = vec![0.0; k];
    x.spread(&unit);
    let rest = x.seen().at.v.clone();
    for j in 0..k {
        unit.fill(0.0);
        unit[j] = 1.0;
        x.spread(&unit);
        (0..n).for_each(|i| d[(i, j)] = x.seen().at.v[i] - rest[i]);
    }
    x.spread(u);
    d
}

/// S D_Sᵀ = 1, C D_Sᵀ = 0, C v + a = 0, C v' + b = 0, S v = u.
#[test]
fn identities_of_the_selector() {
    on_random_systems(1, |_, system, q, v| {
        for rule in rules() {
            let name = rule.name();
            let e = &system.equations;
            let (n, m) = (e.mass.rows(), e.c.rows());
            let k = n - m;
            let mut x = Frozen::new(system, m, rule, 0.5);
            let u = evaluated(&mut x, q, v);
            // S is orthonormal in units of its own: as covectors its rows may lie close together, which σ tells
            let sigma = x.fresh().sigma;
            let near = |row: &[f64], column: &dyn Fn(usize) -> f64, value: f64, size: f64, what: &str| {
                let (sum, terms) = (0..n).map(|i| row[i] * column(i)).fold((0.0, 0.0), |s, t| (s.0 + t, s.1 + t.abs()));
                assert!((sum - value).abs() <= ROUND_OFF * (terms + size), "{name}, {what}: {sum:e} for {value:e}");
            };
            let (mut vdot, mut udot) = (vec![0.0; n], vec![0.0; k]);
            x.full_acceleration(&mut vdot);
            x.rates(&mut udot);
            let (d, minv) = (columns(&mut x, &u), inverse(&e.mass));
            for j in 0..k {
                // the column of [S; C]⁻¹ of the j-th orthonormal covector; solved for none, what belongs to Φ is left
                let mut solved = |value: f64| {
                    let (mut values, mut column) = (vec![0.0; k], vec![0.0; n]);
                    values[j] = value;
                    x.solve(None, &mut values, &mut column);
                    column
                };
                let column = minus(&solved(1.0), &solved(0.0));
                let w = |i: usize| column[i];
                let row = |l: usize| &x.orthonormal()[l * n..(l + 1) * n];
                (0..k).for_each(|l| near(row(l), &w, f64::from(l == j), 1.0, "orthonormal S and D"));
                (0..m).for_each(|l| near(e.c.row(l), &w, 0.0, 0.0, "C D"));
                let lengths: Vec<f64> = (0..k).map(|l| length(&minv, x.selector().row(l))).collect();
                for l in 0..k {
                    let size = lengths[l] / lengths[j] / sigma;
                    near(x.selector().row(l), &|i| d[(i, j)], f64::from(l == j), size, "S D");
                }
                near(x.selector().row(j), &|i| x.seen().at.v[i], u[j], lengths[j] * length(&e.mass, v) / sigma, "S v");
                near(x.selector().row(j), &|i| vdot[i], udot[j], lengths[j] * length(&e.mass, &vdot), "S v'");
            }
            for l in 0..m {
                near(e.c.row(l), &|i| x.seen().at.v[i], -e.a[l], 0.0, "C v");
                near(e.c.row(l), &|i| vdot[i], -e.b[l], 0.0, "C v'");
            }
        }
    });
}

/// Every rule against the equations with multipliers: v, v' in the mass metric, λ in that of M_c.
#[test]
fn every_rule_moves_alike() {
    on_random_systems(2, |_, system, q, v| {
        let e = &system.equations;
        let (n, m) = (e.mass.rows(), e.c.rows());
        let mc = e.c.matmul(&inverse(&e.mass)).matmul(&e.c.transpose());
        let mut reference = by_name("range-space", system, m, &uncorrected()).unwrap();
        let mut y = vec![0.0; reference.layout().dim()];
        reference.start(0.0, q, v, &mut y).unwrap();
        let out = sample(&mut *reference, 0.0, &y);
        for rule in rules() {
            let name = rule.name();
            let mut f = TangentVelocities::new(system, m, rule, &uncorrected());
            let mut y = vec![0.0; f.layout().dim()];
            assert_eq!(f.layout().dim(), n + (n - m) + 1);
            f.start(0.0, q, v, &mut y).unwrap();
            let s = sample(&mut f, 0.0, &y);
            let off = length(&e.mass, &minus(&s.v, &out.v)) / length(&e.mass, &out.v);
            // u itself is short of digits where the rows of S lie close together
            assert!(off < 1e-12 / s.sigma, "{name}: v off by {off:e}");
            let off = length(&e.mass, &minus(&s.vdot, &out.vdot)) / length(&e.mass, &out.vdot);
            assert!(off < 1e-10, "{name}: v' off by {off:e}");
            let off = length(&mc, &minus(&s.multipliers, &out.multipliers)) / length(&mc, &out.multipliers);
            assert!(off < 1e-10, "{name}: multipliers off by {off:e}");
            // ρ belongs to the mechanism: any tangent gives it
            s.measure.iter().zip(&out.measure).for_each(|(x, y)| assert!((x - y).abs() < 1e-9, "{name}"));
            assert_eq!(s.independent, out.independent);
            // −λᵀ a is the power of the drive
            let mut dy = vec![0.0; f.layout().dim()];
            f.rates(0.0, &y, &mut dy, Depth::Rates).unwrap();
            let terms: Vec<f64> = out.multipliers.iter().zip(&e.a).map(|(l, a)| -l * a).collect();
            let size =
                terms.iter().map(|t| t.abs()).sum::<f64>() + length(&e.mass, &out.v) * length(&e.mass, &out.vdot);
            assert!((dy[2 * n - m] - terms.iter().sum::<f64>()).abs() < 1e-10 * size, "{name}: power");
        }
    });
}

/// A change rewrites u and u' from (v, v'): the motion does not notice.
#[test]
fn renewing_keeps_the_motion() {
    on_random_systems(3, |_, system, q, v| {
        let e = &system.equations;
        let (n, m) = (e.mass.rows(), e.c.rows());
        for rule in rules() {
            let mut f = TangentVelocities::new(system, m, rule, &uncorrected());
            let (mut y, mut dy) = (vec![0.0; f.layout().dim()], vec![0.0; f.layout().dim()]);
            f.start(0.0, q, v, &mut y).unwrap();
            let before = sample(&mut f, 0.0, &y);
            f.rates(0.0, &y, &mut dy, Depth::Rates).unwrap();
            commit(&mut f, StepDecision::Change, 0.0, &mut y, &mut dy);
            let after = sample(&mut f, 0.0, &y);
            assert_eq!(f.history().events.len(), 2);
            assert!(f.history().events[1].reason.contains("renewed"), "{}", f.history().events[1].reason);
            let off = length(&e.mass, &minus(&before.v, &after.v)) / length(&e.mass, &before.v);
            assert!(off < 1e-12 / before.sigma, "{}: {off:e}", f.history().name);
            let mut anew = vec![0.0; f.layout().dim()];
            f.rates(0.0, &y, &mut anew, Depth::Rates).unwrap();
            let (size, k) = (length(&e.mass, &before.vdot), n - m);
            let s = f.tangent();
            for j in 0..k {
                // |S_j v'| <= |S_j| |v'|
                let row = s.selector().row(j);
                let bound = length(&inverse(&e.mass), row) * size;
                assert!((anew[n + j] - dy[n + j]).abs() < 1e-10 * bound, "{}", f.history().name);
            }
        }
    });
}

/// Mass-orthonormal: M_d = 1, σ = √μ = 1 when frozen.
#[test]
fn gram_schmidt_is_best_where_it_is_frozen() {
    on_random_systems(4, |_, system, q, v| {
        let m = system.equations.c.rows();
        let mut x = Frozen::new(system, m, Box::new(Rule::GramSchmidt), 0.5);
        let u = evaluated(&mut x, q, v);
        let (d, k) = (columns(&mut x, &u), u.len());
        let md = d.transpose().matmul(&system.equations.mass).matmul(&d);
        for e in 0..k * k {
            let off = md[(e / k, e % k)] - f64::from(e % k == e / k);
            assert!(off.abs() < 1e-10, "{off:e}");
        }
        for quality in [x.fresh(), x.quality_here(0.0, q).unwrap()] {
            assert!(quality.sqrt_mu > 1.0 - 1e-10 && quality.sigma > 1.0 - 1e-10, "{quality:?}");
        }
        // other rules are oblique in the mass metric, never better
        for rule in rules() {
            let mut x = Frozen::new(system, m, rule, 0.5);
            x.start(0.0, &mut q.to_vec(), v).unwrap();
            assert!(x.fresh().sqrt_mu <= 1.0 && x.fresh().sqrt_mu > 0.0);
        }
    });
}

/// C of a generic mechanism along a smooth path, rows of length 1: three conditions on six velocities.
fn along(s: f64) -> Matrix {
    let mut c = Matrix::new(3, 6);
    for i in 0..3 {
        for j in 0..6 {
            let (phase, rate) = (f64::from((7 * i + 3 * j + i * j) as u32), f64::from((1 + (i + 2 * j) % 4) as u32));
            c[(i, j)] = (phase + rate * s).sin() + 0.3 * (phase - s).cos();
        }
        let length = c.row(i).iter().map(|x| x * x).sum::<f64>().sqrt();
        c.row_mut(i).iter_mut().for_each(|x| *x /= length);
    }
    c
}

/// A positive definite M in which no axis is special.
fn generic_mass() -> Matrix {
    let mut half = Matrix::new(6, 6);
    (0..36).for_each(|e| half[(e / 6, e % 6)] = f64::from((e * e + 5 * e) as u32 % 11) / 11.0 + f64::from(e % 7 == 0));
    half.matmul(&half.transpose())
}

fn apart(a: &Matrix, b: &Matrix) -> f64 {
    a.data().iter().zip(b.data()).fold(0.0, |m: f64, (x, y)| m.max((x - y).abs()))
}

/// The rows of `last` orthogonal to those of C, made orthonormal in their order, without any Gram-Schmidt process:
/// `P = 1 − Cᵀ (C Cᵀ)⁻¹ C`, `last P lastᵀ = L Lᵀ`, and `L⁻¹ last P` has such rows.
fn continuation(last: &Matrix, c: &Matrix) -> Matrix {
    let (n, k) = (c.cols(), last.rows());
    let on_c = c.transpose().matmul(&inverse(&c.matmul(&c.transpose()))).matmul(c);
    let mut free = Matrix::identity(n);
    (0..n * n).for_each(|e| free[(e / n, e % n)] -= on_c[(e / n, e % n)]);
    let projected = last.matmul(&free);
    let mut lower = projected.matmul(&projected.transpose()).into_vec();
    dense::cholesky(&mut lower, k).unwrap();
    let mut columns = projected.transpose();
    (0..n).for_each(|i| dense::cholesky_forward(&lower, k, columns.row_mut(i)));
    columns.transpose()
}

/// Each rule is what its name says, by its own definition, and no two of them are the same matrix.
#[test]
fn each_rule_is_its_own() {
    let (mass, c) = (generic_mass(), along(0.4));
    let before = Rule::LiangLance.basis(&mass, &along(0.1), None).unwrap();
    let all =
        [Rule::ZeroEigenvalue, Rule::SingularValues, Rule::OrthogonalTriangular, Rule::LiangLance, Rule::GramSchmidt];
    let bases = all.map(|rule| rule.basis(&mass, &c, Some(&before)).unwrap());
    let one = Matrix::identity(3);
    for (rule, s) in all.iter().zip(&bases) {
        let (metric, tangent) = match rule {
            Rule::GramSchmidt => (inverse(&mass), s.matmul(&inverse(&mass))),
            _ => (Matrix::identity(6), s.clone()),
        };
        assert!(apart(&s.matmul(&metric).matmul(&s.transpose()), &one) < 1e-13, "{rule:?} is orthonormal");
        assert!(c.matmul(&tangent.transpose()).max_abs() < 1e-14, "{rule:?} is tangent");
    }
    let [eigen, svd, qr, liang, _] = &bases;
    // eigenvectors of CᵀC, right singular vectors, what completes the columns of Cᵀ: as the factorisations have them
    let (values, vectors) = factor::symmetric_eigen(&c.transpose().matmul(&c)).unwrap();
    assert!(values[..3].iter().all(|x| x.abs() < 1e-14) && values[3] > 0.01);
    let found = factor::svd_full(&c).unwrap();
    let triangular = factor::qr_null_space(&c).unwrap();
    for j in 0..3 {
        for i in 0..6 {
            assert_eq!(eigen[(j, i)], vectors[(i, j)]);
            assert_eq!(svd[(j, i)], found.v[(i, 3 + j)]);
            assert_eq!(qr[(j, i)], triangular.null[(i, j)]);
        }
    }
    // Q₁ᵀ Cᵀ is triangular with the columns in order of the pivots, Q₂ᵀ Cᵀ is zero
    let r = triangular.range.transpose().matmul(&c.transpose());
    (0..3).for_each(|j| (j + 1..3).for_each(|i| assert!(r[(i, triangular.perm[j])].abs() < 1e-15)));
    // the old basis without what is prohibited now; with the same constraints the same basis
    assert!(apart(liang, &continuation(&before, &c)) < 1e-13);
    assert!(apart(&Rule::LiangLance.basis(&mass, &c, Some(liang)).unwrap(), liang) < 1e-14);
    // as matrices they are five, though four of them span one space
    for a in 0..5 {
        for b in 0..a {
            let off = apart(&bases[a], &bases[b]);
            assert!(off > 0.05, "{:?} and {:?} are {off:.1e} apart", all[a], all[b]);
        }
    }
    // what squaring the condition costs: a singular value of 1e-9 is none for CᵀC
    let mut weak = c.clone();
    for i in 0..6 {
        weak[(2, i)] = c[(0, i)] + 1e-9 * c[(2, i)];
    }
    let open = |rule: Rule| {
        let s = rule.basis(&mass, &weak, None).unwrap();
        c.matmul(&s.transpose()).max_abs()
    };
    assert!(open(Rule::ZeroEigenvalue) > 1e-3 && open(Rule::SingularValues) < 1e-6);
}

/// The formulation of a name freezes the rule of that name.
#[test]
fn a_name_stands_for_its_rule() {
    let names = ["zero-eigenvalue", "svd", "qr", "liang-lance", "gram-schmidt"];
    on_random_systems(8, |_, system, q, v| {
        let m = system.equations.c.rows();
        for (name, rule) in names.into_iter().zip(rules()) {
            assert_eq!(rule.name(), name);
            let mut f = by_name(name, system, m, &uncorrected()).unwrap();
            let mut y = vec![0.0; f.layout().dim()];
            f.start(0.0, q, v, &mut y).unwrap();
            let mut x = Frozen::new(system, m, rule, 0.5);
            x.start(0.0, &mut q.to_vec(), v).unwrap();
            assert_eq!(f.history().events[0].basis.as_deref().unwrap(), x.selector(), "{name}");
            assert_eq!(f.history().counters.renewals, 1);
        }
    });
}

/// Made anew from point to point along a smooth path: each basis from the one before where the rule does so.
fn followed(rule: Rule, points: u32) -> Vec<Matrix> {
    let mass = generic_mass();
    let mut all: Vec<Matrix> = Vec::new();
    for i in 0..=points {
        let s = rule.basis(&mass, &along(2.0 * f64::from(i) / f64::from(points)), all.last()).unwrap();
        all.push(s);
    }
    all
}

/// The basis of Liang and Lance is a differentiable function of time when it is made anew: neighbours are O(h) apart, and
/// three of them lie on a line to O(h²). Other orthonormal bases of the same space jump, however short the step.
#[test]
fn a_basis_that_continues_the_last_one() {
    let distances = |rule: Rule, points: u32| {
        let all = followed(rule, points);
        let first = all.windows(2).map(|x| apart(&x[1], &x[0])).fold(0.0, f64::max);
        let second = all.windows(3).map(|x| {
            let bent = |e: usize| (x[2].data()[e] - 2.0 * x[1].data()[e] + x[0].data()[e]).abs();
            (0..18).map(bent).fold(0.0, f64::max)
        });
        (first, second.fold(0.0, f64::max))
    };
    let (one, two, four) =
        (distances(Rule::LiangLance, 2000), distances(Rule::LiangLance, 4000), distances(Rule::LiangLance, 8000));
    for (coarse, fine) in [(one, two), (two, four)] {
        assert!((coarse.0 / fine.0 - 2.0).abs() < 0.05, "{one:?} {two:?} {four:?}");
        assert!((coarse.1 / fine.1 - 4.0).abs() < 0.3, "{one:?} {two:?} {four:?}");
    }
    assert!(four.0 < 0.03, "{four:?}");
    for rule in [Rule::OrthogonalTriangular, Rule::SingularValues] {
        let jump = distances(rule, 8000).0;
        assert!(jump > 0.3, "{rule:?}: {jump:.2e}");
    }
    // all of them span the tangent space of now
    for (i, s) in followed(Rule::LiangLance, 100).iter().enumerate() {
        assert!(along(0.02 * i as f64).matmul(&s.transpose()).max_abs() < 1e-14);
        assert!(apart(&s.matmul(&s.transpose()), &Matrix::identity(3)) < 1e-13);
    }
}

/// Rows of the identity in S: the partition itself, with its D, its σ and its √μ.
#[test]
fn rows_of_the_identity_are_a_partition() {
    on_random_systems(5, |_, system, q, v| {
        let (n, m) = (system.equations.mass.rows(), system.equations.c.rows());
        let mut r = Reduction::new(system, m);
        partita_system::start::choose_partition(&mut r, 0.0, q, None, None).unwrap();
        let independent = r.planned.partition.independent.clone();
        let u: Vec<f64> = independent.iter().map(|&i| v[i]).collect();
        r.evaluate(0.0, q, &u).unwrap();
        let wanted = r.quality(0.0, q).unwrap();
        let mut x = Frozen::new(system, m, Box::new(Picked(independent)), 0.5);
        evaluated(&mut x, q, v);
        let (d, k) = (columns(&mut x, &u), n - m);
        for i in 0..n {
            for j in 0..k {
                // entries in natural scales
                let scale = r.scales()[i] / r.scales()[r.planned.partition.independent[j]];
                assert!((d[(i, j)] - r.at.dt[i * k + j]).abs() < 1e-10 * scale);
            }
            assert!(
                (x.seen().at.v[i] - r.at.v[i]).abs()
                    < 1e-10 * r.scales()[i] * (1.0 + (r.at.v[i] / r.scales()[i]).abs())
            );
        }
        let found = x.quality_here(0.0, q).unwrap();
        assert!((found.sigma - wanted.sigma).abs() < 1e-10, "{} {}", found.sigma, wanted.sigma);
        assert!((found.sqrt_mu - wanted.sqrt_mu).abs() < 1e-10, "{} {}", found.sqrt_mu, wanted.sqrt_mu);
    });
}

/// A partition that C_D cannot be solved for is refused with the basis named, not the mechanism.
#[test]
fn a_basis_that_does_not_fit_is_blamed_itself() {
    // q0 is fixed by the constraint: it cannot be independent
    let c = Matrix::from_rows(&[&[1.0, 0.0, 0.0]]);
    let still = Instant { mass: Matrix::identity(3), c, h: vec![0.0; 3], a: vec![0.0], b: vec![0.0] };
    let system = still.user_system();
    let mut x = Frozen::new(&system, 1, Box::new(Picked(vec![0, 1])), 0.5);
    let refused = x.start(0.0, &mut [0.0; 3], &[0.0; 3]).unwrap_err();
    let words = refused.to_string();
    assert!(refused.is_local() && words.contains("\"picked\"") && words.contains("regular"), "{words}");
}

/// Valid at the first call; linearly dependent covectors afterwards.
struct Once(std::sync::atomic::AtomicBool);

impl Basis for Once {
    fn name(&self) -> &'static str {
        "once"
    }
    fn basis(&self, mass: &Matrix, c: &Matrix, _: Option<&Matrix>) -> Result<Matrix, FactorError> {
        let used = self.0.swap(true, std::sync::atomic::Ordering::Relaxed);
        let mut s = Rule::OrthogonalTriangular.basis(mass, c, None)?;
        if used {
            let first = s.row(0).to_vec();
            (0..s.rows()).for_each(|j| s.row_mut(j).copy_from_slice(&first));
        }
        Ok(s)
    }
}

/// A renewal that fails leaves everything as it was, and the notes tell.
#[test]
fn a_basis_that_cannot_be_renewed_stays() {
    on_random_systems(6, |_, system, q, v| {
        let (n, m) = (system.equations.mass.rows(), system.equations.c.rows());
        if n - m < 2 {
            return; // one covector always fits
        }
        let rule = Box::new(Once(std::sync::atomic::AtomicBool::new(false)));
        let mut f = TangentVelocities::new(system, m, rule, &uncorrected());
        let (mut y, mut dy) = (vec![0.0; f.layout().dim()], vec![0.0; f.layout().dim()]);
        f.start(0.0, q, v, &mut y).unwrap();
        f.rates(0.0, &y, &mut dy, Depth::Rates).unwrap();
        let (before, slope) = (y.clone(), dy.clone());
        commit(&mut f, StepDecision::Change, 0.0, &mut y, &mut dy);
        assert_eq!((&y, &dy), (&before, &slope));
        f.rates(0.0, &y, &mut dy, Depth::Rates).unwrap();
        assert_eq!(dy, slope);
        assert_eq!(f.history().events.len(), 1);
        assert!(f.history().notes.iter().any(|n| n.contains("the old one was kept")), "{:?}", f.history().notes);
    });
}

/// Any D, γ, δ that fit give the motion of the equations with multipliers; each that does not fit is refused by its row.
#[test]
fn tangent_velocities_of_the_user() {
    on_random_systems(7, |rng, system, q, v| {
        let e = &system.equations;
        let (n, m) = (e.mass.rows(), e.c.rows());
        let k = n - m;
        let mut r = Reduction::new(system, m);
        partita_system::start::choose_partition(&mut r, 0.0, q, None, None).unwrap();
        let speeds: Vec<f64> = r.planned.partition.independent.iter().map(|&i| v[i]).collect();
        r.evaluate(0.0, q, &speeds).unwrap();
        // Dᵀ of the partition in natural scales, times a random T, far from singular
        let mut mix = Matrix::from_vec(k, k, vector(rng, k * k));
        (0..k).for_each(|j| mix[(j, j)] += 3.0 * k as f64);
        let mut dt = Matrix::from_vec(n, k, r.at.dt.clone());
        for i in 0..n {
            (0..k).for_each(|j| dt[(i, j)] *= r.scales()[r.planned.partition.independent[j]]);
        }
        let dt = dt.matmul(&mix).into_vec();
        let good = GivenTangent { dt, gamma: r.at.gamma.clone(), delta: r.at.delta.clone() };
        let scales = r.scales().to_vec();
        let start = |map: &GivenTangent, v: &[f64]| {
            let options = FormulationOptions { tangent: Some(Arc::new(map.clone())), ..uncorrected() };
            let mut f = UserTangent::new(system, m, &options).unwrap();
            let mut y = vec![0.0; f.layout().dim()];
            f.start(0.0, q, v, &mut y).map(|()| (f, y))
        };
        let (mut f, y) = start(&good, v).unwrap();
        let mut reference = by_name("range-space", system, m, &uncorrected()).unwrap();
        let mut whole = vec![0.0; reference.layout().dim()];
        reference.start(0.0, q, v, &mut whole).unwrap();
        let (out, s) = (sample(&mut *reference, 0.0, &whole), sample(&mut f, 0.0, &y));
        let mc = e.c.matmul(&inverse(&e.mass)).matmul(&e.c.transpose());
        assert!(length(&e.mass, &minus(&s.v, &out.v)) < 1e-10 * length(&e.mass, &out.v));
        assert!(length(&e.mass, &minus(&s.vdot, &out.vdot)) < 1e-10 * length(&e.mass, &out.vdot));
        assert!(length(&mc, &minus(&s.multipliers, &out.multipliers)) < 1e-9 * length(&mc, &out.multipliers));
        assert!(s.sqrt_mu > 1.0 - 1e-9 && s.sigma > 1e-3, "{} {}", s.sqrt_mu, s.sigma);
        assert!(f.history().notes.is_empty());
        // one column, the offset, the bias, the velocity: each pushed off the constraints by a natural amount
        let off = rng.usize(0..n);
        let mut bad = good.clone();
        bad.dt[off * k] += 10.0 * k as f64 * scales[off];
        let words = start(&bad, v).err().unwrap().to_string();
        assert!(words.contains("tangent velocity 0 violates constraint"), "{words}");
        let mut bad = good.clone();
        bad.gamma[off] += scales[off];
        let words = start(&bad, v).err().unwrap().to_string();
        assert!(words.contains("offset") && words.contains("C gamma + a"), "{words}");
        let mut bad = good.clone();
        bad.delta[off] +=
            10.0 * scales[off] * (1.0 + r.at.delta.iter().zip(&scales).fold(0.0, |m: f64, (d, s)| m.max(d.abs() / s)));
        let words = start(&bad, v).err().unwrap().to_string();
        assert!(words.contains("bias") && words.contains("C delta + b"), "{words}");
        let mut wrong = v.to_vec();
        wrong[off] += scales[off];
        let words = start(&good, &wrong).err().unwrap().to_string();
        assert!(words.contains("not a combination"), "{words}");
        if k > 1 {
            let mut bad = good.clone();
            (0..n).for_each(|i| bad.dt[i * k + 1] = bad.dt[i * k]);
            let words = start(&bad, v).err().unwrap().to_string();
            assert!(words.contains("linearly dependent"), "{words}");
        }
        let mut bad = good.clone();
        bad.dt[off * k] = f64::NAN;
        assert!(matches!(start(&bad, v).err().unwrap(), SystemError::NotFinite { .. }));
    });
}
