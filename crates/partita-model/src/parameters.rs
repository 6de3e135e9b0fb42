//! Parameters: the numbers of a description that may change while its structure stays.
//!
//! ```text
//! gravity                                    3
//! BODY.mass  .com  .inertia                  1, 3, 9 (row by row, about the centre of mass, body axes)
//! JOINT.point  .child_point                  3, world of the drawing
//! SPRING.stiffness  .damping  .length        1
//! SPRING.point1  .point2  FORCE.point        3, body axes
//! TORSION.stiffness  .damping  .angle        1
//! TORQUE.value  FORCE.value                  1, 3: constants only
//! BUSHING.stiffness  .damping                36, row by row; other forces: their numbers by the names of their fields
//! SCREW.pitch                                1
//! GEAR.ratio  RACK.radius  BELT.radius1  .radius2  1
//! DISTANCE.length  .point1  .point2          1, 3, body axes
//! COUPLER.factors  .offset                   one for each term, 1
//! ROLLING.radius  .center  .point            1, 3, body axes
//! ROTOR.inertia  .ratio                      1
//! DRIVE.position  .velocity                  1: constants only
//! ```

use crate::coincident;
use crate::coupling::{self, ConditionRows};
use crate::error::DescriptionError;
use crate::evaluator::Evaluator;
use crate::joint;
use crate::lengths::{body_length, typical_length};
use crate::massless;
use crate::model::Model;
use crate::numbers::{Described, Numbers};
use crate::rows::Owner;
use crate::spec::{Coupling, JointKind, Spec};
use crate::validate;
use crate::zero_position::Placed;
use partita_math::scalar::Scalar;
use partita_math::spatial::Vec3;
use partita_math::tolerance;
use partita_system::prelude::*;
use std::collections::HashSet;

/// Where a parameter is stored in [`Described`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Slot {
    Gravity,
    Mass(usize),
    Com(usize),
    Inertia(usize),
    Point(usize),
    ChildPoint(usize),
    /// A field of a force.
    OfLoad(usize, usize),
    Pitch(usize),
    /// A field of a coupling.
    OfCoupling(usize, usize),
    /// A field of a rotor.
    OfRotor(usize, usize),
    /// A field of a drive.
    OfDrive(usize, usize),
}

impl Slot {
    /// Its numbers, side by side.
    fn of<S: Scalar>(self, d: &mut Described<S>) -> &mut [S] {
        match self {
            Self::Gravity => &mut d.gravity.0,
            Self::Mass(i) => std::slice::from_mut(&mut d.bodies[i].mass),
            Self::Com(i) => &mut d.bodies[i].com.0,
            Self::Inertia(i) => d.bodies[i].inertia.0.as_flattened_mut(),
            Self::Point(i) => &mut d.joints[i].0 .0,
            Self::ChildPoint(i) => d.joints[i].1.as_mut().map_or(&mut [], |x| &mut x.0),
            Self::OfLoad(i, k) => &mut d.forces[i].0[k].1,
            Self::Pitch(i) => std::slice::from_mut(&mut d.pitches[i]),
            Self::OfCoupling(i, k) => &mut d.couplings[i].0[k].1,
            Self::OfRotor(i, k) => &mut d.rotors[i].0[k].1,
            Self::OfDrive(i, k) => &mut d.drives[i].0[k].1,
        }
    }

    /// All parameters of a description, by name.
    fn all(spec: &Spec) -> Vec<(String, Self)> {
        let mut all = vec![("gravity".to_string(), Self::Gravity)];
        for (i, b) in spec.bodies.iter().enumerate() {
            for (field, slot) in [("mass", Self::Mass(i)), ("com", Self::Com(i)), ("inertia", Self::Inertia(i))] {
                all.push((format!("{}.{field}", b.name), slot));
            }
        }
        for (i, j) in spec.joints.iter().enumerate() {
            all.push((format!("{}.point", j.name), Self::Point(i)));
            if j.child_point.is_some() {
                all.push((format!("{}.child_point", j.name), Self::ChildPoint(i)));
            }
            if j.kind == JointKind::Screw {
                all.push((format!("{}.pitch", j.name), Self::Pitch(i)));
            }
        }
        for (i, c) in spec.couplings.iter().enumerate() {
            let fields = c.clone().numbers().into_iter().map(|(field, _)| field).collect::<Vec<_>>();
            let named = |(k, field)| (format!("{}.{field}", c.name()), Self::OfCoupling(i, k));
            all.extend(fields.into_iter().enumerate().map(named));
        }
        for (i, r) in spec.rotors.iter().enumerate() {
            let fields = r.clone().numbers().into_iter().map(|(field, _)| field).collect::<Vec<_>>();
            let named = |(k, field)| (format!("{}.{field}", r.name), Self::OfRotor(i, k));
            all.extend(fields.into_iter().enumerate().map(named));
        }
        for (i, d) in spec.drives.iter().enumerate() {
            let fields = d.clone().numbers().into_iter().map(|(field, _)| field).collect::<Vec<_>>();
            let named = |(k, field)| (format!("{}.{field}", d.name), Self::OfDrive(i, k));
            all.extend(fields.into_iter().enumerate().map(named));
        }
        for (i, f) in spec.forces.iter().enumerate() {
            let fields = f.clone().record_mut().numbers().into_iter().map(|(field, _)| field).collect::<Vec<_>>();
            let named = |(k, field)| (format!("{}.{field}", f.name()), Self::OfLoad(i, k));
            all.extend(fields.into_iter().enumerate().map(named));
        }
        all
    }
}

/// A description with some parameters changed; also the slots that were.
fn changed<S: Scalar>(spec: &Spec, changes: &[(&str, &[S])]) -> Result<(Described<S>, Vec<Slot>), DescriptionError> {
    let known = Slot::all(spec);
    let mut described = Described::new(spec);
    let mut slots = Vec::with_capacity(changes.len());
    for &(name, values) in changes {
        let fail = |m: String| DescriptionError::new("parameter", name, m);
        let mut found = known.iter().filter(|k| k.0 == name);
        // where a joint is on its child, as parameters of lengths move it
        let of_child = || {
            let joint = name.strip_suffix(".child_point")?;
            let i = spec.joints.iter().position(|j| j.name == joint)?;
            described.joints[i].1.get_or_insert_with(|| Vec3::from_f64(spec.joints[i].point));
            Some((String::new(), Slot::ChildPoint(i)))
        };
        let own = found.next().cloned();
        let Some((_, slot)) = own.or_else(of_child) else {
            let field = name.rsplit('.').next().unwrap_or(name);
            let mut near: Vec<&str> = known.iter().map(|k| k.0.as_str()).filter(|k| k.ends_with(field)).collect();
            if near.is_empty() {
                near = known.iter().map(|k| k.0.as_str()).collect();
            }
            let more = if near.len() > 8 { ", ..." } else { "" };
            near.truncate(8);
            return Err(fail(format!("there is no such parameter; there are {}{more}", near.join(", "))));
        };
        if found.next().is_some() {
            return Err(fail("two elements have this parameter; give them different names".into()));
        }
        if slots.contains(&slot) {
            return Err(fail("it is given twice".into()));
        }
        let own = slot.of(&mut described);
        if own.len() != values.len() {
            return Err(fail(format!("it has {} numbers, {} were given", own.len(), values.len())));
        }
        own.copy_from_slice(values);
        slots.push(slot);
    }
    Ok((described, slots))
}

/// The description with these numbers.
fn rewritten(spec: &Spec, d: &Described<f64>) -> Spec {
    let mut spec = spec.clone();
    spec.gravity = d.gravity.0;
    for (b, n) in spec.bodies.iter_mut().zip(&d.bodies) {
        (b.mass, b.com, b.inertia) = (n.mass, n.com.0, n.inertia.0);
    }
    for (j, (point, child)) in spec.joints.iter_mut().zip(&d.joints) {
        (j.point, j.child_point) = (point.0, child.map(|x| x.0));
    }
    for (j, &pitch) in spec.joints.iter_mut().zip(&d.pitches).filter(|(j, _)| j.kind == JointKind::Screw) {
        j.pitch = Some(pitch);
    }
    for (c, n) in spec.couplings.iter_mut().zip(&d.couplings) {
        c.numbers().into_iter().zip(&n.0).for_each(|((_, x), (_, new))| x.copy_from_slice(new));
        let made = n.sum(c);
        if let Coupling::Linear { factors, offset, .. } = c {
            (*factors, *offset) = made;
        }
    }
    for (r, n) in spec.rotors.iter_mut().zip(&d.rotors) {
        r.numbers().into_iter().zip(&n.0).for_each(|((_, x), (_, new))| x.copy_from_slice(new));
    }
    for (drive, n) in spec.drives.iter_mut().zip(&d.drives) {
        drive.numbers().into_iter().zip(&n.0).for_each(|((_, x), (_, new))| x.copy_from_slice(new));
    }
    for (f, n) in spec.forces.iter_mut().zip(&d.forces) {
        for ((_, own), (_, new)) in f.record_mut().numbers().into_iter().zip(&n.0) {
            own.into_iter().zip(new).for_each(|(x, new)| *x = *new);
        }
    }
    spec
}

/// The zero position with these numbers.
fn moved(placed: &Placed, spec: &Spec, n: &Numbers<f64>) -> Placed {
    let mut placed = placed.clone();
    for (b, n) in placed.bodies.iter_mut().zip(&n.bodies) {
        (b.mass, b.origin, b.com, b.inertia) = (n.mass, n.origin, n.com, n.inertia);
    }
    for (j, n) in placed.joints.iter_mut().zip(&n.joints) {
        (j.parent_point, j.child_point) = *n;
    }
    for (l, n) in placed.links.iter_mut().zip(&n.links) {
        l.point = *n;
    }
    placed.size = typical_length(spec);
    placed.length = body_length(spec).unwrap_or(placed.size);
    massless::weigh(&mut placed, spec);
    placed
}

/// Refuse numbers by which a coupling would constrain rates instead of positions, or positions instead of rates.
fn same_rows(before: &[ConditionRows], spec: &Spec, placed: &Placed) -> Result<(), DescriptionError> {
    let held = |x: &ConditionRows| (x.owner, x.rows, x.holonomic);
    let before: HashSet<_> = before.iter().map(held).collect();
    let after = coupling::order(spec, placed)?;
    match after.iter().find(|x| !before.contains(&held(x))).map(|x| x.owner) {
        Some(Owner::Coupling(i)) => {
            let message =
                "the whole turns of its joints are not known, and these factors have another common divisor than \
                 the compiled ones, so it would constrain rates instead of positions or the reverse; build the \
                 mechanism with these numbers";
            Err(DescriptionError::new("coupling", spec.couplings[i].name(), message))
        }
        _ => Ok(()),
    }
}

impl Model {
    /// All parameters with their present numbers: see [`parameters`](crate::parameters).
    pub fn parameters(&self) -> Vec<(String, Vec<f64>)> {
        let mut described = Described::new(&self.spec);
        let all = Slot::all(&self.spec).into_iter().map(|(name, slot)| (name, slot.of(&mut described).to_vec()));
        // a repair is repeated from the drawing, which has no frames of its own where the repair made two of one
        match &self.geometry().drawn {
            None => all.collect(),
            Some(drawn) => {
                let known: HashSet<String> = Slot::all(drawn).into_iter().map(|(name, _)| name).collect();
                all.filter(|(name, _)| known.contains(name)).collect()
            }
        }
    }

    /// Whether this number determines the period by which a coupling of several joints counts whole turns.
    fn counts_turns(&self, slot: Slot) -> bool {
        let Slot::OfCoupling(i, _) = slot else { return false };
        self.spec.couplings[i].terms().iter().filter(|m| coupling::wraps(&self.own.placed, m)).count() > 1
    }

    /// Whether [`over_with`](Self::over_with) can take this parameter, if there is one of the name.
    pub(crate) fn is_smooth(&self, name: &str) -> bool {
        !Slot::all(&self.spec).iter().any(|(known, slot)| known == name && self.counts_turns(*slot))
    }

    /// The same mechanism with other parameters, `(name, numbers)`: its tree, rows and coordinates are unchanged. The
    /// bodies keep their drawn poses, a joint's point moves on both of them; masses and inertias are changed
    /// independently.
    ///
    /// Fails for unknown names, wrong counts, numbers that no body can have, and where the structure would change: a
    /// planar mechanism whose joints no longer meet in the plane, a gear whose whole turns are no longer known. Cost:
    /// that of making the trees, without finding them.
    pub fn with_parameters(&self, changes: &[(&str, &[f64])]) -> Result<Self, DescriptionError> {
        if let Some(drawn) = &self.geometry().drawn {
            // a repair is repeated
            let mut spec = rewritten(drawn, &changed(drawn, changes)?.0);
            spec.parting = self.spec.parting.clone();
            let made = Self::new(spec, self.own.callers.functions.clone(), self.coordinates())?;
            return self.of_one_structure(made);
        }
        let (mut described, slots) = changed(&self.spec, changes)?;
        let mut spec = rewritten(&self.spec, &described);
        validate::validate(&spec, self.own.callers.functions.count())?;
        coincident::unite(&mut spec);
        described.joints = Described::new(&spec).joints;
        let mut numbers = Numbers::from_parameters(&spec, &self.own.placed, &described);
        let mut placed = moved(&self.own.placed, &spec, &numbers);
        for (p, j) in placed.joints.iter_mut().zip(&spec.joints).filter(|(_, j)| j.kind == JointKind::Screw) {
            p.shape.own = joint::shape(j, &p.shape.frame)?.own;
        }
        same_rows(&coupling::order(&self.spec, &self.own.placed)?, &spec, &placed)?;
        // the set of massive links may have changed
        numbers = numbers.referred(&placed);
        if placed.planar {
            for &j in &placed.topology.cuts {
                let p = &placed.joints[j];
                let off = (p.child_point - p.parent_point).0[2];
                // as when the plane was found
                if off.abs() >= tolerance::EQUAL * placed.size {
                    let m = format!(
                        "its sides would be {} m apart across the plane; compile a new model",
                        partita_math::formatted(off)
                    );
                    return Err(DescriptionError::new("joint", &spec.joints[j].name, m));
                }
            }
        }
        let is_geometry =
            |x: &Slot| matches!(x, Slot::Point(_) | Slot::ChildPoint(_) | Slot::Pitch(_) | Slot::OfCoupling(..));
        self.of_one_structure(self.renewed(spec, placed, numbers, slots.iter().any(is_geometry))?)
    }

    /// Another model of this mechanism, if it has the same coordinates and rows.
    fn of_one_structure(&self, made: Self) -> Result<Self, DescriptionError> {
        if made.size() == self.size() && made.is_planar() == self.is_planar() {
            return Ok(made);
        }
        let m = "with these numbers its geometry is repaired differently and has other coordinates; compile a new \
            model";
        Err(DescriptionError::new("mechanism", &self.spec.name, m))
    }

    /// The same mechanism over other numbers, with parameters that are such numbers: results carry derivatives with
    /// respect to masses, lengths, stiffnesses, ...
    ///
    /// Fails as [`with_parameters`](Self::with_parameters) and [`over`](Self::over) do, and for masses and inertias of
    /// massless links, on which no dynamics depends; and for factors of couplings between several joints whose whole
    /// turns are not known.
    pub fn over_with<S: Scalar>(&self, changes: &[(&str, &[S])]) -> Result<Evaluator<S>, DescriptionError> {
        self.refuse_following()?;
        let (described, slots) = changed(&self.spec, changes)?;
        for (slot, (name, _)) in slots.iter().zip(changes) {
            if self.counts_turns(*slot) {
                let m = "the whole turns of its joints follow from the common divisor of its factors, which is not \
                     continuous; set these numbers by with_parameters";
                return Err(DescriptionError::new("parameter", name, m));
            }
            let (Slot::Mass(i) | Slot::Com(i) | Slot::Inertia(i)) = *slot else { continue };
            let link = self.own.placed.bodies[i].link;
            let mass: f64 = self.own.placed.bodies.iter().filter(|b| b.link == link).map(|b| b.mass).sum();
            if link != 0 && mass == 0.0 {
                let m = "the body moves without mass in this model; give it one when compiling";
                return Err(DescriptionError::new("parameter", name, m));
            }
        }
        let numbers = Numbers::from_parameters(&self.spec, &self.own.placed, &described);
        let (drives, callers) = (self.own.drives.clone(), self.own.callers.clone());
        Ok(Evaluator::new(&self.spec, self.own.placed.clone(), numbers, drives, callers)?.0)
    }
}
