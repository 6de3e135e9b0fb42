//! The default choice of input velocities.

use super::graph::{Graph, Kind};
use super::instant::Instant;
use super::laws::TreeLaw;
use super::order::Order;
use super::plan::Task;
use super::LoopClosing;
use crate::model::Model;
use crate::spec::Force;
use partita_math::sorting::sort_by_key;
use partita_math::tolerance;
use partita_system::closing::Closing;
use partita_system::prelude::*;
use partita_system::reduction::Reduction;
use partita_system::{start, SystemError};

/// Number of sets of inputs that are examined for mechanisms of up to [`SMALL`] motions; fewer for larger ones, so that
/// the choice costs about as much as a thousand evaluations.
const SETS: usize = 2000;
/// A mechanism with at most this many motions is small.
const SMALL: usize = 40;
/// Number of plans compared by their pivots; fewer for large mechanisms.
const PLANS: usize = 40;

/// A velocity that may be an input, the better the smaller its rank.
struct Candidate {
    v: usize,
    rank: (u8, u8, usize),
}

/// Inputs first taken: of joints that are driven or loaded, then at the ground, then others; the spin of a link between
/// two balls after them.
fn candidates(model: &Model, graph: &Graph) -> Vec<usize> {
    let loaded = |j: Option<usize>| {
        j.is_some_and(|j| {
            let name = &model.spec.joints[j].name;
            model.spec.forces.iter().any(|f| matches!(f, Force::Torque(x) if x.joint == *name))
        })
    };
    let mut found: Vec<Candidate> = Vec::new();
    for e in graph.edges.iter().filter(|e| e.in_tree()) {
        for v in e.velocities() {
            if model.own.drives.iter().any(|d| d.velocity() == Some(v)) {
                continue;
            }
            let kind = u8::from(e.kind == Kind::Ball);
            let priority = if loaded(e.joint) { 0 } else { 1 + u8::from(e.from != 0) };
            found.push(Candidate { v, rank: (kind, priority, v) });
        }
    }
    sort_by_key(&mut found, |c| c.rank);
    found.into_iter().map(|c| c.v).collect()
}

/// All sets of k out of `from`, in the order of their members, until `put` has enough.
fn each_set(from: &[usize], k: usize, set: &mut Vec<usize>, put: &mut impl FnMut(&[usize]) -> bool) -> bool {
    if set.len() == k {
        return put(set);
    }
    for (i, &v) in from.iter().enumerate() {
        if from.len() - i < k - set.len() {
            break;
        }
        set.push(v);
        let go_on = each_set(&from[i + 1..], k, set, put);
        set.pop();
        if !go_on {
            return false;
        }
    }
    true
}

/// Number of velocities left to implicit blocks (those found after them included).
fn implicit_count(model: &Model, graph: &Graph, laws: &[TreeLaw], inputs: &[usize]) -> usize {
    let task = Task::new(model, graph, inputs);
    let mut order = Order::new(graph, laws, model.is_planar(), &task.given, &task.ball_inputs);
    while order.next().is_some() {}
    let missing = graph.edges.iter().enumerate().filter(|(i, e)| e.in_tree() && !order.is_known(*i));
    missing.map(|(_, e)| e.velocities().filter(|v| inputs.binary_search(v).is_err()).count()).sum()
}

/// The choice of the projective criterion, then switches as long as they leave less to implicit blocks: for mechanisms
/// with too many sets to examine them all.
fn by_switches(at: &Instant, t: f64, q: &[f64], k: usize, graph: &Graph, mut budget: usize) -> Option<Vec<usize>> {
    let model = &*at.model;
    let mut r = Reduction::dense(model, model.size().nv - k);
    start::choose_partition(&mut r, t, q, None, None).ok()?;
    let laws = TreeLaw::all(model, graph);
    let mut best = (
        implicit_count(model, graph, &laws, &r.planned.partition.independent),
        r.planned.partition.independent.clone(),
    );
    while best.0 > 0 && budget > 0 {
        let mut better = None;
        'search: for (i, &enters) in r.planned.partition.dependent.iter().enumerate() {
            for (j, &leaves) in r.planned.partition.independent.iter().enumerate() {
                let gain = r.at.a_matrix[i * k + j].abs() * r.scales()[leaves] / r.scales()[enters];
                if gain.is_nan() || gain < tolerance::WEAK_CHOICE {
                    continue;
                }
                let mut next = r.planned.partition.independent.clone();
                next[j] = enters;
                next.sort_unstable();
                let count = implicit_count(model, graph, &laws, &next);
                budget -= 1;
                if count < best.0 {
                    better = Some((count, next));
                    break 'search;
                }
                if budget == 0 {
                    break 'search;
                }
            }
        }
        let Some(found) = better else { break };
        if r.set_partition(t, &found.1).is_err() || r.tangent(t).is_err() {
            break;
        }
        best = found;
    }
    Some(best.1)
}

/// Plan with the inputs that leave the least to implicit blocks and, among those, have the largest product of the
/// pivots.
pub(super) fn choose<'m>(at: &Instant<'m>, t: f64, q: &[f64]) -> Result<LoopClosing<'m>, SystemError> {
    let model = &*at.model;
    let graph = Graph::new(model);
    let laws = TreeLaw::all(model, &graph);
    let k = at.mobility();
    let all = candidates(model, &graph);
    let edges = graph.edges.len().max(SMALL);
    let budget = (SETS * SMALL / edges).max(20);
    let plans = (PLANS * SMALL / edges).max(4);
    let mut ranked: Vec<(usize, Vec<usize>)> = Vec::new();
    let complete = each_set(&all, k, &mut Vec::new(), &mut |set| {
        let mut inputs = set.to_vec();
        inputs.sort_unstable();
        ranked.push((implicit_count(model, &graph, &laws, &inputs), inputs));
        ranked.len() < budget
    });
    if !complete {
        if let Some(inputs) = by_switches(at, t, q, k, &graph, budget) {
            ranked.insert(0, (implicit_count(model, &graph, &laws, &inputs), inputs));
        }
    }
    // equal counts stay in the order of preference
    sort_by_key(&mut ranked, |r| r.0);
    let mut best: Option<(usize, f64, LoopClosing<'m>)> = None;
    for (tried, (count, inputs)) in ranked.into_iter().enumerate() {
        if best.as_ref().is_some_and(|b| b.0 < count || tried >= plans) {
            break;
        }
        let Ok(mut plan) = LoopClosing::new(at, q, &inputs) else { continue };
        if plan.close(t, &mut q.to_vec()).is_err() {
            continue;
        }
        // log of the product, so that a thousand blocks do not vanish
        let volume: f64 = plan.state().iter().map(|s| s.pivot.max(f64::MIN_POSITIVE).ln()).sum();
        if best.as_ref().is_none_or(|b| volume > b.1 + tolerance::TIE) {
            best = Some((count, volume, plan));
        }
    }
    best.map(|b| b.2).ok_or_else(|| {
        SystemError::argument(
            "independent",
            format!(
            "no {k} of the {} joint coordinates determine all others at t = {t}; name the inputs, or start a little \
             away from this position",
            model.size().nv
        ),
        )
    })
}
