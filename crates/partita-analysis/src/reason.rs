//! Why a row is redundant, in terms of the drawing: what the joints around the loop have in common.

use crate::stress::{Pose, Stress};
use partita_math::spatial::Vec3;
use partita_math::tolerance;
use partita_model::joint::Motion;

/// Names listed before the rest is counted.
const LISTED: usize = 8;

/// Present free motions of some joints, world axes.
struct Motions {
    /// Rotations: a point of the axis, its direction.
    turns: Vec<(Vec3<f64>, Vec3<f64>)>,
    /// Slides.
    slides: Vec<Vec3<f64>>,
    /// Centres of spatial rotations.
    balls: Vec<Vec3<f64>>,
    /// Sine of the angle below which directions count as parallel.
    parallel: f64,
}

impl Motions {
    fn of(pose: &Pose, joints: &[usize], parallel: f64) -> Self {
        let mut all = Self { turns: Vec::new(), slides: Vec::new(), balls: Vec::new(), parallel };
        for &j in joints {
            let p = &pose.model.zero_position().joints[j];
            let axes_on = |node: usize| pose.tree.links[pose.model.zero_position().link_of(node)].rot;
            let (on_parent, on_child) = (axes_on(p.parent).mul(&p.on_parent), axes_on(p.child).mul(&p.on_child));
            let mut first = true;
            for m in &p.shape.motions {
                match m {
                    Motion::Turn(a) => {
                        // the second of two rotations is about an axis of the child
                        let axis = if first { on_parent.apply(*a) } else { on_child.apply(*a) };
                        all.turns.push((pose.points[j], axis));
                        first = false;
                    }
                    Motion::Slide(a) => all.slides.push(on_parent.apply(*a)),
                    Motion::Ball => all.balls.push(pose.points[j]),
                }
            }
        }
        all
    }

    /// The normal of the plane of all rotations and translations.
    fn plane(&self) -> Option<Vec3<f64>> {
        let normal = match self.turns.first() {
            Some(&(_, axis)) => axis,
            None => {
                let first = *self.slides.first()?;
                let across = self.slides.iter().map(|s| first.cross(*s)).find(|n| n.norm() > self.parallel);
                across?.unit()?
            }
        };
        let fits = self.turns.iter().all(|(_, a)| a.cross(normal).norm() < self.parallel)
            && self.slides.iter().all(|s| s.dot(normal).abs() < self.parallel);
        fits.then_some(normal)
    }

    /// Whether all rotations share one axis, parallel to all translations.
    fn one_axis(&self, size: f64) -> bool {
        let Some(&(p, axis)) = self.turns.first() else { return false };
        let on_axis = |x: Vec3<f64>| (x - p).cross(axis).norm() < self.parallel * size;
        self.turns.iter().all(|(x, a)| a.cross(axis).norm() < self.parallel && on_axis(*x))
            && self.slides.iter().all(|s| s.cross(axis).norm() < self.parallel)
            && self.balls.iter().all(|x| on_axis(*x))
    }

    /// The point in which all axes of rotation meet.
    fn centre(&self, size: f64) -> Option<Vec3<f64>> {
        let &(p, a) = self.turns.first()?;
        let &(r, b) = self.turns.iter().find(|(_, b)| a.cross(*b).norm() > tolerance::AXES_CROSS)?;
        // nearest point of the first axis to the second
        let n = a.cross(b);
        let centre = p + a.times((r - p).cross(b).dot(n) / n.dot(n));
        let meets = |x: Vec3<f64>, a: Vec3<f64>| (centre - x).cross(a).norm() < self.parallel * size;
        let all = self.slides.is_empty()
            && self.turns.iter().all(|(x, a)| meets(*x, *a))
            && self.balls.iter().all(|x| (centre - *x).norm() < self.parallel * size);
        all.then_some(centre)
    }
}

/// "A, B and C", a long list cut short.
pub(crate) fn names<S: AsRef<str>>(names: &[S]) -> String {
    let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    match names.split_last() {
        None => "nothing".into(),
        Some((only, [])) => (*only).into(),
        Some(_) if names.len() > LISTED => {
            format!("{} and {} more", names[..LISTED].join(", "), names.len() - LISTED)
        }
        Some((last, rest)) => format!("{} and {last}", rest.join(", ")),
    }
}

/// The sentence for a row whose self-stress this is.
pub(crate) fn reason(pose: &Pose, stress: &Stress) -> String {
    let joints: Vec<usize> = stress.joints.iter().map(|x| x.0).collect();
    let all: Vec<&str> = joints.iter().map(|&j| pose.model.spec.joints[j].name.as_str()).collect();
    if all.is_empty() {
        let who = if stress.drives.is_empty() { "couplings" } else { "drives" };
        return format!(
            "the efforts of {who} can balance one another without loading any joint: with these ratios the row is \
             redundant, with slightly different ones it may lock the mechanism"
        );
    }
    let all = names(&all);
    let size = pose.model.extent();
    let motions = Motions::of(pose, &joints, tolerance::EQUAL);
    let wrenches = || stress.joints.iter().map(|(j, w)| (pose.points[*j], w));
    let small = |force: f64| force <= stress.zero;
    if motions.one_axis(size) {
        return format!("{all} share one axis, so each constrains what the others constrain already");
    }
    let plane = motions.plane();
    let out_of_plane =
        |n: Vec3<f64>| wrenches().all(|(_, w)| small(n.cross(w.force).norm()) && small(n.dot(w.moment).abs() / size));
    if motions.turns.is_empty() && motions.balls.is_empty() && !motions.slides.is_empty() {
        let in_plane = |w: Vec3<f64>| plane.map_or(w, |n| n.cross(w));
        if wrenches().all(|(_, w)| small(in_plane(w.force).norm())) {
            return format!(
                "{all} are prismatic, so the bodies they connect cannot rotate or leave their directions of sliding \
                 even without this row"
            );
        }
    }
    if plane.is_some_and(out_of_plane) {
        return if motions.slides.is_empty() && motions.balls.is_empty() {
            format!(
                "all axes of rotation of {all} are parallel, so the motion stays in its plane even without this \
                row"
            )
        } else {
            format!("all motions of {all} lie in one plane and stay there even without this row")
        };
    }
    let through = |o: Vec3<f64>| wrenches().all(|(p, w)| small(((p - o).cross(w.force) + w.moment).norm() / size));
    if motions.centre(size).is_some_and(through) {
        return format!("all axes of rotation of {all} meet in one point, which stays fixed even without this row");
    }
    format!(
        "the reactions of {all} can balance one another without any load: with these dimensions the row is \
         redundant, with slightly different ones it may lock the mechanism"
    )
}
