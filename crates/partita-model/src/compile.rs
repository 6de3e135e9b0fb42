//! From the zero position to the tree of one space.

use crate::joint::{LockedSlides, Motion};
use crate::numbers::Numbers;
use crate::rows::{Owner, Row};
use crate::spec::Spec;
use crate::tree::{Anchor, Closing, Link, LinkMotion, Locked, PathLink, Tree, Weight};
use crate::zero_position::{Massless, Placed, PlacedJoint};
use partita_math::scalar::Scalar;
use partita_math::sorting::sort_by_key;
use partita_math::spatial::{Mat3, Planar, Space, Vec3, Vectors};

/// Compile for the space G; also the names of the rows.
pub fn compile<G: Space>(spec: &Spec, placed: &Placed, numbers: &Numbers<G::S>) -> (Tree<G>, Vec<Row>) {
    let reference = &numbers.reference;
    let vec = |x: Vec3<f64>| G::vec_from(x.0);
    let mut links = vec![Link {
        parent: 0,
        motion: LinkMotion::Slide(G::Vec::default()),
        q: 0,
        v: 0,
        to_joint: G::Vec::default(),
        to_centre: G::Vec::default(),
        mass: G::S::zero(),
        inertia: G::Inertia::default(),
    }];
    let mut lumped = vec![(G::S::zero(), Mat3::zero()); placed.links.len()];
    for (p, b) in placed.bodies.iter().zip(&numbers.bodies) {
        let (mass, inertia) = &mut lumped[p.link];
        *inertia = inertia.add(&b.inertia).add(&Mat3::steiner(b.mass, b.com - reference[p.link]));
        *mass += b.mass;
    }
    for x in &placed.held {
        let (_, inertia) = &mut lumped[placed.bodies[x.body].link];
        *inertia = inertia.add(&Mat3::from_f64(x.inertia.0));
    }
    for ((i, l), &(mass, inertia)) in placed.links.iter().enumerate().zip(&lumped).skip(1) {
        let point = numbers.links[i];
        links.push(Link {
            parent: l.parent,
            motion: match l.motion {
                Motion::Turn(a) => LinkMotion::Turn(G::ang_from(a.0)),
                Motion::Slide(a) => LinkMotion::Slide(vec(a)),
                Motion::Ball => LinkMotion::Ball,
            },
            q: l.q,
            v: l.v,
            // the origin of a branch is where it is attached to the ground
            to_joint: if l.parent == 0 { G::Vec::default() } else { G::vec_in(point - reference[l.parent]) },
            to_centre: G::vec_in(reference[i] - point),
            mass,
            inertia: G::inertia_in(&inertia),
        });
    }
    let origins = origins(placed, numbers);
    let mut tree = Tree {
        origins: origins.iter().map(|x| G::vec_in(*x)).collect(),
        links,
        massless: placed.massless.iter().map(weighed).collect(),
        rotors: rotors(placed, numbers),
        closings: Vec::new(),
        gravity: G::vec_in(numbers.gravity),
        idle: Vec::new(),
        efforts: Vec::new(),
        nq: placed.nq,
        nv: placed.nv,
        rows: 0,
        entries: 0,
    };
    let mut names = Vec::new();
    for j in placed.closings() {
        let closing = closing::<G>(j, placed, numbers, &origins, &tree);
        for i in 0..closing.rows() {
            let slides = closing.slide_rows();
            let what = match (&closing.slides, i < slides) {
                (Locked::World, true) => ["x", "y", "z"][i].to_string(),
                (_, true) => format!("slide{}", i + 1),
                _ => format!("turn{}", i - slides + 1),
            };
            names.push(Row { owner: Owner::Joint(j), name: format!("{}.{what}", spec.joints[j].name) });
        }
        tree.rows += closing.rows();
        tree.entries += closing.entries();
        tree.closings.push(closing);
    }
    (tree, names)
}

/// Inertia along each velocity, `ratio² inertia` of its rotors; nothing where there are no rotors.
fn rotors<S: Scalar>(placed: &Placed, numbers: &Numbers<S>) -> Vec<Option<S>> {
    let mut along = vec![None; if placed.rotors.is_empty() { 0 } else { placed.nv }];
    for (p, x) in placed.rotors.iter().zip(&numbers.rotors) {
        let ratio = x.number("ratio");
        let moved = ratio * ratio * x.number("inertia");
        along[p.v] = Some(along[p.v].map_or(moved, |before| before + moved));
    }
    along
}

fn weighed<G: Space>(x: &Massless) -> Weight<G> {
    let inertia = G::inertia_in(&Mat3::from_f64(x.inertia.0));
    Weight { link: x.link, mass: G::S::from_f64(x.mass), inertia }
}

/// Origin of the branch of each link.
pub(crate) fn origins<S: Scalar>(placed: &Placed, numbers: &Numbers<S>) -> Vec<Vec3<S>> {
    let mut origins = vec![Vec3::zero(); placed.links.len()];
    for (i, l) in placed.links.iter().enumerate().skip(1) {
        origins[i] = if l.parent == 0 { numbers.links[i] } else { origins[l.parent] };
    }
    origins
}

/// A point as an anchor of its link, and its origin. On the ground the point is the origin itself.
pub(crate) fn anchor<G: Space>(
    link: usize,
    at: Vec3<G::S>,
    reference: &[Vec3<G::S>],
    origins: &[Vec3<G::S>],
) -> (Anchor<G>, Vec3<G::S>) {
    if link == 0 {
        return (Anchor { link, at: G::Vec::default() }, at);
    }
    (Anchor { link, at: G::vec_in(at - reference[link]) }, origins[link])
}

fn closing<G: Space>(
    j: usize,
    placed: &Placed,
    numbers: &Numbers<G::S>,
    origins: &[Vec3<G::S>],
    tree: &Tree<G>,
) -> Closing<G> {
    let p = &placed.joints[j];
    let (la, lb) = (placed.link_of(p.parent), placed.link_of(p.child));
    let (slides, locks) = if G::LENGTHS == 2 { planar_locks::<G>(p) } else { spatial_locks::<G>(p) };
    // parents come before their children: the later one of the two is never an ancestor of the other
    let mut path: Vec<(usize, bool)> = Vec::new();
    let (mut on_a, mut on_b) = (la, lb);
    while on_a != on_b {
        let is_b = on_b > on_a;
        let end = if is_b { &mut on_b } else { &mut on_a };
        path.push((*end, is_b));
        *end = tree.links[*end].parent;
    }
    sort_by_key(&mut path, |x| tree.links[x.0].v);
    let (mut slide_columns, mut turn_columns) = (0, 0);
    let path = path
        .into_iter()
        .map(|(link, on_b)| {
            let here = PathLink { link, on_b, slide_column: slide_columns, turn_column: turn_columns };
            let (turns, slides) = match tree.links[link].motion {
                LinkMotion::Turn(_) => (1, 1),
                LinkMotion::Slide(_) => (0, 1),
                LinkMotion::Ball => (3, 3),
            };
            slide_columns += slides;
            turn_columns += turns;
            here
        })
        .collect();
    let (parent_point, child_point) = numbers.joints[j];
    let (a, origin_a) = anchor(la, parent_point, &numbers.reference, origins);
    let (b, origin_b) = anchor(lb, child_point, &numbers.reference, origins);
    Closing {
        joint: j,
        a,
        b,
        offset: G::vec_in(origin_b - origin_a),
        slides,
        locks,
        row: tree.rows,
        entry: tree.entries,
        path,
        slide_columns,
        turn_columns,
    }
}

fn spatial_locks<G: Space>(p: &PlacedJoint) -> (Locked<G>, Vec<G::Lock>) {
    let slides = match &p.shape.slides {
        LockedSlides::All => Locked::World,
        LockedSlides::Along(axes) => Locked::Along(axes.iter().map(|a| G::vec_from(p.on_parent.apply(*a).0)).collect()),
    };
    let locks = p
        .shape
        .locks
        .iter()
        .map(|(u, w)| G::lock_from(p.on_parent.apply(*u).0, p.on_child.apply(*w).0, u.dot(*w)))
        .collect();
    (slides, locks)
}

/// The locks of a joint that remain in the plane of the mechanism.
fn planar_locks<G: Space>(p: &PlacedJoint) -> (Locked<G>, Vec<G::Lock>) {
    let mut free: Vec<Vec3<f64>> = Vec::new();
    let mut turns = false;
    for m in &p.shape.motions {
        match m {
            Motion::Slide(a) => free.push(p.on_parent.apply(*a)),
            Motion::Turn(_) | Motion::Ball => turns = true,
        }
    }
    let slides = match free.as_slice() {
        [] => Locked::World,
        [a] => Locked::Along(vec![G::vec_from([-a.0[1], a.0[0], 0.0])]),
        _ => Locked::Along(vec![]),
    };
    let locks = if turns {
        vec![]
    } else {
        // an axis of the plane, as the parent and as the child carry it
        let e = p.on_parent.apply_transposed(Vec3([1.0, 0.0, 0.0]));
        let (u, w) = (p.on_parent.apply(e), p.on_child.apply(e));
        vec![G::lock_from(u.0, [-w.0[1], w.0[0], 0.0], 0.0)]
    };
    (slides, locks)
}

/// Columns of every row of the closings, in the order of the values.
pub fn columns<G: Space>(tree: &Tree<G>) -> Vec<Vec<usize>> {
    let mut rows = Vec::with_capacity(tree.rows);
    for k in &tree.closings {
        let mut slides = Vec::new();
        let mut turns = Vec::new();
        for p in &k.path {
            let link = &tree.links[p.link];
            match link.motion {
                LinkMotion::Turn(_) => {
                    slides.push(link.v);
                    turns.push(link.v);
                }
                LinkMotion::Slide(_) => slides.push(link.v),
                LinkMotion::Ball => {
                    slides.extend(link.v..link.v + 3);
                    turns.extend(link.v..link.v + 3);
                }
            }
        }
        rows.extend((0..k.slide_rows()).map(|_| slides.clone()));
        rows.extend((0..k.locks.len()).map(|_| turns.clone()));
    }
    rows
}

/// Closing rows of the mechanism in the space it is computed in.
pub(crate) fn row_count(placed: &Placed) -> usize {
    let count = |p: &PlacedJoint| {
        if placed.planar {
            let (slides, locks) = planar_locks::<Planar<f64>>(p);
            locks.len() + if let Locked::Along(axes) = slides { axes.len() } else { Planar::<f64>::LENGTHS }
        } else {
            p.shape.rows()
        }
    };
    placed.closings().map(|j| count(&placed.joints[j])).sum()
}
