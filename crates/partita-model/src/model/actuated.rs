//! A mechanism moved by actuators: forces along measurements in place of prescribed motions.
//!
//! ```text
//! M v' = h + Cᵀ λ + E τ        a column of E: the unit wrench of a measurement
//! ```
//!
//! The gradient of a measurement is a row of C for a drive and a column of E for an actuator. So an actuated mechanism
//! has a row for each actuator, whose multiplier is an effort, and which constrains nothing.

use super::{driven_once, drives, Model};
use crate::compile;
use crate::error::DescriptionError;
use crate::evaluator::Follow;
use crate::freed::Freed;
use crate::measurement::{drivable, is_angle, Maker, Quantity};
use crate::numbers::Numbers;
use crate::reaction_friction::{Elsewhere, Following};
use crate::rows::Owner;
use crate::spec::{Drive, Force, Level, Measure, PointForce, Spec, Table, Value, VectorValue};
use crate::value;
use partita_math::spatial::Spatial;
use partita_math::tolerance;
use partita_system::system::Levels;
use partita_system::SystemError;
use std::collections::HashMap;
use std::sync::Arc;

/// A force whose given effort is replaced by that of an actuator: its number, and the component where it has three.
pub type Silent = (usize, Option<usize>);

/// Set the given effort to zero; a function that returns all components is left out as a whole.
fn silence(force: &mut Force, component: Option<usize>) {
    match (force, component) {
        (Force::Torque(x), _) => (x.value, x.over) = (Value::Constant(0.0), None),
        (Force::Force(PointForce { value: VectorValue::Components(all), .. }), Some(i)) if i < 3 => {
            all[i] = Value::Constant(0.0);
        }
        (Force::Force(x), _) => x.value = VectorValue::Components([0.0; 3].map(Value::Constant)),
        _ => {}
    }
}

impl Spec {
    fn silence(&mut self, i: usize, component: Option<usize>) {
        if let Some(force) = self.forces.get_mut(i) {
            silence(force, component);
        }
    }
}

impl Model {
    /// The same mechanism in the same coordinates with nothing prescribed; the forces `silent` have the effort 0.
    ///
    /// # Errors
    /// Where its equations cannot be made.
    pub fn released(&self, silent: &[Silent]) -> Result<Self, DescriptionError> {
        self.remade(|spec| {
            spec.drives = Vec::new();
            silent.iter().for_each(|&(i, component)| spec.silence(i, component));
        })
    }

    /// As [`released`](Self::released), with a row for each measurement of `actuators`, which constrains nothing: its
    /// multiplier is the effort along it. What the motion determines is that of the mechanism itself.
    ///
    /// # Errors
    /// As `released`, and where a measurement does not exist.
    pub fn with_actuators(
        self: &Arc<Self>,
        actuators: Vec<Drive>,
        silent: &[Silent],
    ) -> Result<Self, DescriptionError> {
        driven_once(&actuators)?;
        let mut made = self.remade(|spec| {
            spec.drives = actuators;
            silent.iter().for_each(|&(i, component)| spec.silence(i, component));
        })?;
        made.mechanism = Some(self.clone());
        Ok(made)
    }

    /// The same mechanism in the same coordinates with those of its drives alone whose names `acts` accepts, and with
    /// frictions that slip in the sense that `slips` gives for their names.
    ///
    /// # Errors
    /// Where its equations cannot be made.
    pub fn with_drives(
        &self,
        acts: &dyn Fn(&str) -> bool,
        slips: &dyn Fn(&str) -> [f64; 2],
    ) -> Result<Self, DescriptionError> {
        self.remade(|spec| {
            spec.drives.retain(|drive| acts(&drive.name));
            for force in &mut spec.forces {
                let resisted = slips(force.name());
                if let Some(signs) = force.record_mut().signs() {
                    *signs = resisted;
                }
            }
        })
    }

    /// The same mechanism in the same coordinates with more drives, those with which set-valued laws act among them.
    ///
    /// # Errors
    /// Where one of them cannot be.
    pub fn with_more_drives(self: &Arc<Self>, more: Vec<Drive>) -> Result<Self, DescriptionError> {
        for drive in &more {
            drivable(drive, &self.own.placed)?;
            self.lies_in_plane(drive)?;
        }
        let mut made = self.remade(|spec| spec.drives.extend(more))?;
        made.permanent = Some(self.clone());
        Ok(made)
    }

    /// The same mechanism with other given efforts, constant over this span of time; friction that may stick gets its
    /// magnitude while it slips. Each does work and has no potential.
    ///
    /// # Errors
    /// Where its equations cannot be made.
    pub fn with_efforts(&self, efforts: &[(Silent, f64)], span: [f64; 2]) -> Result<Self, DescriptionError> {
        let mut made = self.remade(|spec| {
            for &((i, component), effort) in efforts {
                let value = Value::Table(Table { breaks: span.to_vec(), coefficients: vec![[0.0, 0.0, 0.0, effort]] });
                match (spec.forces.get_mut(i), component) {
                    (Some(Force::Torque(x)), _) => x.value = value,
                    (Some(Force::Friction(x)), _) => x.dynamic = value,
                    (Some(Force::Force(PointForce { value: VectorValue::Components(all), .. })), Some(k)) if k < 3 => {
                        all[k] = value;
                    }
                    _ => {}
                }
            }
        })?;
        made.permanent = self.permanent.clone();
        Ok(made)
    }

    /// The same mechanism whose frictions follow the reactions of this one, in which other rows and forces act.
    ///
    /// # Errors
    /// Where its equations cannot be made.
    pub fn with_reactions_of(&self, of: &Arc<Self>) -> Result<Self, DescriptionError> {
        let mut made = self.remade(|_| ())?;
        made.permanent = self.permanent.clone();
        let displacements: Vec<_> = made.structure.rows.iter().map(|row| row.displacement).collect();
        let own = Following::new(&made.own, &made.spec, (&made.structure.pattern, &displacements))?;
        let of = of.clone();
        let normal = move |t: f64, q: &[f64], v: &[f64]| {
            let mut scratch = of.scratch();
            of.own.reaction_friction_at(t, q, v, scratch.equations())?;
            Ok(scratch.equations().full_forces.normal_forces.clone())
        };
        made.own.following = own.map(|own| Arc::new(Elsewhere::new(own, Arc::new(normal))) as Arc<dyn Follow<f64>>);
        Ok(made)
    }

    /// Refuse a drive whose measure the plane of a planar mechanism does not know.
    fn lies_in_plane(&self, drive: &Drive) -> Result<(), DescriptionError> {
        if !self.is_planar() {
            return Ok(());
        }
        let own = &self.own;
        let maker = Maker::<Spatial<f64>>::new(&self.spec, &own.placed, &own.numbers, &own.full)?;
        let out = match maker.reading(&drive.measure, "drive", &drive.name)?.quantity {
            Quantity::Cosine(..) => true,
            // the third axis of a planar mechanism is its normal
            Quantity::Along(_, axis) => axis.0[2].abs() > tolerance::PARALLEL * axis.norm(),
            _ => false,
        };
        if !out {
            return Ok(());
        }
        let message =
            "the mechanism moves in a plane, and this measure has a part out of it; an event cannot hold it: \
            bound the angle of a joint, a distance, or a displacement along an axis in the plane";
        Err(DescriptionError::new("drive", &drive.name, message))
    }

    /// The mechanism without the drives that do not always hold: what is always determined is determined by it.
    pub fn permanent(&self) -> &Self {
        self.permanent.as_deref().unwrap_or(self)
    }

    /// The first force that has more than one value at a state: its name, what it is, and advice.
    pub fn set_valued(&self) -> Option<(&str, &str)> {
        self.spec.forces.iter().find_map(|x| x.record().set_valued().map(|what| (x.name(), what)))
    }

    /// Magnitudes of force number `i` of the description, friction that may stick, while it slips and while it sticks; none
    /// for another force.
    ///
    /// # Errors
    /// Errors of user functions, times outside a table.
    pub fn friction_levels(&self, i: usize, t: f64, (q, v): (&[f64], &[f64])) -> Result<Option<[f64; 2]>, SystemError> {
        let Ok((e, _)) = self.load_number(i) else { return Ok(None) };
        let (part, mut s) = (self.equations().part_of_load(e), self.scratch());
        self.equations().look_at(&part, q, v, s.equations());
        Ok(self.equations().shown(e, t, q, v, s.equations())?.levels)
    }

    /// The row of this model that each row of a model with some of its drives, or without some of its joints, is.
    pub fn rows_of(&self, part: &Self) -> Vec<usize> {
        let own: HashMap<&str, usize> = self.own.drives.iter().map(|d| (&*d.name, d.row)).collect();
        let names: HashMap<usize, &str> = part.own.drives.iter().map(|d| (d.row, &*d.name)).collect();
        // all rows but those of drives keep their order; joints that are apart have none
        let rows = &self.structure.rows;
        let acts = |i: &usize| match self.row_names[*i].owner {
            Owner::Joint(j) => !part.own.placed.joints[j].apart,
            _ => !rows[*i].is_drive,
        };
        let mut others = (0..rows.len()).filter(acts);
        let row = |i: usize| names.get(&i).and_then(|name| own.get(name).copied()).or_else(|| others.next());
        (0..part.structure.rows.len()).filter_map(row).collect()
    }

    /// The natural size of a measure: 1 for angles and cosines, the characteristic length for others.
    pub fn natural_size(&self, measure: &Measure) -> f64 {
        match matches!(measure, Measure::Cosine { .. }) || is_angle(&self.own.placed, measure) {
            true => 1.0,
            false => self.length(),
        }
    }

    /// Rate and acceleration that the drive with this row prescribes at t; `None` for a component of an orientation, whose
    /// displacements are turns, and for a row that is none of a drive.
    ///
    /// # Errors
    /// Functions that fail or return no number, times outside a table.
    pub fn prescribed(&self, row: usize, t: f64) -> Result<Option<[f64; 2]>, SystemError> {
        let Some(drive) = self.own.drives.iter().find(|d| d.row == row) else { return Ok(None) };
        if self.spec.drives[drive.number].turning.is_some() {
            return Ok(None);
        }
        let [x, rate, growth] = value::motion_at(&drive.motion, &self.own.callers, t, &drive.name, &mut Vec::new())?;
        Ok(Some(match drive.level {
            Level::Position => [rate, growth],
            Level::Velocity => [x, rate],
        }))
    }

    /// Its bodies with all joints open.
    pub fn freed(&self) -> Freed {
        Freed::new(&self.spec, &self.own.placed)
    }

    /// Whether the rows of drives are those of actuators, which constrain nothing.
    pub fn is_actuated(&self) -> bool {
        self.mechanism.is_some()
    }

    /// On the tree of this model, whatever tree a description with these drives would have.
    fn remade(&self, change: impl FnOnce(&mut Spec)) -> Result<Self, DescriptionError> {
        let mut spec = (*self.spec).clone();
        change(&mut spec);
        let placed = (*self.own.placed).clone();
        let numbers = Numbers::new(&spec, &placed);
        let rows = drives(&spec, &placed, compile::row_count(&placed))?;
        let mut made = Self::made(spec, placed, numbers, rows, self.functions(), self.coordinates)?;
        made.decide(self.geometry.clone());
        Ok(made.with_recursion(self.preference))
    }
}
