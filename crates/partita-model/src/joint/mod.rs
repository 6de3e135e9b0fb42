//! Joints, one file each, all defined by the same three things: which motions are free, in which order, and what is
//! locked.
//!
//! A joint in the tree becomes its motions, a joint that closes a loop becomes its locks.

mod constant_velocity;
mod coordinates;
mod custom;
mod cylindrical;
mod fixed;
mod free;
mod generic;
mod pin_slot;
mod planar;
mod primitive;
mod prismatic;
mod revolute;
mod screw;
mod spherical;
mod universal;

pub use coordinates::{position_of, rate_of};

use crate::error::DescriptionError;
use crate::spec::{Joint, JointKind, Spec};
use partita_math::spatial::{Mat3, Vec3};
use partita_math::tolerance;
use std::collections::HashMap;

/// One free motion, its axis in the drawing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// Rotation about an axis through the joint's point.
    Turn(Vec3<f64>),
    /// Translation along an axis.
    Slide(Vec3<f64>),
    /// Spatial rotation about the joint's point (a quaternion; three velocities in child axes).
    Ball,
}

impl Motion {
    /// Number of its velocities.
    pub fn velocities(&self) -> usize {
        if matches!(self, Self::Ball) {
            3
        } else {
            1
        }
    }
    /// Number of its coordinates.
    pub fn coordinates(&self) -> usize {
        if matches!(self, Self::Ball) {
            4
        } else {
            1
        }
    }
}

/// Which relative displacements of the joint's points are locked.
#[derive(Clone, Debug, PartialEq)]
pub enum LockedSlides {
    /// All three: written in world axes, so that the multipliers are the force on the child.
    All,
    /// Along these axes, fixed on the parent.
    Along(Vec<Vec3<f64>>),
}

/// Conditions of a joint besides its locks.
#[derive(Clone, Debug, PartialEq)]
pub enum Own {
    /// The first coordinate (a translation) is a multiple of the second (a rotation).
    Advance(f64),
    /// The child is not twisted about z of the joint's axes.
    Twist,
    /// Motions that are functions of others.
    Followers(Vec<Follows>),
}

/// A motion that is a function of others: a relation between their coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Follows {
    /// The motion, then those it depends on.
    pub motions: Vec<usize>,
    /// Number of the relation.
    pub function: usize,
}

impl Own {
    /// Number of conditions.
    pub fn count(&self) -> usize {
        match self {
            Self::Advance(_) | Self::Twist => 1,
            Self::Followers(all) => all.len(),
        }
    }
}

/// A joint, ready for either use. Axes in the drawing.
#[derive(Clone, Debug)]
pub struct Shape {
    /// Free motions in order from parent to child.
    pub motions: Vec<Motion>,
    /// Their names.
    pub names: Vec<&'static str>,
    /// Locked displacements.
    pub slides: LockedSlides,
    /// Locked rotations: `u · w` keeps its drawn value, u on the parent, w on the child.
    pub locks: Vec<(Vec3<f64>, Vec3<f64>)>,
    /// Joint axes, columns.
    pub frame: Mat3<f64>,
    /// Conditions of its own.
    pub own: Option<Own>,
}

impl Shape {
    /// Whether it must close a loop, because its motions are not those of links in a tree.
    pub fn is_always_cut(&self) -> bool {
        self.own == Some(Own::Twist)
    }
    /// Conditions it puts on its two bodies, in space.
    pub fn conditions(&self) -> usize {
        self.rows() + self.own.as_ref().map_or(0, Own::count)
    }
    /// Number of rows when it closes a loop, except for a condition of its own.
    pub fn rows(&self) -> usize {
        self.locks.len()
            + match &self.slides {
                LockedSlides::All => 3,
                LockedSlides::Along(axes) => axes.len(),
            }
    }
    /// Velocities it allows.
    pub fn dof(&self) -> usize {
        self.motions.iter().map(Motion::velocities).sum()
    }
    /// Degrees of freedom that its conditions leave its two bodies, in space: those of its motions, less what conditions
    /// of its own take; a joint that is always cut has no motions of its own.
    pub fn mobility(&self) -> usize {
        6_usize.saturating_sub(self.conditions())
    }
    /// The motion that velocity `i` belongs to.
    pub fn motion_of(&self, i: usize) -> Option<Motion> {
        self.motions.iter().flat_map(|m| std::iter::repeat_n(*m, m.velocities())).nth(i)
    }
    /// Whether velocity `i` is a rotation.
    pub fn turns(&self, i: usize) -> bool {
        let each = self.motions.iter().flat_map(|m| std::iter::repeat_n(m, m.velocities()));
        each.map(|m| !matches!(m, Motion::Slide(_))).nth(i).unwrap_or(false)
    }
}

/// The axis of a joint as a unit vector, or an error that names the joint.
fn axis_of(joint: &Joint, axis: Option<[f64; 3]>, which: &str) -> Result<Vec3<f64>, DescriptionError> {
    let given = axis.ok_or_else(|| {
        DescriptionError::new("joint", &joint.name, format!("a {} joint needs {which}", joint.kind.words()))
    })?;
    Vec3(given).unit().ok_or_else(|| {
        let message = format!("{which} = {given:?} has no direction; give a vector of finite length");
        DescriptionError::new("joint", &joint.name, message)
    })
}

/// A direction this nearly along an axis (of a joint, of a rod) does not define the direction across it. Scale: cosine.
/// Reason: 26 degrees; two other body axes are then well across.
const NEARLY_ALONG: f64 = 0.9;

/// Frame whose z is the given axis: x is the x axis of the carrier, projected across z, or its y axis where x is nearly
/// along z. Nothing but the drawing itself defines the frame, so the frame turns with it. Reactions and free motions are
/// given along it; conditions span the same space along any directions across z.
fn frame_about(z: Vec3<f64>, carrier: &Mat3<f64>) -> Mat3<f64> {
    let [x, y] = [0, 1].map(|i| carrier.column(i));
    let seed = if x.dot(z).abs() < NEARLY_ALONG { x } else { y };
    let across = seed - z.times(seed.dot(z));
    let across = across.times(1.0 / across.norm());
    Mat3::from_columns(across, z.cross(across), z)
}

/// Axes, in the drawing, of the body that lays the axes of a joint about its own: the parent, or the child where the
/// parent is the ground, which does not turn with a drawing.
fn carrier(joint: &Joint, orientation: &HashMap<&str, Mat3<f64>>) -> Result<Mat3<f64>, DescriptionError> {
    if let Some(parent) = orientation.get(joint.parent.as_str()) {
        return Ok(*parent);
    }
    let child = orientation.get(joint.child.as_str()).copied().unwrap_or_else(Mat3::identity);
    Ok(alignment(joint)?.mul(&child))
}

/// Rotation of the child's joint axis in the drawing from the parent's.
pub(crate) fn alignment(joint: &Joint) -> Result<Mat3<f64>, DescriptionError> {
    if let Some(child) = joint.child_frame {
        let frame = joint.frame.map_or_else(Mat3::identity, Mat3);
        return Ok(frame.mul(&Mat3(child).transpose()));
    }
    match (joint.axis, joint.child_axis) {
        (Some(axis), Some(child)) => match (Vec3(child).unit(), Vec3(axis).unit()) {
            (Some(c), Some(a)) => Ok(Mat3::between(c, a)),
            _ => Err(DescriptionError::new("joint", &joint.name, "child_axis has no direction")),
        },
        _ => Ok(Mat3::identity()),
    }
}

/// Refuses two axes that are not drawn at a right angle.
fn at_right_angle(joint: &Joint, first: Vec3<f64>, second: Vec3<f64>) -> Result<(), DescriptionError> {
    let cosine = first.dot(second);
    if cosine.abs() > tolerance::EQUAL_IN_SIX_DIGITS {
        let angle = cosine.acos().to_degrees();
        let message = format!("its axes are at {angle:.4} deg; they must be at a right angle");
        return Err(DescriptionError::new("joint", &joint.name, message));
    }
    Ok(())
}

/// The shapes of all joints.
pub fn shapes(spec: &Spec) -> Result<Vec<Shape>, DescriptionError> {
    let orientation = spec.bodies.iter().map(|b| (b.name.as_str(), Mat3(b.orientation))).collect();
    spec.joints.iter().map(|joint| shape(joint, &carrier(joint, &orientation)?)).collect()
}

/// The shape of a described joint, its axes laid by those of a body as drawn.
pub fn shape(joint: &Joint, carrier: &Mat3<f64>) -> Result<Shape, DescriptionError> {
    match joint.kind {
        JointKind::Revolute => revolute::shape(joint, carrier),
        JointKind::Prismatic => prismatic::shape(joint, carrier),
        JointKind::Cylindrical => cylindrical::shape(joint, carrier),
        JointKind::Universal => universal::shape(joint),
        JointKind::Spherical => Ok(spherical::shape(carrier)),
        JointKind::Planar => planar::shape(joint, carrier),
        JointKind::Fixed => Ok(fixed::shape(carrier)),
        JointKind::Free => Ok(free::shape()),
        JointKind::Generic => generic::shape(joint),
        JointKind::Screw => screw::shape(joint, carrier),
        JointKind::ConstantVelocity => constant_velocity::shape(joint, carrier),
        JointKind::PointOnLine => primitive::point_on_line(joint, carrier),
        JointKind::PointOnPlane => primitive::point_on_plane(joint, carrier),
        JointKind::Parallel => primitive::parallel(joint, carrier),
        JointKind::Perpendicular => primitive::perpendicular(joint, carrier),
        JointKind::Orientation => primitive::orientation(joint),
        JointKind::PinSlot => pin_slot::shape(joint),
        JointKind::Custom => custom::shape(joint),
    }
}

/// The three locks that keep a frame parallel to another (valid while they are less than a right angle apart).
fn parallel(f: &Mat3<f64>) -> Vec<(Vec3<f64>, Vec3<f64>)> {
    let (x, y, z) = (f.column(0), f.column(1), f.column(2));
    vec![(x, y), (y, z), (z, x)]
}
