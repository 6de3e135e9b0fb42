//! Breakpoints of the curves of a mechanism, and the quantities that they depend on.

use crate::coupling::{Condition, Law, Says};
use crate::evaluator::{with_engine, Evaluator, Scratch};
use crate::force::Element;
use crate::measurement::is_angle;
use crate::rows::Owner;
use crate::spec::{Coupling, Force, Spec, Table, Torque, Value};
use crate::time_domain;
use crate::value::Abscissa;
use partita_math::spatial::Space;
use partita_system::breakpoints::{Breakpoints, Enters, Reads};
use partita_system::watched::Reading;

/// The abscissa of a curve.
#[derive(Clone, Copy, Debug)]
enum Source {
    /// Time.
    Time,
    /// The second reading of condition number i.
    Condition(usize),
    /// Dependences of applied force number i.
    Element(usize),
}

/// The curves of a mechanism that have breakpoints.
#[derive(Clone, Debug)]
pub(crate) struct Curves {
    sources: Vec<Source>,
    pub breakpoints: Vec<Breakpoints>,
}

impl Curves {
    /// For a description and the elements made from it.
    pub fn new(spec: &Spec, model: &Evaluator<f64>) -> Self {
        let of_time = time_domain::breakpoints(spec).into_iter().map(|breakpoints| (Source::Time, breakpoints));
        let conditions = model.full.conditions.iter().enumerate();
        let couplings = conditions.filter_map(|(i, c)| Some((Source::Condition(i), of_condition(spec, model, c)?)));
        let elements = model.full.elements.iter().enumerate();
        let efforts = elements.filter_map(|(i, e)| Some((Source::Element(i), of_element(spec, model, e)?)));
        let (sources, breakpoints) = of_time.chain(couplings).chain(efforts).unzip();
        Self { sources, breakpoints }
    }

    /// Their abscissas and the rates of these at the point last evaluated.
    pub fn read(
        &self,
        model: &Evaluator<f64>,
        t: f64,
        (q, v): (&[f64], &[f64]),
        s: &mut Scratch<f64>,
        out: &mut [Reading],
    ) {
        for (source, out) in self.sources.iter().zip(out) {
            *out = with_engine!(model, s, |tree, s| {
                let reading = match source {
                    Source::Time => None,
                    Source::Condition(i) => match &tree.conditions[*i].says {
                        Says::Law(_, readings) => readings.get(1),
                        Says::Rolling(..) | Says::Turning(_) => None,
                    },
                    Source::Element(i) => match &tree.elements[*i] {
                        Element::Load(load) => Some(load.measured()),
                        _ => None,
                    },
                };
                match reading {
                    Some(r) => Reading::new(r.value(tree, s, q), r.rate(tree, s, v)),
                    None => Reading::new(t, 1.0),
                }
            });
        }
    }
}

impl Curves {
    /// Those of measurements that are read where they have a corner, in sentences.
    pub fn one_sided(
        &self,
        model: &Evaluator<f64>,
        t: f64,
        state: (&[f64], &[f64]),
        s: &mut Scratch<f64>,
    ) -> Vec<String> {
        let mut readings = vec![Reading::default(); self.breakpoints.len()];
        self.read(model, t, state, s, &mut readings);
        let every = self.sources.iter().zip(&self.breakpoints).zip(&readings);
        every
            .filter_map(|((source, curve), reading)| {
                let owner = match source {
                    Source::Time => return None,
                    Source::Condition(i) => model.full.conditions[*i].name.clone(),
                    Source::Element(i) => match &model.full.elements[*i] {
                        Element::Load(load) => load.name.clone(),
                        _ => return None,
                    },
                };
                let corner = curve.sharp_at(reading.x)?;
                Some(format!(
                    "the table of \"{owner}\" is read at {}, where its slope jumps: one on either side",
                    partita_math::formatted(corner)
                ))
            })
            .collect()
    }
}

fn of_table(table: &Table, enters: Enters, periodic: bool, angle: bool) -> Option<Breakpoints> {
    let reads = if angle { Reads::Angle } else { Reads::Other };
    Breakpoints::new(&table.breaks, &table.coefficients, enters, periodic, reads)
}

fn of_condition<G: Space>(spec: &Spec, model: &Evaluator<f64>, condition: &Condition<G>) -> Option<Breakpoints> {
    let (Says::Law(Law::Curve { curve, abscissa, .. }, _), Owner::Coupling(i)) = (&condition.says, condition.owner)
    else {
        return None;
    };
    let Coupling::Curve { terms, .. } = &spec.couplings[i] else { return None };
    of_table(curve, Enters::Position, *abscissa == Abscissa::Periodic, is_angle(&model.placed, terms.get(1)?))
}

fn of_element<G: Space>(spec: &Spec, model: &Evaluator<f64>, element: &Element<G>) -> Option<Breakpoints> {
    let Element::Load(load) = element else { return None };
    spec.forces.iter().find_map(|force| match force {
        Force::Torque(Torque { name, value: Value::Table(table), over: Some(over), periodic, .. })
            if *name == load.name =>
        {
            of_table(table, Enters::Effort, *periodic, is_angle(&model.placed, over))
        }
        _ => None,
    })
}
