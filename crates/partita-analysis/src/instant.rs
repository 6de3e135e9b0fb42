//! Quantities of any system at one state.

use partita_math::dense::{self, Matrix};
use partita_system::manifold::orthogonal::dense_rows;
use partita_system::partition::split::Split;
use partita_system::reduction::Reduction;
use partita_system::{start, ConstrainedSystem, SystemError};

/// Scratch memory for the position and the velocity level of a system.
pub struct Levels<'s, S: ConstrainedSystem> {
    system: &'s S,
    /// Scratch of the system, at the current state.
    pub scratch: S::Scratch,
    /// Φ.
    pub phi: Vec<f64>,
    /// C in pattern order.
    pub c: Vec<f64>,
    /// a.
    pub a: Vec<f64>,
    /// b.
    pub b: Vec<f64>,
}

impl<'s, S: ConstrainedSystem> Levels<'s, S> {
    /// Nothing evaluated yet.
    pub fn new(system: &'s S) -> Self {
        let size = system.size();
        Self {
            system,
            scratch: system.scratch(),
            phi: vec![0.0; size.holonomic],
            c: vec![0.0; system.pattern().nnz()],
            a: vec![0.0; size.rows],
            b: vec![0.0; size.rows],
        }
    }

    /// Φ, C and a at (t, q).
    ///
    /// # Errors
    /// Where the system cannot be evaluated; likewise below.
    pub fn position(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        self.system.position(t, q, &mut self.scratch, &mut self.phi, &mut self.c, &mut self.a)
    }

    /// Evaluate the levels of position, and b at v.
    pub fn velocity(&mut self, t: f64, q: &[f64], v: &[f64]) -> Result<(), SystemError> {
        self.position(t, q)?;
        self.system.velocity(t, q, v, &mut self.scratch, &mut self.b)
    }

    /// M and h, after `velocity` at the same state.
    pub fn dynamics(&mut self, t: f64, q: &[f64], v: &[f64]) -> Result<(Vec<f64>, Vec<f64>), SystemError> {
        let n = v.len();
        let (mut mass, mut h) = (vec![0.0; n * n], vec![0.0; n]);
        self.system.dynamics(t, q, v, &mut self.scratch, &mut mass, &mut h)?;
        Ok((mass, h))
    }
}

/// The equations at one instant, reduced by the best partition there; dense, for inspection.
#[derive(Clone, Debug)]
pub struct Instant {
    /// Velocities (n): those requested, or zero independent velocities.
    pub v: Vec<f64>,
    /// M (n x n).
    pub mass: Matrix,
    /// h (n).
    pub h: Vec<f64>,
    /// C (m x n).
    pub c: Matrix,
    /// a (m).
    pub a: Vec<f64>,
    /// b (m).
    pub b: Vec<f64>,
    /// The choice, A and D.
    pub split: Split,
    /// η (r).
    pub eta: Vec<f64>,
    /// ξ (r).
    pub xi: Vec<f64>,
    /// M_d (k x k).
    pub md: Matrix,
    /// h_d (k).
    pub hd: Vec<f64>,
    /// v' (n).
    pub vdot: Vec<f64>,
    /// λ (m), zero on redundant rows.
    pub multipliers: Vec<f64>,
    /// P4 (n).
    pub rho: Vec<f64>,
    /// σ of the choice.
    pub sigma: f64,
    /// √μ of the choice.
    pub sqrt_mu: f64,
}

/// S1-S5 and P1-P4 at (t, q, v), written out with dense matrices; the choice is the one a run would begin with.
///
/// `v` enters h and b as given. Without it the mechanism is at rest except for prescribed motion. Costs O(n³).
///
/// # Errors
/// Where the system cannot be evaluated or is in a singular position.
pub fn at<S: ConstrainedSystem>(system: &S, t: f64, q: &[f64], v: Option<&[f64]>) -> Result<Instant, SystemError> {
    let size = system.size();
    let found = start::analyse(system, t, q)?;
    let mut r = Reduction::new(system, found.rank);
    start::choose_partition(&mut r, t, q, None, None)?;
    r.evaluate(t, q, &vec![0.0; r.k()])?;
    let mut rho = vec![0.0; size.nv];
    r.measure(t, q, &mut rho)?;
    let quality = r.quality(t, q)?;
    let mut levels = Levels::new(system);
    levels.position(t, q)?;
    let all: Vec<usize> = (0..size.rows).collect();
    let c = dense_rows(system, &levels.c, &all);
    let split = Split::new(t, &r.planned.partition, &c)?;
    let eta = split.offset(&levels.a);
    let v = v.map_or_else(|| split.spread(&vec![0.0; r.k()], &eta), <[f64]>::to_vec);
    levels.velocity(t, q, &v)?;
    let (mass, h) = levels.dynamics(t, q, &v)?;
    let mass = Matrix::from_vec(size.nv, size.nv, mass);
    let xi = split.offset(&levels.b);
    let d = &split.d;
    let md = d.matmul(&mass).matmul(&d.transpose()); // M_d = D M Dᵀ                              (P3)
    let delta = split.spread(&vec![0.0; r.k()], &xi);
    let rest: Vec<f64> = h.iter().zip(mass.matvec(&delta)).map(|(h, x)| h - x).collect();
    let hd = d.matvec(&rest); // h_d = D (h − M [0; ξ])                                           (P3)
    let (mut l, mut u) = (md.data().to_vec(), hd.clone());
    dense::cholesky(&mut l, r.k()).map_err(|e| SystemError::Mass {
        name: system.structure().velocity_name(split.independent[e.index]),
        pivot: e.pivot,
    })?;
    dense::cholesky_solve(&l, r.k(), &mut u);
    let vdot = split.spread(&u, &xi); // v' = Dᵀ v_I' + [0; ξ]                                    (P2)
    let needed: Vec<f64> = mass.matvec(&vdot).iter().zip(&h).map(|(x, h)| x - h).collect();
    let mut lambda: Vec<f64> = split.dependent.iter().map(|&i| needed[i]).collect();
    split.solve_transposed(&mut lambda); // C_Dᵀ λ = (M v' − h)_D                                 (R1)
    let mut multipliers = vec![0.0; size.rows];
    for (&row, x) in split.rows.iter().zip(lambda) {
        multipliers[row] = x;
    }
    let (a, b) = (levels.a, levels.b);
    let (sigma, sqrt_mu) = (quality.sigma, quality.sqrt_mu);
    Ok(Instant { v, mass, h, c, a, b, split, eta, xi, md, hd, vdot, multipliers, rho, sigma, sqrt_mu })
}
