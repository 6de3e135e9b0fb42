//! Explicit closing of loops by inverse kinematics: the dependent coordinates as functions of the inputs.  (37), (38)
//!
//! ```text
//! q_D = g(q_I, t; ε)       ε: branch signs, constants of the motion between dead points
//! ```
//!
//! The mechanism is a graph of elementary motions (`graph`). Rigid clusters of bodies grow by polygons that close in
//! closed form (`order`, `polygon`): dyads in the plane (`planar`), characteristic pairs in space (`spatial`). Couplings
//! of coordinates lead from one loop to another (`laws`). What cannot be ordered is solved in the smallest possible
//! implicit blocks (`blocks`, `btf`, `implicit`). The order depends on the inputs alone; it is found once (`plan`) and
//! then followed without searching and without allocation (`close`).
//!
//! Prefer it where loops are recognised and the pivots of the blocks stay away from 0: the loops are closed to
//! round-off by construction and the branch is always known. The sign ε belongs to the shape of a polygon: where a
//! pivot passes through zero without a limit (a change point, such as that of a parallelogram in line) the motion
//! continues with the other sign, which only its velocity determines:
//! [`follow`](partita_system::closing::Closing::follow) takes the branch nearest to the predicted position. At a dead
//! point of its inputs it ends with [`SystemError::Limit`].
//!
//! [`SystemError::Limit`]: partita_system::SystemError::Limit

mod adjacent;
mod arm;
mod assemblies;
mod blocks;
mod btf;
mod close;
mod graph;
mod implicit;
mod inputs;
mod instant;
mod laws;
mod order;
mod over;
mod plan;
mod planar;
mod polygon;
mod program;
mod spatial;

pub use adjacent::{Adjacent, AdjacentClosing, AdjacentScratch};
pub use assemblies::{Assembled, Assemblies};
pub(crate) use implicit::STRAIGHT;
pub use over::ClosingScratch;
pub use program::ClosingProgram;

use crate::model::{Model, ModelScratch};
use arm::{Chain, PlanarArm, Pose};
use graph::Graph;
use implicit::Implicit;
use laws::SolvedLaw;
use partita_system::closing::{Block, BlockState};
use partita_system::SystemRef;
use planar::PlanarPolygon;
use polygon::Polygon;

/// How one step determines its coordinates.
#[derive(Clone, Debug)]
enum Work {
    /// A driven coordinate: the number of the drive, its edge.
    Drive(usize, usize),
    /// A polygon in a plane.
    Plane(Polygon, PlanarPolygon),
    /// A characteristic pair.
    Space(Polygon),
    /// A coupling that gives one coordinate from others.
    Law(SolvedLaw),
    /// Newton's method.
    Implicit(Implicit),
}

/// One step of the closing, in the order of solution.
#[derive(Clone, Debug)]
struct Step {
    work: Work,
    words: String,
    /// Signs of its pivots, 0 where there is only one solution.
    signs: [i8; 2],
    /// Number of signs that matter.
    states: usize,
    pivots: [f64; 2],
    /// Sides of a polygon in a plane, those that vary, and those of rotations alone.
    sides: [PlanarArm<f64>; 3],
    moving: [bool; 3],
    chains: [Option<Chain>; 3],
    /// Edges whose coordinates it finds.
    edges: Vec<usize>,
}

/// Loops closed by inverse kinematics, for one choice of inputs and one branch: see [`Model::loop_closing`].
pub struct LoopClosing<'m> {
    model: SystemRef<'m, Model>,
    graph: Graph,
    steps: Vec<Step>,
    inputs: Vec<usize>,
    blocks: Vec<Block>,
    states: Vec<BlockState>,
    /// Step and number of the sign of each block.
    entries: Vec<(usize, usize)>,
    /// Edges of the tree except those that a polygon in a plane determines, whose old coordinates are not read.
    given: Vec<usize>,
    /// Velocities whose coordinates include their whole turns: inputs, driven ones, those that a coupling determines.
    counted: Vec<bool>,
    /// Whether a joint locks a rotation in the plane, and with it its whole turns.
    locks_turns: bool,
    /// Largest mismatch (m) a redundant loop may show.
    tolerance: f64,
    // scratch
    pose: Pose<f64>,
    old: Vec<f64>,
    scratch: ModelScratch,
    phi: Vec<f64>,
    c: Vec<f64>,
    a: Vec<f64>,
    dv: Vec<f64>,
    newton: implicit::ImplicitScratch,
    iterations: u64,
}
