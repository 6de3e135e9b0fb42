//! The part of a mechanism on which one output depends: of a body, a joint, a reaction.
//!
//! The pose of a body depends on the links between it and the ground. The reaction of a tree joint depends besides on
//! the bodies outboard of it and their loads; that of a cut joint only on its multipliers and its two sides.     (R3)

use crate::coupling::{Law, Says};
use crate::evaluator::{Engine, Evaluator, Scratch};
use crate::force::{CutSight, LawInput};
use crate::rows::Owner;
use partita_math::scalar::Scalar;
use std::collections::BTreeSet;

/// Links, bodies and their loads, for one output or for all.
#[derive(Clone, Debug, Default)]
pub struct Part {
    /// Links whose poses and twists are needed, parents first.
    pub(crate) links: Vec<usize>,
    /// Nodes whose balance of forces is needed, in the order of the tree.
    pub(crate) nodes: Vec<usize>,
    /// Indices in the carrying tree of the edges to these nodes, in the order of the tree.
    pub(crate) edges: Vec<usize>,
    /// Applied forces on these nodes.
    pub(crate) elements: Vec<usize>,
    /// Loop closures on these nodes, and those requested themselves.
    pub(crate) closings: Vec<usize>,
    /// Conditions on these nodes, and those that belong to the request.
    pub(crate) conditions: Vec<usize>,
}

impl Part {
    fn new<S: Scalar>(
        model: &Evaluator<S>,
        nodes: &BTreeSet<usize>,
        asked: impl Fn(usize) -> bool,
        ends: &[usize],
    ) -> Self {
        let (tree, full) = (&model.placed.carrying, &model.full);
        let edges: Vec<usize> = (0..tree.len()).filter(|&e| nodes.contains(&tree[e].to)).collect();
        let on = |sides: &[usize]| sides.iter().any(|n| nodes.contains(n));
        let sides = |k: usize| {
            let p = &model.placed.joints[full.closings[k].joint];
            [p.parent, p.child]
        };
        // a load along a tree joint acts on no body by itself
        let elements: Vec<usize> = (0..full.elements.len()).filter(|&i| on(&full.elements[i].nodes())).collect();
        let closings: Vec<usize> =
            (0..full.closings.len()).filter(|&k| on(&sides(k)) || asked(full.closings[k].joint)).collect();
        let mut links: BTreeSet<usize> = ends.iter().copied().collect();
        links.extend(nodes.iter().map(|&n| model.placed.link_of(n)));
        links.extend(elements.iter().flat_map(|&i| full.elements[i].touches().1));
        links.extend(elements.iter().flat_map(|&i| full.elements[i].looks_at()));
        if elements.iter().any(|&i| full.elements[i].sees_state(&*model.callers.functions)) {
            links.extend(seen(model));
        }
        for &k in &closings {
            links.extend(sides(k).map(|n| model.placed.link_of(n)));
            links.extend([full.closings[k].a.link, full.closings[k].b.link]);
        }
        let owned = |owner: Owner| match owner {
            Owner::Joint(j) => asked(j),
            Owner::Drive(i) => model.drives.iter().any(|d| d.number == i && d.joint.is_some_and(|(j, _)| asked(j))),
            Owner::Coupling(_) | Owner::Rotor(_) => false,
        };
        let all = &full.conditions;
        let conditions: Vec<usize> =
            (0..all.len()).filter(|&k| owned(all[k].owner) || all[k].nodes().any(|sides| on(&sides))).collect();
        links.extend(conditions.iter().flat_map(|&k| all[k].links()));
        let nodes = edges.iter().map(|&e| tree[e].to).collect();
        Self { links: with_ancestors(model, links), nodes, edges, elements, closings, conditions }
    }
}

/// The links and all between them and the ground, parents first, without the ground.
fn with_ancestors<S: Scalar>(model: &Evaluator<S>, links: BTreeSet<usize>) -> Vec<usize> {
    let mut all = BTreeSet::new();
    for mut i in links {
        while i != 0 && all.insert(i) {
            i = model.full.links[i].parent;
        }
    }
    all.into_iter().collect() // a parent's number is smaller than its children's
}

/// Links that functions of the state read.
fn seen<S: Scalar>(model: &Evaluator<S>) -> impl Iterator<Item = usize> + '_ {
    let coordinates = model.full.sights.iter().flat_map(CutSight::links);
    coordinates.chain(model.full.sensed.iter().flat_map(LawInput::links))
}

impl<S: Scalar> Evaluator<S> {
    /// Whether forces or motions contain user functions.
    pub fn calls_functions(&self) -> bool {
        self.callers.functions.count() > 0
    }

    /// Whether something is given over a range of a reading alone: a table, or an angle whose turns are not counted.
    /// Members side by side are not compared with its ends.
    pub fn has_ranges(&self) -> bool {
        let curves = self.full.conditions.iter().any(|c| matches!(c.says, Says::Law(Law::Curve { .. }, _)));
        curves || self.full.elements.iter().any(|e| e.has_range())
    }

    /// Dependences of all outputs together: everything.
    pub fn whole(&self) -> Part {
        let nodes = self.placed.carrying.iter().map(|e| e.to).collect();
        let mut part = Part::new(self, &nodes, |_| true, &[]);
        part.links = (1..self.full.links.len()).collect();
        part.elements = (0..self.full.elements.len()).collect();
        part.conditions = (0..self.full.conditions.len()).collect();
        part
    }

    /// Dependences of the motion of body `i`.
    pub fn part_of_body(&self, i: usize) -> Part {
        let links = with_ancestors(self, BTreeSet::from([self.placed.bodies[i].link]));
        Part { links, ..Part::default() }
    }

    /// Dependences of the motion of joint `j`.
    pub fn part_of_joint(&self, j: usize) -> Part {
        Part { links: with_ancestors(self, self.sides(j).into_iter().collect()), ..Part::default() }
    }

    /// Dependences of the reaction of joint `j`.
    pub fn part_of_reaction(&self, j: usize) -> Part {
        let tree = &self.placed.carrying;
        let mut outboard = BTreeSet::new();
        for e in tree {
            if e.joint == Some(j) || outboard.contains(&e.from) {
                outboard.insert(e.to);
            }
        }
        Part::new(self, &outboard, |joint| joint == j, &self.sides(j))
    }

    /// What element `e` of the applied forces depends on.
    pub fn part_of_load(&self, e: usize) -> Part {
        let element = &self.full.elements[e];
        let mut links: BTreeSet<usize> = element.touches().1.into_iter().chain(element.looks_at()).collect();
        if element.sees_state(&*self.callers.functions) {
            links.extend(seen(self));
        }
        // the link that moves with a velocity along which it acts
        let along = element.touches().0;
        links.extend((1..self.full.links.len()).filter(|&i| {
            let l = &self.placed.links[i];
            along.is_some_and(|v| (l.v..l.v + l.motion.velocities()).contains(&v))
        }));
        Part { links: with_ancestors(self, links), elements: vec![e], ..Part::default() }
    }

    /// Links of the two sides of a joint, and those of its own motions.
    fn sides(&self, j: usize) -> Vec<usize> {
        let p = &self.placed.joints[j];
        let ends = [p.parent, p.child].map(|n| self.placed.link_of(n));
        ends.into_iter().chain(p.links.iter().flatten().copied()).collect()
    }

    /// Poses and twists at (q, v) of the links of `part`, in three dimensions and in the space of the evaluations.
    pub fn look_at(&self, part: &Part, q: &[S], v: &[S], s: &mut Scratch<S>) {
        self.full.fit(&mut s.full);
        for &i in &part.links {
            self.full.pose(i, q, &mut s.full);
            self.full.twist(i, v, &mut s.full);
        }
        if let (Engine::Planar(tree), Some(planar)) = (&self.engine, &mut s.planar) {
            for &i in &part.links {
                tree.pose(i, q, planar);
            }
        }
    }
}
