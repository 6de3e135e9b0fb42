//! The conditions of a description.

use super::{order, wraps, Condition, ConditionRows, Contact, Law, Orientation, Prescribed, Rolling, Says};
use crate::error::DescriptionError;
use crate::joint::{Follows, Own};
use crate::measurement::{Maker, Measurement, Mover, Quantity};
use crate::numbers::Numbers;
use crate::rotors;
use crate::rows::Owner;
use crate::spec::{Coupling, Drive, GivenAs, Level, Measure, Spec, Turning};
use crate::tree::{LinkMotion, Tree};
use crate::value::Abscissa;
use crate::zero_position::Placed;
use partita_math::scalar::Scalar;
use partita_math::spatial::{Space, Vec3};
use std::f64::consts::TAU;

/// All conditions, in the order of their rows, after the loop closures of a tree.
pub(crate) fn all<G: Space>(
    spec: &Spec,
    placed: &Placed,
    numbers: &Numbers<G::S>,
    tree: &Tree<G>,
) -> Result<Vec<Condition<G>>, DescriptionError> {
    let groups = order(spec, placed)?;
    if groups.is_empty() {
        return Ok(Vec::new());
    }
    let measurements = Maker::<G>::new(spec, placed, numbers, tree)?;
    let (mut row, mut entry) = (tree.rows, tree.entries);
    let mut conditions = Vec::with_capacity(groups.len());
    for group in groups {
        let (name, says) = match group.owner {
            Owner::Joint(j) => (spec.joints[j].name.clone(), own(j, placed, numbers, &group, &measurements)),
            Owner::Coupling(i) => {
                (spec.couplings[i].name().to_string(), coupling(spec, i, placed, numbers, &group, &measurements)?)
            }
            Owner::Rotor(i) => (spec.rotors[i].name.clone(), rotor(spec, i, placed, &group, &measurements)?),
            Owner::Drive(i) => {
                let d = &spec.drives[i];
                let law = |law| Ok(Says::Law(law, vec![measurements.driven(d)?]));
                let motion = || Prescribed::new(d, &numbers.drives[i]);
                let says = match (&d.turning, d.level) {
                    (Some(turning), _) => orientation(turning, d, placed, &measurements)?,
                    (None, Level::Position) => law(Law::Motion { motion: motion(), period: group.period })?,
                    (None, Level::Velocity) => law(Law::Rate(motion()))?,
                };
                (d.name.clone(), says)
            }
        };
        let mut c =
            Condition { name, owner: group.owner, row, entry, columns: Vec::new(), holonomic: group.holonomic, says };
        c.lay_out(tree);
        (row, entry) = (row + c.rows(), entry + c.rows() * c.columns.len());
        conditions.push(c);
    }
    Ok(conditions)
}

fn own<G: Space>(
    j: usize,
    placed: &Placed,
    numbers: &Numbers<G::S>,
    group: &ConditionRows,
    measurements: &Maker<G>,
) -> Says<G> {
    let linear = |factors: Vec<G::S>, period| Law::Linear { factors, offset: G::S::zero(), period };
    match &placed.joints[j].shape.own {
        Some(Own::Followers(all)) => {
            let Follows { motions, function } = &all[group.part];
            let readings = motions.iter().map(|&motion| measurements.coordinate(j, motion)).collect();
            Says::Law(Law::Function(*function), readings)
        }
        Some(Own::Advance(_)) => {
            let per_radian = numbers.pitches[j] / G::S::from_f64(TAU);
            let period = group.period.map(|_| per_radian.scale(TAU));
            let readings = vec![measurements.coordinate(j, 0), measurements.coordinate(j, 1)];
            Says::Law(linear(vec![G::S::one(), -per_radian], period), readings)
        }
        Some(Own::Twist) | None => Says::Law(linear(vec![G::S::one()], None), vec![measurements.twist(j)]),
    }
}

/// A rotor turns with the coordinate of its joint, which closes a loop.
fn rotor<G: Space>(
    spec: &Spec,
    i: usize,
    placed: &Placed,
    group: &ConditionRows,
    measurements: &Maker<G>,
) -> Result<Says<G>, DescriptionError> {
    let r = &spec.rotors[i];
    let of_joint = measurements.reading(&rotors::measure(r), "rotor", &r.name)?;
    let own = placed.rotors[i].link.map(|link| measurements.of_link(link));
    let factors = vec![G::S::one(), -G::S::one()];
    let law = Law::Linear { factors, offset: G::S::zero(), period: group.period.map(G::S::from_f64) };
    Ok(Says::Law(law, std::iter::once(of_joint).chain(own).collect()))
}

/// One component of a prescribed orientation.
fn orientation<G: Space>(
    turning: &Turning,
    d: &Drive,
    placed: &Placed,
    measurements: &Maker<G>,
) -> Result<Says<G>, DescriptionError> {
    let fail = || {
        DescriptionError::new(
            "drive",
            &d.name,
            "an orientation can be prescribed only for a spatial \
        rotation",
        )
    };
    let Measure::Joint { joint, coordinate } = &d.measure else { return Err(fail()) };
    let (j, component) = measurements.turn_in_space(joint, *coordinate, &d.name)?.ok_or_else(fail)?;
    let p = &placed.joints[j];
    let (on_a, on_b) = (measurements.axes(&p.on_parent), measurements.axes(&p.on_child));
    let Measurement { links, nodes, movers, .. } = measurements.spin(p, component);
    Ok(Says::Turning(Box::new(Orientation { on_a, on_b, component, turning: turning.clone(), links, nodes, movers })))
}

fn coupling<G: Space>(
    spec: &Spec,
    i: usize,
    placed: &Placed,
    numbers: &Numbers<G::S>,
    group: &ConditionRows,
    measurements: &Maker<G>,
) -> Result<Says<G>, DescriptionError> {
    let c = &spec.couplings[i];
    let read = |terms: &[Measure]| -> Result<Vec<Measurement<G>>, DescriptionError> {
        terms.iter().map(|m| measurements.reading(m, "coupling", c.name())).collect()
    };
    Ok(match c {
        Coupling::Linear { terms, given_as, .. } => {
            let given = &numbers.couplings[i];
            let (factors, offset) = given.sum(c);
            let uncounted: Vec<usize> = (0..terms.len()).filter(|&i| wraps(placed, &terms[i])).collect();
            let period = group.period.map(|period| match uncounted[..] {
                [only] => factors[only].scale(TAU),
                _ => G::S::from_f64(period),
            });
            let readings = match (given_as, &terms[..]) {
                (Some(GivenAs::Length), [Measure::Distance { body1, body2, .. }]) => {
                    let nodes = [measurements.node(body1), measurements.node(body2)];
                    vec![measurements.distance(nodes, [given.vector("point1"), given.vector("point2")])]
                }
                _ => read(terms)?,
            };
            Says::Law(Law::Linear { factors, offset, period }, readings)
        }
        Coupling::Curve { terms, curve, periodic, .. } => {
            let abscissa = match (periodic, wraps(placed, &terms[1])) {
                (true, _) => Abscissa::Periodic,
                (false, true) => Abscissa::UpToTurns,
                (false, false) => Abscissa::Known,
            };
            let law = Law::Curve { curve: curve.clone(), abscissa, period: group.period };
            Says::Law(law, read(terms)?)
        }
        Coupling::Function { terms, function, .. } => Says::Law(Law::Function(*function), read(terms)?),
        Coupling::Roll { body, axis, on, normal, .. } => {
            let given = &numbers.couplings[i];
            let [a, b] = [measurements.node(on), measurements.node(body)];
            let points = [
                numbers.point_on(placed, a, given.vector("point")),
                numbers.point_on(placed, b, given.vector("center")),
            ];
            let rot = |node: usize| if node == 0 { placed.basis } else { placed.bodies[node - 1].rot };
            let unit = |x: &[f64; 3], node: usize, what: &str| -> Result<Vec3<f64>, DescriptionError> {
                let message = || format!("{what} = {x:?} has no direction; give a vector of finite length");
                let unit = Vec3(*x).unit().ok_or_else(|| DescriptionError::new("coupling", c.name(), message()))?;
                Ok(rot(node).apply(unit))
            };
            let n = unit(normal, a, "normal")?;
            let (t1, t2) = n.complement();
            let axis = axis.as_ref().map(|x| unit(x, b, "axis")).transpose()?;
            let ends = measurements.ends([a, b], points);
            // any measurement of displacements has the same links between the two bodies
            let between = measurements.between([a, b], Quantity::Along(ends, G::Vec::default()));
            let rolling = Rolling {
                ends,
                axis: axis.map(|x| G::vec_from(x.0)),
                frame: [n, t1, t2].map(|x| G::vec_from(x.0)),
                radius: given.number("radius"),
                links: between.links,
                nodes: between.nodes,
                movers: between.movers,
            };
            Says::Rolling(rolling, if group.holonomic { Contact::Touches } else { Contact::Rolls })
        }
    })
}

impl<G: Space> Condition<G> {
    fn movers_mut(&mut self) -> impl Iterator<Item = &mut Mover> {
        let (readings, own) = match &mut self.says {
            Says::Law(_, readings) => (readings.as_mut_slice(), None),
            Says::Rolling(rolling, _) => (&mut [][..], Some(&mut rolling.movers)),
            Says::Turning(orientation) => (&mut [][..], Some(&mut orientation.movers)),
        };
        readings.iter_mut().flat_map(|r| &mut r.movers).chain(own.into_iter().flatten())
    }

    /// Give every link that moves it its columns.
    fn lay_out(&mut self, tree: &Tree<G>) {
        let own = |link: usize| match tree.links[link].motion {
            LinkMotion::Ball => 3,
            _ => 1,
        };
        let mut columns: Vec<usize> =
            self.movers_mut().flat_map(|m| tree.links[m.link].v..tree.links[m.link].v + own(m.link)).collect();
        columns.sort_unstable();
        columns.dedup();
        for m in self.movers_mut() {
            m.column = columns.partition_point(|&v| v < tree.links[m.link].v);
        }
        self.columns = columns;
    }

    /// Links that belong to one cluster because of it: those that move it, and their ancestors up to the last common
    /// one.
    pub(crate) fn cluster(&self, tree: &Tree<G>) -> Vec<usize> {
        let movers: Vec<&Mover> = match &self.says {
            Says::Law(_, readings) => readings.iter().flat_map(|r| &r.movers).collect(),
            Says::Rolling(rolling, _) => rolling.movers.iter().collect(),
            Says::Turning(orientation) => orientation.movers.iter().collect(),
        };
        let mut links: Vec<usize> = movers.iter().map(|m| m.link).collect();
        links.sort_unstable();
        links.dedup();
        loop {
            let tops: Vec<usize> =
                links.iter().map(|&l| tree.links[l].parent).filter(|p| links.binary_search(p).is_err()).collect();
            // parents have smaller numbers: the largest cannot be an ancestor of the others
            let (Some(&largest), Some(&least)) = (tops.iter().max(), tops.iter().min()) else { return links };
            if largest == least {
                return links;
            }
            links.insert(links.partition_point(|&l| l < largest), largest);
        }
    }
}
