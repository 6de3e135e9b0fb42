//! Everything an evaluation gives, over every scalar: dual numbers against differences, eight lanes against eight calls,
//! a recording against what was recorded, on mechanisms drawn by chance with every joint and every force.

use crate::counting::allocations;
use crate::mechanisms::{
    apart, between, couple, derivative, drawing, law, loads, relation, Moment, Wishes, COUPLINGS, ROLLS, STEP,
};
use partita_math::program::Program;
use partita_math::scalar::{Dual, Lanes, Recorder, Recording, Scalar};
use partita_model::clusters::Preference;
use partita_model::coupling::{Contact, Law, Says};
use partita_model::force::{Element, LoadLaw};
use partita_model::measurement::Quantity;
use partita_model::spec::{
    Coupling, Force, Friction, Gravity, JointKind, PointForce, Spec, Table, Torque, Value, VectorValue,
};
use partita_model::value::{table_at, Functions, RELATION};
use partita_model::zero_position::Coordinates;
use partita_model::{Evaluator, Model};
use partita_system::prelude::*;
use partita_system::rates::MotionOver;
use partita_system::reduction::Reduction;
use partita_system::start;
use std::collections::BTreeSet;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::Arc;

const SPATIAL: Wishes = Wishes { planar: false, bound: true, drives: true };
const PLANAR: Wishes = Wishes { planar: true, bound: true, drives: true };
const COUNT: usize = 40;

/// Derivatives by dual numbers are exact but for user's functions (1e-9), differences of fourth order good to some 1e-8.
const RELATIVE: f64 = 1e-6;

type Failed = Box<dyn std::error::Error + Send + Sync>;

/// Smooth functions of everything.
struct OfState;

fn mixed(i: usize, t: f64, q: &[f64], v: &[f64]) -> f64 {
    let (a, b) = (q.len() - 1, v.len() - 1);
    (1.3 * t + i as f64 + q[0] * q[a]).sin() + 0.3 * v[0] * (1.0 + q[a / 2]).cos() - 0.2 * v[b]
}

impl Functions for OfState {
    fn count(&self) -> usize {
        3
    }
    fn scalar(&self, i: usize, t: f64, q: &[f64], v: &[f64]) -> Result<f64, Failed> {
        Ok(2.0 * mixed(i, t, q, v))
    }
    fn vector(&self, i: usize, t: f64, q: &[f64], v: &[f64]) -> Result<[f64; 3], Failed> {
        Ok([3, 4, 5].map(|k| mixed(i * k, t, q, v)))
    }
    fn motion(&self, _: usize, t: f64) -> Result<[f64; 3], Failed> {
        let (s, c) = (1.7 * t).sin_cos();
        Ok([0.3 * s + 0.2 * t, 0.51 * c + 0.2, -0.867 * s])
    }
    fn law(&self, i: usize, t: f64, seen: &[f64], out: &mut [f64]) -> Result<(), Failed> {
        law(i, t, seen, out);
        Ok(())
    }
    fn relation(&self, _: usize, t: f64, x: &[f64], rates: &[f64]) -> Result<[f64; RELATION], Failed> {
        Ok(relation(t, x, rates))
    }
}

/// A smooth table: one cubic, written twice.
fn table(rng: &mut fastrand::Rng) -> Value {
    let [a, b, c, d] = [0; 4].map(|_| between(rng, -1.0, 1.0));
    let (x, end) = (0.3, 2.0);
    let second = [a, 3.0 * a * x + b, (3.0 * a * x + 2.0 * b) * x + c, ((a * x + b) * x + c) * x + d];
    Value::Table(Table { breaks: vec![0.0, x, end], coefficients: vec![[a, b, c, d], second] })
}

/// Put tables in the place of functions: of all, or of half of them.
fn with_tables(rng: &mut fastrand::Rng, spec: &mut Spec, all: bool) {
    let swap = |rng: &mut fastrand::Rng, v: &mut Value| {
        if matches!(v, Value::Function(_)) && (all || rng.bool()) {
            *v = table(rng);
        }
    };
    for d in &mut spec.drives {
        swap(rng, &mut d.motion);
    }
    for f in &mut spec.forces {
        match f {
            Force::Torque(x) => swap(rng, &mut x.value),
            Force::Force(PointForce { value: VectorValue::Components(v), .. }) => {
                v.iter_mut().for_each(|v| swap(rng, v))
            }
            Force::Force(PointForce { value: VectorValue::Whole(v), .. }) => swap(rng, v),
            Force::Gravity(Gravity { value: VectorValue::Whole(v), .. }) => swap(rng, v),
            Force::Friction(Friction { held: Some(v), .. }) => swap(rng, v),
            _ => {}
        }
    }
}

/// Run `check` on `COUNT` mechanisms of each kind with a state each; `plain`: no functions.
fn everywhere(seed: u64, plain: bool, mut check: impl FnMut(&mut fastrand::Rng, &Model, &Moment)) {
    let mut rng = fastrand::Rng::with_seed(seed);
    let (mut kinds, mut elements, mut conditions) = (BTreeSet::new(), BTreeSet::new(), BTreeSet::new());
    for wishes in [SPATIAL, PLANAR] {
        let (mut done, mut drawn) = (0, 0);
        while done < COUNT {
            drawn += 1;
            assert!(drawn < 100 * COUNT, "only {done} of {drawn} drawings could be used");
            let mut spec = drawing(&mut rng, wishes);
            loads(&mut rng, &mut spec);
            spec.forces.retain(|f| !plain || !matches!(f, Force::Law(_)));
            // every kind of coupling in turn; one in ten has none
            let kind = done % (COUPLINGS + 1);
            let calls = kind == 3 || kind == 7;
            let left_out = plain && calls || wishes.planar && kind == ROLLS || kind == COUPLINGS;
            if !left_out && !couple(&mut rng, &mut spec, wishes.planar, kind) {
                continue;
            }
            for coupling in &mut spec.couplings {
                if let Coupling::Roll { slips, .. } = coupling {
                    *slips = done / (COUPLINGS + 1) % 2 == 0; // one after the other
                }
            }
            with_tables(&mut rng, &mut spec, plain);
            let Ok(model) = Model::new(spec, Arc::new(OfState), Coordinates::Relative) else { continue };
            let Some(moment) = Moment::random(&mut rng, &model).filter(|_| model.is_planar() == wishes.planar) else {
                continue;
            };
            kinds.extend(model.spec.joints.iter().map(|j| format!("{:?}", j.kind)));
            elements.extend(model.equations().full.elements.iter().map(|e| match e {
                Element::Spring(_) => "spring",
                Element::Load(load) => match (&load.law, load.sides.is_some()) {
                    (LoadLaw::SpringDamper(_), false) => "torsion",
                    (LoadLaw::SpringDamper(_), true) => "cut torsion",
                    (LoadLaw::Effort(_), false) => "effort",
                    (LoadLaw::Effort(_), true) => "cut effort",
                    (LoadLaw::Curve(_), _) => "effort over",
                    (LoadLaw::Friction(_), _) => "friction",
                    (LoadLaw::GasSpring(_), _) => "gas spring",
                    (LoadLaw::Stop(_), _) => "stop",
                    (LoadLaw::SetValued(_), _) => "friction that may stick",
                },
                Element::Force(f) if f.turns => "force that turns",
                Element::Force(_) => "force",
                Element::Bushing(_) => "bushing",
                Element::Contact(_) => "contact",
                Element::TwoPoint(e) => e.law.word(),
                Element::Tyre(_) => "tyre",
                Element::Law(_) => "law",
                Element::Weightless(_) => "weightless",
                Element::Gravity(_) => "gravity",
            }));
            conditions.extend(model.equations().full.conditions.iter().map(|c| {
                let form = match &c.says {
                    Says::Law(law, readings) => match (law, &readings[0].quantity) {
                        (Law::Linear { .. }, Quantity::Coordinate { .. }) => "coordinates",
                        (Law::Linear { .. }, Quantity::Distance(..)) => "distance",
                        (Law::Linear { .. }, Quantity::Along(..)) => "displacement",
                        (Law::Linear { .. }, _) => "angle of a cut joint",
                        (Law::Curve { .. }, _) => "curve",
                        (Law::Motion { .. }, _) => "motion",
                        (Law::Rate(_), _) => "rate",
                        (Law::Function(_), _) => "function",
                    },
                    Says::Turning(_) => "turn",
                    Says::Rolling(_, Contact::Touches) => "touch",
                    Says::Rolling(_, Contact::Rolls) => "roll",
                };
                (wishes.planar, form, c.holonomic)
            }));
            check(&mut rng, &model, &moment);
            done += 1;
        }
    }
    for planar in [false, true] {
        for form in ["coordinates", "distance", "displacement", "curve", "motion"] {
            assert!(conditions.contains(&(planar, form, true)), "no {form} ({planar}): {conditions:?}");
        }
        assert!(conditions.contains(&(planar, "rate", false)), "{conditions:?}");
        for holonomic in [false, true] {
            assert!(plain || conditions.contains(&(planar, "function", holonomic)), "{conditions:?}");
        }
    }
    for (form, holonomic) in [("touch", true), ("roll", false)] {
        assert!(conditions.contains(&(false, form, holonomic)), "no {form}: {conditions:?}");
    }
    use JointKind::{Cylindrical, Fixed, Free, Generic, Planar, Prismatic, Revolute, Spherical, Universal};
    for kind in [Revolute, Prismatic, Cylindrical, Universal, Spherical, Planar, Fixed, Free, Generic] {
        assert!(kinds.contains(&format!("{kind:?}")), "no {kind:?} joint was drawn");
    }
    assert_eq!(elements.len(), if plain { 18 } else { 19 }, "{elements:?}");
}

/// A choice of coordinates and the way to their accelerations: through one M_d, or over clusters.
struct Chosen<'m> {
    recursion: &'static str,
    reduction: Reduction<'m, Model>,
}

/// Every way to the accelerations at one instant.
fn choices<'m>(model: &'m Model, others: &'m [Model; 2], m: &Moment) -> Vec<Chosen<'m>> {
    let mut dense = Reduction::dense(model, m.rank);
    start::choose_partition(&mut dense, m.t, &m.q, None, None).unwrap();
    let independent = dense.planned.partition.independent.clone();
    let mut all = vec![Chosen { recursion: "M_d", reduction: dense }];
    for (recursion, model) in ["partial velocities", "range space"].into_iter().zip(others) {
        let mut reduction = Reduction::new(model, m.rank);
        reduction.position(m.t, &m.q).unwrap();
        reduction.refresh_scales(m.t, &m.q).unwrap();
        reduction.set_partition(m.t, &independent).unwrap();
        all.push(Chosen { recursion, reduction });
    }
    all
}

/// The same mechanism, gone through by partial velocities and by range space.
fn by_clusters(model: &Model) -> [Model; 2] {
    [Preference::PartialVelocities, Preference::RangeSpace].map(|recursion| {
        let again = Model::new((*model.spec).clone(), Arc::new(OfState), model.coordinates());
        again.unwrap().with_recursion(recursion)
    })
}

/// Where everything is asked for: t, q, v, v', λ, Dᵀ and δ one after the other.
struct Layout {
    nq: usize,
    nv: usize,
    rows: usize,
    nnz: usize,
    k: usize,
}

impl Layout {
    fn new(model: &Model) -> Self {
        let size = model.size();
        let k = size.nv.div_ceil(2);
        Self { nq: size.nq, nv: size.nv, rows: size.rows, nnz: model.pattern().nnz(), k }
    }

    fn input(&self, rng: &mut fastrand::Rng, m: &Moment) -> Vec<f64> {
        let mut x = vec![m.t];
        [&m.q, &m.v, &m.vdot, &m.lambda].into_iter().for_each(|part| x.extend(part));
        x.extend((0..self.nv * (self.k + 1)).map(|_| between(rng, -1.0, 1.0)));
        x
    }

    /// Every function of an evaluation, by name.
    fn everything<S: Scalar>(&self, e: &Evaluator<S>, choices: &[Chosen], x: &[S]) -> Vec<(&'static str, Vec<S>)> {
        let (t, rest) = (x[0], &x[1..]);
        let (q, rest) = rest.split_at(self.nq);
        let (v, rest) = rest.split_at(self.nv);
        let (vdot, rest) = rest.split_at(self.nv);
        let (lambda, rest) = rest.split_at(self.rows);
        let (dt, delta) = rest.split_at(self.nv * self.k);
        let memory = |n: usize| vec![S::zero(); n];
        let mut s = e.scratch();
        let (mut phi, mut c, mut a, mut b) =
            (memory(self.rows), memory(self.nnz), memory(self.rows), memory(self.rows));
        e.position(t, q, &mut s, &mut phi, &mut c, &mut a).unwrap();
        let mut diagonal = memory(self.nv);
        e.inverse_mass_diagonal(&mut s, &mut diagonal);
        e.velocity(t, q, v, &mut s, &mut b).unwrap();
        let (mut mass, mut h) = (memory(self.nv * self.nv), memory(self.nv));
        e.dynamics(t, q, v, &mut s, &mut mass, &mut h).unwrap();
        let (mut md, mut hd) = (memory(self.k * self.k), memory(self.k));
        e.project(t, q, v, (self.k, dt, delta), &mut s, &mut md, &mut hd).unwrap();
        let mut needed = memory(self.nv);
        e.inverse_dynamics(t, q, v, vdot, &mut s, &mut needed).unwrap();
        let energies = e.energies(t, q, v, &s).unwrap().to_vec();
        let mut qdot = memory(self.nq);
        e.rate(q, v, &mut qdot);
        let r = e.reactions(t, q, v, vdot, lambda, &mut s).unwrap();
        let wrenches = r.joints.iter().flat_map(|w| w.force.0.into_iter().chain(w.moment.0)).collect();
        let mut reduced = Vec::new();
        for chosen in choices {
            let choice = chosen.reduction.choice();
            let speeds: Vec<S> = choice.independent.iter().map(|&i| v[i]).collect();
            let mut x = chosen.reduction.system.evaluation(e, choice);
            let mut rates = memory(self.nq + choice.k() + 1);
            x.rates(t, q, &speeds, &mut rates).unwrap();
            let (mut residual, mut work, mut multipliers) = (memory(self.nv), memory(self.nv), memory(self.rows));
            x.of.inverse_dynamics(t, q, &x.v, &x.vdot, &mut residual).unwrap();
            choice.multipliers(&x.factors, &residual, &mut work, &mut multipliers);
            reduced.push((chosen.recursion, [rates, x.v, x.vdot, multipliers].concat()));
        }
        let mut all = vec![
            ("Phi", phi),
            ("C", c),
            ("a", a),
            ("b", b),
            ("diagonal of M^-1", diagonal),
            ("M", mass),
            ("h", h),
            ("M_d", md),
            ("h_d", hd),
            ("M v' - h", needed),
            ("energies and power", energies),
            ("N(q) v", qdot),
            ("reactions", wrenches),
            ("drives", r.drives.concat()),
        ];
        all.extend(reduced);
        all
    }
}

fn components<S>(all: Vec<(&'static str, Vec<S>)>) -> Vec<S> {
    all.into_iter().flat_map(|x| x.1).collect()
}

#[test]
fn dual_numbers_agree_with_differences() {
    everywhere(31, false, |rng, model, m| {
        let (layout, dual) = (Layout::new(model), model.over::<Dual>().unwrap());
        let others = by_clusters(model);
        let choices = choices(model, &others, m);
        let x = layout.input(rng, m);
        let along: Vec<f64> = x.iter().map(|_| between(rng, -1.0, 1.0)).collect();
        let moved = |h: f64| -> Vec<f64> { x.iter().zip(&along).map(|(x, d)| x + h * d).collect() };
        let differences = derivative(STEP, |h| components(layout.everything(model.equations(), &choices, &moved(h))));
        let duals: Vec<Dual> = x.iter().zip(&along).map(|(x, d)| Dual::new(*x, [*d])).collect();
        let (plain, duals) =
            (layout.everything(model.equations(), &choices, &x), layout.everything(&dual, &choices, &duals));
        let mut differences = &differences[..];
        for ((name, values), (_, duals)) in plain.iter().zip(&duals) {
            let (own, rest) = differences.split_at(values.len());
            differences = rest;
            assert!(values.iter().zip(duals).all(|(x, y)| x.to_bits() == y.re.to_bits()), "value of {name}");
            let slopes: Vec<f64> = duals.iter().map(|x| x.eps[0]).collect();
            assert!(apart(own, &slopes) < RELATIVE, "derivative of {name}: {:e}", apart(own, &slopes));
        }
    });
}

#[test]
fn eight_lanes_are_eight_evaluations() {
    everywhere(32, false, |rng, model, m| {
        let (layout, lanes) = (Layout::new(model), model.over::<Lanes>().unwrap());
        let others = by_clusters(model);
        let choices = choices(model, &others, m);
        let x = layout.input(rng, m);
        let mut along: Vec<f64> = x.iter().map(|_| between(rng, -0.05, 0.05)).collect();
        along[0] = along[0].abs(); // within the tables
        let at = |l: usize| -> Vec<f64> { x.iter().zip(&along).map(|(x, d)| x + l as f64 * d).collect() };
        let all: Vec<Vec<f64>> = (0..Lanes::COUNT).map(at).collect();
        let input: Vec<Lanes> = (0..x.len()).map(|i| Lanes::from_fn(|l| all[l][i])).collect();
        let together = layout.everything(&lanes, &choices, &input);
        for (l, x) in all.iter().enumerate() {
            for ((name, single), (_, together)) in
                layout.everything(model.equations(), &choices, x).iter().zip(&together)
            {
                let same = single.iter().zip(together).all(|(x, y)| x.to_bits() == y.0[l].to_bits());
                assert!(same, "{name} in lane {l}");
            }
        }
    });
}

#[test]
fn a_recording_is_the_evaluation() {
    everywhere(33, true, |rng, model, m| {
        let (layout, recorder) = (Layout::new(model), model.over::<Recorder>().unwrap());
        let others = by_clusters(model);
        let choices = choices(model, &others, m);
        let x = layout.input(rng, m);
        let made =
            Recording::new(x.len(), |x| Ok::<_, ()>(components(layout.everything(&recorder, &choices, x)))).unwrap();
        let (mut work, mut out) = (vec![0.0; made.len()], vec![0.0; made.outputs()]);
        let (lean, mut less) = (made.lean(), vec![0.0; made.outputs()]);
        assert!(lean.len() < made.len());
        // the last numbers settled
        let program = Program::new(&made, x.len() / 2..x.len());
        let (mut lanes, mut one) = (program.work::<Lanes, 2>(), program.work::<f64, 1>());
        for round in 0..3 {
            // both intervals of the tables
            let mut x: Vec<f64> = x.iter().map(|x| x + between(rng, -0.2, 0.2)).collect();
            x[0] = between(rng, 0.0, 0.6);
            made.evaluate(&x, &mut work, &mut out);
            let expected = components(layout.everything(model.equations(), &choices, &x));
            assert!(expected.iter().zip(&out).all(|(x, y)| x.to_bits() == y.to_bits()));
            // the same but for the sign of a zero
            lean.evaluate(&x, &mut work, &mut less);
            assert!(less.iter().zip(&out).all(|(x, y)| x == y));
            // one member among others, in another lane each time, and alone
            let member = 7 * round + 1;
            for (k, x) in x.iter().enumerate() {
                (0..16).for_each(|l| lanes.set(k, l, x + 1e-3 * (l as f64 - member as f64)));
                one.input(&program, k)[0] = *x;
            }
            let mut evaluate = || {
                lanes.prepare(&program);
                lanes.evaluate(&program);
                one.prepare(&program);
                one.evaluate(&program);
            };
            assert_eq!(allocations(&mut evaluate).1, 0);
            for (o, expected) in less.iter().enumerate() {
                assert_eq!(lanes.get(&program, o, member), *expected);
                assert_eq!(one.output(&program, o)[0], *expected);
            }
        }
    });
}

/// Counts how often a function is asked.
struct Counted(AtomicUsize);

impl Functions for Counted {
    fn count(&self) -> usize {
        3
    }
    fn scalar(&self, i: usize, t: f64, q: &[f64], v: &[f64]) -> Result<f64, Failed> {
        self.0.fetch_add(1, Ordering::Relaxed);
        OfState.scalar(i, t, q, v)
    }
    fn vector(&self, i: usize, t: f64, q: &[f64], v: &[f64]) -> Result<[f64; 3], Failed> {
        self.0.fetch_add(1, Ordering::Relaxed);
        OfState.vector(i, t, q, v)
    }
    fn motion(&self, i: usize, t: f64) -> Result<[f64; 3], Failed> {
        OfState.motion(i, t)
    }
}

/// Equations, energies and reactions each ask a force's function once; the equations share what they were told.
#[test]
fn a_function_is_called_once_for_each_force() {
    let mut rng = fastrand::Rng::with_seed(36);
    for _ in 0..COUNT {
        let (spec, counted) = (drawing(&mut rng, SPATIAL), Arc::new(Counted(AtomicUsize::new(0))));
        let Ok(model) = Model::new(spec, counted.clone(), Coordinates::Relative) else { continue };
        let function = |v: &Value| usize::from(matches!(v, Value::Function(_)));
        let named = model.spec.forces.iter().map(|f| match f {
            Force::Torque(Torque { value, .. }) | Force::Force(PointForce { value: VectorValue::Whole(value), .. }) => {
                function(value)
            }
            Force::Force(PointForce { value: VectorValue::Components(v), .. }) => v.iter().map(function).sum(),
            _ => 0,
        });
        let forces: usize = named.sum();
        let asked = |what: &str| assert_eq!(counted.0.swap(0, Ordering::Relaxed), forces, "{what}");
        let size = model.size();
        let (q, v, rows) = (model.initial(), vec![0.1; size.nv], vec![0.0; size.rows]);
        let (mut s, mut b) = (model.scratch(), rows.clone());
        let (mut phi, mut c, mut a) = (rows.clone(), vec![0.0; model.pattern().nnz()], rows.clone());
        model.position(0.2, &q, &mut s, &mut phi, &mut c, &mut a).unwrap();
        model.velocity(0.2, &q, &v, &mut s, &mut b).unwrap();
        let (mut mass, mut h, mut f) = (vec![0.0; size.nv * size.nv], v.clone(), v.clone());
        model.dynamics(0.2, &q, &v, &mut s, &mut mass, &mut h).unwrap();
        model.inverse_dynamics(0.2, &q, &v, &v, &mut s, &mut f).unwrap();
        asked("equations");
        model.energy(0.2, &q, &v, &s).unwrap();
        asked("energies");
        model.equations().reactions(0.2, &q, &v, &v, &rows, s.equations()).unwrap();
        asked("reactions");
    }
}

#[test]
fn a_function_cannot_be_recorded() {
    let mut rng = fastrand::Rng::with_seed(34);
    let mut spec = crate::mechanisms::in_space();
    spec.forces.push(Force::Force(PointForce {
        name: "push".into(),
        body: "body1".into(),
        point: [0.0; 3],
        value: VectorValue::Whole(Value::Function(0)),
        axes: Default::default(),
    }));
    let model = Model::new(spec.clone(), Arc::new(OfState), Coordinates::Relative).unwrap();
    let refused = model.over::<Recorder>().err().unwrap();
    assert_eq!((refused.element, refused.name.as_str()), ("force", "push"));
    with_tables(&mut rng, &mut spec, true);
    assert!(Model::new(spec, Arc::new(OfState), Coordinates::Relative).unwrap().over::<Recorder>().is_ok());
}

/// Velocity and acceleration of a drive are what dual numbers make of its position and velocity.
#[test]
fn rates_of_a_table_are_its_derivatives() {
    let mut rng = fastrand::Rng::with_seed(77);
    for _ in 0..50 {
        let Value::Table(table) = table(&mut rng) else { unreachable!() };
        for t in [0.0, 0.1, 0.29, 0.31, 1.0, 1.9] {
            let [x, u, a] = table_at(&table, Dual::variable(t), "a table").unwrap();
            // three products each
            assert!((x.eps[0] - u.re).abs() < 1e-14 * (1.0 + u.re.abs()), "{t}: {} {}", x.eps[0], u.re);
            assert!((u.eps[0] - a.re).abs() < 1e-14 * (1.0 + a.re.abs()), "{t}: {} {}", u.eps[0], a.re);
        }
    }
}
