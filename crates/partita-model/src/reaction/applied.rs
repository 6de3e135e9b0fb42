//! What acts on the bodies besides their joints.

use super::Wrench;
use crate::load::{self, Load, Push};
use crate::model::{Model, ModelScratch};
use crate::part::Part;
use crate::value;
use partita_math::spatial::Vec3;
use partita_system::SystemError;

impl Model {
    /// Put a wrench about a point of space on a node.
    pub(super) fn put(&self, s: &ModelScratch, on: &mut [Wrench], node: usize, w: &Wrench, point: Vec3<f64>) {
        if node > 0 {
            on[node - 1].add(&w.about(point - self.com_now(s, node - 1)));
        }
    }

    /// Everything but joints that acts on the bodies of `part`, about their centres of mass.
    pub(super) fn applied(
        &self,
        part: &Part,
        t: f64,
        q: &[f64],
        v: &[f64],
        s: &ModelScratch,
    ) -> Result<Vec<Wrench>, SystemError> {
        let mut on = vec![Wrench::default(); self.placed.bodies.len()];
        let zero = Vec3::zero();
        for &node in &part.nodes {
            on[node - 1].force += self.full.gravity.times(self.placed.bodies[node - 1].mass);
        }
        for &i in &part.springs {
            let (k, (na, nb, first)) = (&self.full.springs[i], self.spring_nodes[i]);
            let (ra, rb) = (self.full.arm(&k.a, &s.full), self.full.arm(&k.b, &s.full));
            let (xa, xb) = (&s.full.links[k.a.link], &s.full.links[k.b.link]);
            let gap = xb.centre + rb - xa.centre - ra + k.offset;
            // on the ground the anchor is part of the offset, but the point stays where it was
            let pa = if k.a.link == 0 { first } else { self.full.place(k.a.link, &s.full) + ra };
            let pb = pa + gap;
            let length = gap.norm();
            if length == 0.0 {
                continue;
            }
            let rate = xb.u + xb.w.cross(rb) - xa.u - xa.w.cross(ra);
            let tension = k.stiffness * (length - k.length) + k.damping * gap.dot(rate) / length;
            let pull = gap.times(tension / length);
            self.put(s, &mut on, na, &Wrench { moment: zero, force: pull }, pa);
            self.put(s, &mut on, nb, &Wrench { moment: zero, force: -pull }, pb);
        }
        for l in part.loads.iter().map(|&i| &self.loads[i]) {
            match l {
                Load::Force { node, link, at, .. } => {
                    let x = &s.full.links[*link];
                    let force = load::force_at(l, &x.rot.0, &self.placed.basis, &*self.functions, t, q, v)?;
                    self.put(
                        s,
                        &mut on,
                        *node,
                        &Wrench { moment: zero, force },
                        self.full.place(*link, &s.full) + x.rot.apply(*at),
                    );
                }
                Load::CutEffort { name, parent, child, push, at, value } => {
                    let e = value::scalar_at(value, &*self.functions, t, q, v, name)?;
                    let x = &s.full.links[child.1];
                    let point = self.full.place(child.1, &s.full) + x.rot.apply(*at);
                    let rp = s.full.links[parent.1].rot;
                    let w = match push {
                        Push::Moment(on_parent, on_child) => {
                            Wrench { moment: (rp.apply(*on_parent) + x.rot.apply(*on_child)).times(e), force: zero }
                        }
                        Push::Force(a) => Wrench { moment: zero, force: rp.apply(*a).times(e) },
                    };
                    self.put(s, &mut on, child.0, &w, point);
                    self.put(s, &mut on, parent.0, &w.times(-1.0), point);
                }
                Load::Torsion { .. } | Load::Effort { .. } => {} // these act along tree joints
            }
        }
        Ok(on)
    }

    /// Efforts of torsion springs and torques along tree velocities.
    pub(super) fn efforts(&self, t: f64, q: &[f64], v: &[f64]) -> Result<Vec<f64>, SystemError> {
        let mut e = vec![0.0; self.placed.nv];
        for l in &self.loads {
            match l {
                Load::Torsion { q: i, v: j, stiffness, damping, angle } => {
                    e[*j] -= stiffness * (q[*i] - angle) + damping * v[*j];
                }
                Load::Effort { name, v: j, value, .. } => {
                    e[*j] += value::scalar_at(value, &*self.functions, t, q, v, name)?;
                }
                _ => {}
            }
        }
        Ok(e)
    }
}
