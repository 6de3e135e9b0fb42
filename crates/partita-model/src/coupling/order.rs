//! All conditions, and the order of their rows.

use crate::error::DescriptionError;
use crate::joint::Own;
use crate::measurement;
use crate::rotors;
use crate::rows::Owner;
use crate::spec::{Coupling, Level, Measure, Spec};
use crate::zero_position::Placed;
use partita_math::sorting::sort_by_key;
use partita_math::tolerance;

/// A condition in the order of the rows.
#[derive(Clone, Copy, Debug)]
pub struct ConditionRows {
    /// Its owner.
    pub owner: Owner,
    /// Which of the conditions of its owner.
    pub part: usize,
    /// Whether it constrains positions.
    pub holonomic: bool,
    /// Rows.
    pub rows: usize,
    /// Period up to which its readings are known, where whole turns are not known.
    pub period: Option<f64>,
}

/// Shorter common periods of two angles whose turns are not counted are not distinguished from errors; then only the
/// rates are constrained. Scale: rad. Reason: angles agree up to multiples of a common part of their factors.
const SMALLEST_PERIOD: f64 = 0.1;

/// The largest number of which all are multiples, up to rounding; 0 for none.
fn common(numbers: &[f64]) -> f64 {
    let largest = numbers.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    numbers.iter().fold(0.0, |a: f64, b| {
        let (mut a, mut b) = (a, b.abs());
        // ratios are given with nine digits and more
        while b > tolerance::EQUAL * largest {
            (a, b) = (b, a % b);
        }
        a
    })
}

/// Whether the reading is an angle whose whole turns are not counted.
pub fn wraps(placed: &Placed, m: &Measure) -> bool {
    let Some(joint) = m.of_joint() else { return false };
    let in_tree = placed.joint_numbers.get(joint).is_some_and(|&j| placed.joints[j].links.is_some());
    measurement::is_angle(placed, m) && !in_tree && !placed.planar
}

/// All conditions in the order of their rows, after those of the loop closures.
///
/// # Errors
/// Readings that do not exist, and numbers that do not fit.
pub fn order(spec: &Spec, placed: &Placed) -> Result<Vec<ConditionRows>, DescriptionError> {
    let mut groups: Vec<ConditionRows> = Vec::new();
    let turn = std::f64::consts::TAU;
    for (j, p) in placed.joints.iter().enumerate().filter(|x| !x.1.apart) {
        let Some(own) = &p.shape.own else { continue };
        let period = match own {
            Own::Advance(per_radian) => (p.links.is_none()).then_some((per_radian * turn).abs()),
            Own::Twist | Own::Followers(_) => None,
        };
        let owner = Owner::Joint(j);
        groups.extend((0..own.count()).map(|part| ConditionRows { owner, part, holonomic: true, rows: 1, period }));
    }
    for (i, c) in spec.couplings.iter().enumerate() {
        let (owner, name) = (Owner::Coupling(i), c.name());
        c.terms().iter().try_for_each(|m| measurement::known(m, placed, "coupling", name))?;
        let one = ConditionRows { owner, part: 0, holonomic: true, rows: 1, period: None };
        match c {
            Coupling::Linear { terms, factors, .. } => {
                let uncounted: Vec<f64> =
                    terms.iter().zip(factors).filter(|(m, _)| wraps(placed, m)).map(|(_, f)| f * turn).collect();
                let period = common(&uncounted);
                let largest = uncounted.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
                let known_turns = uncounted.is_empty() || period > SMALLEST_PERIOD / turn * largest;
                groups.push(ConditionRows {
                    holonomic: known_turns,
                    period: (period > 0.0 && known_turns).then_some(period),
                    ..one
                });
            }
            Coupling::Curve { terms, periodic, curve, .. } => {
                if wraps(placed, &terms[1]) && !periodic {
                    let span = curve.breaks.last().unwrap_or(&0.0) - curve.breaks.first().unwrap_or(&0.0);
                    if span > turn * (1.0 + tolerance::EQUAL) {
                        let joint = terms[1].of_joint().unwrap_or_default();
                        let message = format!(
                            "its curve needs the whole turns of joint \"{joint}\", which are not known because the \
                             joint closes a loop; keep the joint in the tree (cut = \"never\"), or give a periodic \
                             curve"
                        );
                        return Err(DescriptionError::new("coupling", name, message));
                    }
                }
                let period = wraps(placed, &terms[0]).then_some(turn);
                groups.push(ConditionRows { period, ..one });
            }
            Coupling::Function { level, .. } => {
                groups.push(ConditionRows { holonomic: *level == Level::Position, ..one });
            }
            Coupling::Roll { slips, .. } => {
                groups.push(one);
                if !slips {
                    groups.push(ConditionRows { holonomic: false, rows: 2, ..one });
                }
            }
        }
    }
    for (i, r) in spec.rotors.iter().enumerate().filter(|(i, _)| placed.rotors[*i].link.is_some()) {
        let period = wraps(placed, &rotors::measure(r)).then_some(turn);
        groups.push(ConditionRows { owner: Owner::Rotor(i), part: 0, holonomic: true, rows: 1, period });
    }
    for (i, d) in spec.drives.iter().enumerate() {
        measurement::drivable(d, placed)?;
        let period = wraps(placed, &d.measure).then_some(turn);
        groups.push(ConditionRows {
            owner: Owner::Drive(i),
            part: 0,
            holonomic: d.level == Level::Position,
            rows: 1,
            period,
        });
    }
    // conditions on rates alone come last, each kind in the order of description
    sort_by_key(&mut groups, |p| !p.holonomic);
    Ok(groups)
}
