//! The compiled mechanism: immutable, a [`ConstrainedSystem`](partita_system::ConstrainedSystem).

use crate::breakpoints::Curves;
use crate::clusters::{self, Preference};
use crate::coincident;
use crate::compile;
use crate::coupling::{self, Condition, Law, Says};
use crate::error::DescriptionError;
use crate::evaluator::{with_engine, DriveRow, Engine, Evaluator, Follow, Wide};
use crate::expanded::Expanded;
use crate::force::Element;
use crate::joint::Shape;
use crate::massless;
use crate::measurement::Measurement;
use crate::mechanics::Mechanics;
use crate::names;
use crate::numbers::Numbers;
use crate::part::Part;
use crate::planarity;
use crate::reaction_friction::Following;
use crate::rotors;
use crate::rows::{Owner, Row};
use crate::sparse_mass::MassLayout;
use crate::spec::{Coupling, Drive, JointKind, Measure, Spec};
use crate::topology::TreeEdge;
use crate::tree::LinkMotion;
use crate::validate;
use crate::value::{Abscissa, Callers, Functions};
use crate::zero_position::{Coordinates, Placed};
use partita_math::elimination::Pattern;
use partita_math::scalar::Scalar;
use partita_math::spatial::{Space, Spatial};
use partita_math::tolerance;
use partita_system::compiled::CompiledChoices;
use partita_system::system::{Size, Structure};
use partita_system::SystemError;
use std::collections::HashSet;
use std::f64::consts::PI;
use std::sync::{Arc, OnceLock};

/// A compiled mechanism: an [`Evaluator`] over `f64`, and its structure. It is immutable; threads share it.
pub struct Model {
    /// The equations over `f64`.
    pub(crate) own: Evaluator<f64>,
    /// The description it was made from.
    pub spec: Arc<Spec>,
    /// All rows: loop closures, couplings, drives.
    pub row_names: Vec<Row>,
    /// Number of rows, the first ones, that close joints.
    pub closing_rows: usize,
    /// Rows of the spatial loop closures that are redundant in the plane.
    pub out_of_plane: Vec<Row>,
    structure: Structure,
    /// Sparsity of M, computed on first use.
    mass_layout: OnceLock<MassLayout>,
    /// Curves with breakpoints, computed on first use.
    curves: OnceLock<Curves>,
    /// Dependences of all outputs together, computed on first use.
    whole: OnceLock<Part>,
    preference: Preference,
    dense_projection: bool,
    /// Code of the rates of its choices.
    pub(crate) compiled: CompiledChoices,
    coordinates: Coordinates,
    /// The decision about the drawing.
    geometry: Arc<Geometry>,
    /// The equations with derivatives, made on first use; none where `f64` alone can solve for frictions.
    pub(crate) varied: OnceLock<Option<Evaluator<Wide>>>,
    /// The equations with sparse derivatives, made on first use; none where they cannot be recorded.
    pub(crate) expanded: OnceLock<Option<Box<Expanded>>>,
    /// Memory for the next evaluations.
    spare: Arc<Spare>,
    /// The mechanism itself, where its drives were replaced by actuators.
    mechanism: Option<Arc<Model>>,
    /// The mechanism without the drives that do not always hold.
    permanent: Option<Arc<Model>>,
}

mod actuated;
mod geometry;
mod notes;
mod parting;
mod scales;
mod scratch;
mod system;

pub use actuated::Silent;
pub use geometry::{BlockDecision, BlockVerdict, Geometry};
use scales::{Links, RowMeasures};
pub use scratch::ModelScratch;
use scratch::Spare;

/// Whether every body is held by fixed joints alone. Then no tree has a coordinate, and the decision is the same in
/// all.
fn all_welded(spec: &Spec) -> bool {
    let mut held = vec![validate::GROUND];
    let welds = || spec.joints.iter().filter(|j| j.kind == JointKind::Fixed && !spec.is_apart(j));
    let mut next = 0;
    while let Some(&body) = held.get(next) {
        next += 1;
        for j in welds() {
            let (parent, child) = (j.parent.as_str(), j.child.as_str());
            let other = if parent == body { child } else { parent };
            if (parent == body || child == body) && !held.contains(&other) {
                held.push(other);
            }
        }
    }
    held.len() > spec.bodies.len()
}

/// Reaction-dependent frictions, if there are any.
fn following(
    own: &Evaluator<f64>,
    spec: &Spec,
    rows: (&Pattern, &[Option<f64>]),
) -> Result<Option<Arc<dyn Follow<f64>>>, DescriptionError> {
    Ok(Following::new(own, spec, rows)?.map(|found| Arc::new(found) as Arc<dyn Follow<f64>>))
}

impl Model {
    /// Compile a description; `functions` are those to which it refers by number.
    pub fn new(spec: Spec, functions: Arc<dyn Functions>, coordinates: Coordinates) -> Result<Self, DescriptionError> {
        Self::build(spec, functions, coordinates)
    }

    /// The functions given with its description.
    pub fn functions(&self) -> Arc<dyn Functions> {
        self.own.callers.functions.clone()
    }

    /// The same model with its reduced equations computed by this method.
    pub fn with_recursion(mut self, preference: Preference) -> Self {
        self.preference = preference;
        self
    }

    /// Its equations over `f64`, by which outputs and reactions are computed.
    pub fn equations(&self) -> &Evaluator<f64> {
        &self.own
    }

    /// Its zero position: bodies, joints and links in the axes of the mechanism.
    pub fn zero_position(&self) -> &Placed {
        &self.own.placed
    }

    /// Characteristic length: the extent of a typical body.
    pub fn length(&self) -> f64 {
        self.own.placed.length
    }

    /// Extent of the whole drawing.
    pub fn extent(&self) -> f64 {
        self.own.placed.size
    }

    /// Kinematic shape of joint `j`.
    pub fn shape(&self, j: usize) -> &Shape {
        &self.own.placed.joints[j].shape
    }

    /// Joints of the tree.
    pub fn tree(&self) -> &[TreeEdge] {
        &self.own.placed.topology.tree
    }

    /// Joints that are cut.
    pub fn cuts(&self) -> &[usize] {
        &self.own.placed.topology.cuts
    }

    /// Prescribed motions.
    pub fn drives(&self) -> &[DriveRow] {
        &self.own.drives
    }

    /// Take a decision about the drawing.
    fn decide(&mut self, geometry: Arc<Geometry>) {
        self.structure.drawing = geometry.verdict(&self.spec);
        self.geometry = geometry;
    }

    /// The decision about the drawing.
    pub fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// What would make it movable if the drawing might have an error of this size (radians, fractions of lengths).
    pub fn geometry_within(&self, tolerance: f64) -> Geometry {
        let drawn = self.as_drawn();
        geometry::decide(drawn.as_ref().unwrap_or(self), tolerance).0
    }

    /// The mechanism as it was drawn, where it was repaired.
    pub fn as_drawn(&self) -> Option<Self> {
        let drawn = self.geometry.drawn.as_ref()?;
        Self::compiled((**drawn).clone(), self.functions(), (self.coordinates, true), false).ok()
    }

    /// The same mechanism with all rows of its loop closures in space, also when it is planar: for questions about the
    /// reactions out of the plane. Where a curve [needs whole turns](Self::needs_turns), at the drawn position.
    pub fn in_space(&self) -> Result<Self, DescriptionError> {
        self.in_space_at(&self.initial())
    }

    /// As `in_space`, around the position q.
    pub fn in_space_at(&self, q: &[f64]) -> Result<Self, DescriptionError> {
        if let Some(mechanism) = &self.mechanism {
            return mechanism.in_space_at(q);
        }
        let mut spec = (*self.spec).clone();
        if self.needs_turns() {
            let mut s = self.own.scratch();
            self.own.look(q, &vec![0.0; self.own.placed.nv], &mut s);
            for (i, abscissa) in self.counted_curves() {
                let x = abscissa.value(&self.own.full, &s.full, q);
                if let Coupling::Curve { curve, .. } = &mut spec.couplings[i] {
                    *curve = curve.around(x, PI);
                }
            }
        }
        self.same(spec, (self.coordinates, false))
    }

    /// Whether a curve depends on the whole turns of an angle that is counted in the plane alone.
    pub fn needs_turns(&self) -> bool {
        self.counted_curves().next().is_some()
    }

    /// Couplings by curves over angles that are counted in the plane alone, with these.
    fn counted_curves(&self) -> impl Iterator<Item = (usize, &Measurement<Spatial<f64>>)> {
        self.own.full.conditions.iter().filter_map(|c| match (&c.says, c.owner) {
            (Says::Law(Law::Curve { abscissa: Abscissa::Known, .. }, readings), Owner::Coupling(i)) => {
                readings.get(1).filter(|x| !x.adds_up.is_empty()).map(|x| (i, x))
            }
            _ => None,
        })
    }

    /// The same mechanism in these coordinates.
    pub fn in_coordinates(&self, coordinates: Coordinates) -> Result<Self, DescriptionError> {
        self.same((*self.spec).clone(), (coordinates, true))
    }

    /// The same mechanism with nothing prescribed.
    pub fn without_drives(&self) -> Result<Self, DescriptionError> {
        self.same(Spec { drives: Vec::new(), ..(*self.spec).clone() }, (self.coordinates, true))
    }

    /// Compiled again in another form; its geometry is already decided.
    fn same(&self, spec: Spec, form: (Coordinates, bool)) -> Result<Self, DescriptionError> {
        let mut made = Self::compiled(spec, self.functions(), form, false)?;
        made.decide(self.geometry.clone());
        Ok(made)
    }

    /// The mechanism that a description represents: exact, repaired or as drawn.                                 (T3)
    fn build(spec: Spec, functions: Arc<dyn Functions>, coordinates: Coordinates) -> Result<Self, DescriptionError> {
        let form = (coordinates, true);
        let mut model = Self::compiled(spec, functions.clone(), form, false)?;
        let (mut geometry, joints) = geometry::decide(&model, model.spec.drawing_tolerance);
        if let Some(joints) = joints {
            let drawn = model.spec.clone();
            model = Self::compiled(Spec { joints, ..(*drawn).clone() }, functions.clone(), form, false)?;
            if let Some(joints) = geometry::closed_zeros(&model, drawn.drawing_tolerance) {
                model = Self::compiled(Spec { joints, ..(*drawn).clone() }, functions, form, false)?;
            }
            geometry.drawn = Some(drawn);
        }
        model.decide(Arc::new(geometry));
        Ok(model)
    }

    /// Compile a part, which may be welded to the ground as a whole.
    fn compiled(
        mut spec: Spec,
        functions: Arc<dyn Functions>,
        (coordinates, allow_plane): (Coordinates, bool),
        may_be_welded: bool,
    ) -> Result<Self, DescriptionError> {
        validate::validate(&spec, functions.count())?;
        coincident::unite(&mut spec);
        let mut placed = Placed::new(&spec, coordinates, allow_plane)?;
        rotors::place(&mut placed, &spec)?;
        massless::weigh(&mut placed, &spec);
        if placed.nv == 0 || !may_be_welded && all_welded(&spec) {
            let message = "nothing can move: every body is fixed to the ground; free a joint";
            return Err(DescriptionError::new("mechanism", &spec.name, message));
        }
        names::distinct(&spec, &placed)?;
        driven_once(&spec.drives)?;
        let drives = drives(&spec, &placed, compile::row_count(&placed))?;
        let numbers = Numbers::new(&spec, &placed);
        Self::made(spec, placed, numbers, drives, functions, coordinates)
    }

    /// This model with another description of the same structure; `moved`: with another geometry, to be decided.
    pub(crate) fn renewed(
        &self,
        spec: Spec,
        placed: Placed,
        numbers: Numbers<f64>,
        moved: bool,
    ) -> Result<Self, DescriptionError> {
        let drives = drives(&spec, &placed, compile::row_count(&placed))?;
        let functions = self.own.callers.functions.clone();
        let mut made = Self::made(spec, placed, numbers, drives, functions, self.coordinates)?;
        made.decide(self.geometry.clone());
        if moved {
            let (geometry, joints) = geometry::decide(&made, made.spec.drawing_tolerance);
            if joints.is_some() {
                made = Self::new((*made.spec).clone(), made.functions(), self.coordinates)?;
            } else {
                made.decide(Arc::new(geometry));
            }
        }
        Ok(made.with_recursion(self.preference))
    }

    fn made(
        spec: Spec,
        placed: Placed,
        numbers: Numbers<f64>,
        drives: Vec<DriveRow>,
        functions: Arc<dyn Functions>,
        form: Coordinates,
    ) -> Result<Self, DescriptionError> {
        let Links { mut coordinates, velocities, q_displacement } = Links::new(&placed);
        let v_sizes = velocities.iter().map(|v| v.displacement).collect();
        let given_count = functions.given_count();
        let callers = Arc::new(Callers { functions, q_sizes: q_displacement, v_sizes });
        let placed = Arc::new(placed);
        let (mut own, [row_names, full_rows]) =
            Evaluator::new(&spec, placed.clone(), numbers, drives.clone(), callers)?;
        let look = RowMeasures { spec: &spec, placed: &placed };
        let (columns, displacements, angles, (_, holonomic, _), closing_rows) = match &own.engine {
            Engine::Planar(tree) => {
                (all_columns(tree), look.displacements(tree), look.angles(tree), tree.sizes(), tree.rows)
            }
            Engine::Full => {
                let tree = &own.full;
                (all_columns(tree), look.displacements(tree), look.angles(tree), tree.sizes(), tree.rows)
            }
        };
        let out_of_plane = if placed.planar {
            let in_plane: HashSet<&str> = row_names.iter().map(|r| r.name.as_str()).collect();
            full_rows.iter().filter(|r| !in_plane.contains(r.name.as_str())).cloned().collect()
        } else {
            Vec::new()
        };
        let elements = &own.full.elements;
        let pattern = Pattern::from_rows(placed.nv, &columns);
        own.following = following(&own, &spec, (&pattern, &displacements))?;
        let clusters = match &own.engine {
            Engine::Planar(tree) => clusters::clusters(tree, &pattern),
            Engine::Full => clusters::clusters(&own.full, &pattern),
        };
        if elements.iter().any(Element::calls_function) {
            coordinates.iter_mut().for_each(|x| x.turns = false);
        }
        coordinates.iter_mut().for_each(|x| x.repeats = x.turns);
        // in the plane an angle between two bodies adds up from those of the tree, whole turns included
        let coupled = own.full.conditions.iter().flat_map(Condition::readings);
        for q in coupled.flat_map(Measurement::counted) {
            (coordinates[q].turns, coordinates[q].repeats) = (false, false);
        }
        for element in elements {
            element.depends_on().into_iter().flat_map(Measurement::counted).for_each(|q| coordinates[q].turns = false);
            element.winds_up().into_iter().flat_map(Measurement::counted).for_each(|q| coordinates[q].repeats = false);
        }
        let drawing = Geometry::default().verdict(&spec);
        let structure = Structure {
            size: Size { nq: placed.nq, nv: placed.nv, rows: pattern.rows, holonomic },
            pattern,
            clusters,
            coordinates,
            velocities,
            rows: row_names
                .iter()
                .zip(displacements)
                .zip(angles)
                .map(|((row, d), a)| row.described(&spec, d, a))
                .collect(),
            rheonomic: own.full.conditions.iter().any(Condition::is_rheonomic),
            has_power: elements.iter().any(Element::is_dissipative),
            lacks_mass: !placed.massless.is_empty(),
            given_count,
            drawing,
        };
        let mut model = Self {
            own,
            structure,
            coordinates: form,
            dense_projection: false,
            compiled: CompiledChoices::default(),
            spec: Arc::new(spec),
            row_names,
            closing_rows,
            out_of_plane,
            mass_layout: OnceLock::new(),
            curves: OnceLock::new(),
            whole: OnceLock::new(),
            preference: Preference::default(),
            geometry: Arc::default(),
            varied: OnceLock::new(),
            expanded: OnceLock::new(),
            spare: Arc::default(),
            mechanism: None,
            permanent: None,
        };
        model.dense_projection = model.dense_is_cheaper();
        if !model.own.placed.massless.is_empty() && !model.is_short_of_mass() {
            model.count_as_drawn();
            let displacements: Vec<_> = model.structure.rows.iter().map(|row| row.displacement).collect();
            model.own.following = following(&model.own, &model.spec, (&model.structure.pattern, &displacements))?;
        }
        Ok(model)
    }

    /// Whether the least masses of massless links change a metric, in the drawing or next to it.
    fn is_short_of_mass(&self) -> bool {
        let n = self.own.placed.nv;
        let (mut s, mut near) = (self.own.scratch(), self.initial());
        // an irregular position: axes that coincide in the drawing do not there
        let irregular = |(i, large): (usize, f64)| large * (0.3 + 0.2 * (i as f64 * 1.7).sin());
        let step: Vec<f64> = self.structure.displacements().enumerate().map(irregular).collect();
        self.own.step(&mut near, &step);
        let (mut drawn, mut counted) = (vec![0.0; n], vec![0.0; n]);
        [self.initial(), near].iter().any(|q| {
            with_engine!(self.own, s, |tree, x| {
                tree.poses(q, x);
                tree.inertias(x);
                if tree.articulate_as_drawn(x).is_err() {
                    return true;
                }
                tree.inverse_mass_diagonal(x, &mut drawn);
                tree.articulate_straight(x);
                tree.inverse_mass_diagonal(x, &mut counted);
            });
            drawn.iter().zip(&counted).any(|(d, c)| d.is_nan() || *d > tolerance::DOUBLED * c)
        })
    }

    /// M is a metric: no link needs more than its own mass.
    fn count_as_drawn(&mut self) {
        self.structure.lacks_mass = false;
        let mut placed = (*self.own.placed).clone();
        placed.massless.clear();
        self.own.placed = Arc::new(placed);
        self.own.full.count_as_drawn();
        if let Engine::Planar(tree) = &mut self.own.engine {
            tree.count_as_drawn();
        }
    }

    /// The same mechanism over other numbers, all of them constants.
    ///
    /// Fails where a user function would have to be called and cannot be (a recording).
    pub fn over<S: Scalar>(&self) -> Result<Evaluator<S>, DescriptionError> {
        self.refuse_following()?;
        let numbers = Numbers::new(&self.spec, &self.own.placed);
        let made = Evaluator::new(
            &self.spec,
            self.own.placed.clone(),
            numbers,
            self.own.drives.clone(),
            self.own.callers.clone(),
        );
        Ok(made?.0)
    }

    /// Whether frictions follow from reactions, which `f64` alone can solve for.
    pub fn follows_reactions(&self) -> bool {
        self.own.following.is_some()
    }

    /// Refuse frictions that another number type would take for zero.
    pub(crate) fn refuse_following(&self) -> Result<(), DescriptionError> {
        if self.follows_reactions() {
            let message = "a reaction-dependent friction cannot be evaluated here; give the friction magnitudes \
                (dynamic=)";
            return Err(DescriptionError::new("mechanism", &self.spec.name, message));
        }
        Ok(())
    }

    /// Whether M_d is formed from a dense M.
    pub(crate) fn uses_dense_mass(&self) -> bool {
        self.dense_projection
    }

    /// For k near n the mass matrix is cheaper than k partial velocities: compare the two counts.
    fn dense_is_cheaper(&self) -> bool {
        let n = self.own.placed.nv;
        let k = n.saturating_sub(self.structure.size.rows);
        let links = self.own.full.links.len();
        let partial = Self::partial_cost(links, k);
        // a column of M involves only the descendants of its velocity; then D M Dᵀ
        let mut depth = vec![0; links];
        (1..links).for_each(|i| depth[i] = depth[self.own.full.links[i].parent] + 1);
        let steps: usize = depth.iter().sum();
        let dense = steps * 60 + n * n * k.min(n) / 2;
        dense < partial
    }

    /// A partial velocity: a cross product and its share of the sums for M_d, per link and pair of columns.
    fn partial_cost(links: usize, k: usize) -> usize {
        links * (k * k * 6 + 24 * k)
    }

    /// Number of multiplications for one dense M_d of k degrees of freedom, its factor included.
    fn dense_cost(&self, k: usize) -> usize {
        let scale = if self.is_planar() { 1 } else { 4 };
        scale * Self::partial_cost(self.own.full.links.len(), k) / 2 + k * k * k / 6
    }

    fn mass_layout(&self) -> &MassLayout {
        self.mass_layout.get_or_init(|| match &self.own.engine {
            Engine::Planar(tree) => MassLayout::new(tree),
            Engine::Full => MassLayout::new(&self.own.full),
        })
    }

    /// Dependences of all outputs together: everything.
    pub fn whole(&self) -> &Part {
        self.whole.get_or_init(|| self.own.whole())
    }

    pub(crate) fn curves(&self) -> &Curves {
        self.curves.get_or_init(|| Curves::new(&self.spec, &self.own))
    }

    /// Type of coordinates of the tree.
    pub fn coordinates(&self) -> Coordinates {
        self.coordinates
    }

    /// Whether all motions lie in one plane.
    pub fn is_planar(&self) -> bool {
        self.own.placed.planar
    }

    /// Whether it moves in one plane under loads in this plane, so that all reactions lie in the plane.
    pub fn loads_lie_in_plane(&self) -> bool {
        let of_joint = |row: &Row| matches!(row.owner, Owner::Joint(_));
        self.is_planar()
            && !self.row_names[self.closing_rows..].iter().any(of_joint)
            && planarity::loads_lie_in_plane(&self.spec, self.own.placed.basis.0[2])
    }

    /// Coordinates of the drawing: zero, and unit quaternions.
    pub fn initial(&self) -> Vec<f64> {
        let mut q = vec![0.0; self.own.placed.nq];
        for l in self.own.full.links.iter().skip(1) {
            if matches!(l.motion, LinkMotion::Ball) {
                q[l.q] = 1.0;
            }
        }
        q
    }

    /// Joint of a row, if it belongs to one.
    pub fn joint_of_row(&self, row: usize) -> Option<usize> {
        match self.row_names[row].owner {
            Owner::Joint(j) => Some(j),
            Owner::Coupling(_) | Owner::Rotor(_) | Owner::Drive(_) => None,
        }
    }

    /// Coupling of a row, if it belongs to one.
    pub(crate) fn coupling_of_row(&self, row: usize) -> Option<usize> {
        match self.row_names[row].owner {
            Owner::Coupling(i) => Some(i),
            Owner::Joint(_) | Owner::Rotor(_) | Owner::Drive(_) => None,
        }
    }

    /// Rows of couplings.
    pub fn coupling_rows(&self) -> usize {
        (0..self.row_names.len()).filter(|&i| self.coupling_of_row(i).is_some()).count()
    }

    /// Rows that prescribe no motion: all except those of drives.
    pub fn undriven(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.row_names.len()).filter(|&i| !matches!(self.row_names[i].owner, Owner::Drive(_)))
    }

    /// Kinetic and potential energy at the last `velocity`.
    pub fn energy(&self, t: f64, q: &[f64], v: &[f64], s: &ModelScratch) -> Result<(f64, f64), SystemError> {
        let [kinetic, potential, _] = self.own.energies(t, q, v, s.evaluated())?;
        Ok((kinetic, potential))
    }

    fn mass_error(&self, at: (usize, f64)) -> SystemError {
        SystemError::Mass { name: self.own.placed.velocity_names[at.0].clone(), pivot: at.1 }
    }
}

/// Refuse drives that prescribe the same at all times.
fn driven_once(drives: &[Drive]) -> Result<(), DescriptionError> {
    for (i, d) in drives.iter().enumerate() {
        if drives[..i].iter().any(|other| other.measure == d.measure) {
            let what = match &d.measure {
                Measure::Joint { joint, .. } => format!("joint \"{joint}\""),
                _ => "what it drives".into(),
            };
            return Err(DescriptionError::new("drive", &d.name, format!("{what} is driven twice")));
        }
    }
    Ok(())
}

/// The rows of the drives, after `first` closing rows.
fn drives(spec: &Spec, placed: &Placed, first: usize) -> Result<Vec<DriveRow>, DescriptionError> {
    let mut drives: Vec<DriveRow> = Vec::with_capacity(spec.drives.len());
    let mut row = first;
    for group in coupling::order(spec, placed)? {
        if let Owner::Drive(i) = group.owner {
            let d = &spec.drives[i];
            let joint = match &d.measure {
                Measure::Joint { joint, coordinate } => placed.joint_numbers.get(joint).map(|&j| (j, *coordinate)),
                _ => None,
            };
            let tree = joint.and_then(|(j, coordinate)| placed.coordinate(j, coordinate));
            drives.push(DriveRow {
                name: d.name.clone(),
                number: i,
                joint,
                tree,
                motion: d.motion.clone(),
                level: d.level,
                row,
            });
        }
        row += group.rows;
    }
    Ok(drives)
}

/// Columns of every row.
fn all_columns<G: Space>(tree: &Mechanics<G>) -> Vec<Vec<usize>> {
    let mut columns = compile::columns(tree);
    columns.extend(tree.conditions.iter().flat_map(|c| vec![c.columns.clone(); c.rows()]));
    columns
}
