//! The reduced equations without M_d: the articulated recursion over clusters of joints.            (48)
//!
//! Joints that share loops or drives form a cluster. Relative to its base link, a cluster acts as one joint: inward it
//! transmits an articulated inertia and a force, outward it receives an acceleration. Two algorithms are available:
//!
//! * *partial velocities*, for few degrees of freedom: its links move by `S_c = S D_cᵀ`;
//! * *range space*, for many degrees of freedom or conditions: the links move freely along the cluster's own tree, and
//!   each row of C
//!   carries its multiplier with it until the row is complete, where it is eliminated. The matrix of the multipliers stays
//!   sparse; which entries it has and in which order they go is a plan.
//!
//! A joint that is in no loop is a cluster without rows. Cost: proportional to the links, for one degree of freedom and
//! for a thousand. (Jain 2009, 2012; Chignoli, Adrian, Kim, Wensing 2023; Sathya, Carpentier 2025.)

mod compliance;
mod delassus;
mod few;
mod plan;
mod sweep;

pub use crate::memory::ClusterScratch;
pub use plan::{Plan, Preference, Route};
pub(crate) use sweep::LoadedTangents;

use crate::mechanics::Mechanics;
use crate::tree::{LinkMotion, Tree};
use partita_math::elimination::Pattern;
use partita_math::spatial::Space;
use partita_system::clusters::Clusters;

/// Own velocities of a link.
pub(crate) fn dof<G: Space>(motion: &LinkMotion<G>) -> usize {
    match motion {
        LinkMotion::Ball => 3,
        _ => 1,
    }
}

/// Clusters of a tree whose C has this pattern: all links on the path of a closing belong together, so that a cluster
/// is a connected part of the tree below one link.
pub fn clusters<G: Space>(tree: &Mechanics<G>, pattern: &Pattern) -> Clusters {
    let mut together: Vec<Vec<usize>> = Vec::new();
    for l in tree.links.iter().skip(1).filter(|l| matches!(l.motion, LinkMotion::Ball)) {
        together.push((l.v..l.v + 3).collect());
    }
    for k in &tree.closings {
        together.push(k.path.iter().map(|p| tree.links[p.link].v).collect());
    }
    for c in &tree.conditions {
        together.push(c.cluster(tree).iter().map(|&l| tree.links[l].v).collect());
    }
    Clusters::new(pattern, together.iter().map(Vec::as_slice))
}

impl<G: Space> Tree<G> {
    /// Numbers of a twist.
    pub(crate) fn dimensions(&self) -> usize {
        G::DIM
    }
}
