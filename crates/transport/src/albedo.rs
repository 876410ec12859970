//! How much of even light a surface of glTF's model reflects, by direction: tables made once by quadrature.
//!
//! Fresnel's factor f0 + (f90 − f0) m⁵ is linear in f0 and f90, so that two numbers tell the albedo of a GGX lobe (the "split sum" of
//! Karis 2013, "Real Shading in Unreal Engine 4"), and one that of the base beneath it.

use crate::bsdf::{schlick, smith_root, smith_v, visible_normal};
use glam::Vec3;
use std::sync::OnceLock;
use tyndall_math::warp;

/// Nodes of an axis: cosines to the viewer, and roots of GGX widths, from 0 to 1.
const NODES: usize = 24;
/// Directions of a quadrature are this many squared.
const STEPS: u32 = 24;

/// What tables hold for one direction and width.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Albedo {
    /// Mean of m⁵ over the cosine's directions: what Fresnel's factor takes from the base.
    pub(crate) base: f32,
    /// Albedo of a lobe with f0 = 1 and f90 = 0, and with f0 = 0 and f90 = 1.
    pub(crate) lobe: [f32; 2],
}

impl Albedo {
    /// For a viewer at the cosine `cos_o` and a GGX width `alpha`; to about 0.003.
    pub(crate) fn of(cos_o: f32, alpha: f32) -> Self {
        static TABLE: OnceLock<Vec<Albedo>> = OnceLock::new();
        let table = TABLE.get_or_init(|| {
            let axis = |i: usize| i as f32 / (NODES - 1) as f32;
            let node = |i: usize| Self::by_quadrature(axis(i / NODES), axis(i % NODES));
            (0..NODES * NODES).map(node).collect()
        });
        let split = |x: f32| {
            let x = x.clamp(0.0, 1.0) * (NODES - 1) as f32;
            let low = (x as usize).min(NODES - 2);
            (low, x - low as f32)
        };
        let ((i, u), (j, v)) = (split(cos_o), split(alpha.sqrt()));
        let at = |i: usize, j: usize| table[i * NODES + j];
        let near = at(i, j).mixed(at(i, j + 1), v);
        near.mixed(at(i + 1, j).mixed(at(i + 1, j + 1), v), u)
    }

    fn mixed(self, other: Self, t: f32) -> Self {
        let mix = |a: f32, b: f32| a + (b - a) * t;
        let [p, q] = self.lobe;
        let [r, s] = other.lobe;
        Self {
            base: mix(self.base, other.base),
            lobe: [mix(p, r), mix(q, s)],
        }
    }

    fn by_quadrature(cos_o: f32, root_alpha: f32) -> Self {
        // Exactly edge-on nothing is reflected, but the limit is wanted; and no width is 0.
        let cos_o = cos_o.max(1e-3);
        let alpha = (root_alpha * root_alpha).max(1e-3);
        let w_o = Vec3::new((1.0 - cos_o * cos_o).max(0.0).sqrt(), 0.0, cos_o);
        let mut sum = Self::default();
        for k in 0..STEPS * STEPS {
            let u = [k % STEPS, k / STEPS].map(|i| (i as f32 + 0.5) / STEPS as f32);
            let h = (w_o + warp::cosine_hemisphere(u)).normalize_or_zero();
            sum.base += schlick(w_o.dot(h));
            let h = visible_normal(w_o, alpha, u);
            let w_i = h * (2.0 * w_o.dot(h)) - w_o;
            if w_i.z > 0.0 {
                // The lobe over the density of visible normals: G2 / G1.
                let g1 = 2.0 * cos_o / (cos_o + smith_root(cos_o, alpha));
                let g = 4.0 * cos_o * w_i.z * smith_v(cos_o, w_i.z, alpha) / g1;
                let m5 = schlick(w_o.dot(h));
                sum.lobe[0] += g * (1.0 - m5);
                sum.lobe[1] += g * m5;
            }
        }
        let n = (STEPS * STEPS) as f32;
        Self {
            base: sum.base / n,
            lobe: sum.lobe.map(|x| x / n),
        }
    }
}
