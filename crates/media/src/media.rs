//! All media of a scene, and the questions transport asks of them.
//!
//! Media overlap freely and add up. Vacuum (no extinction, no emission) is kept in the list and costs nothing else.

use crate::gradient::{self, EndGradients};
use crate::hessian;
use crate::line::Line;
use crate::segment::depth;
use crate::{Density, Edges, Medium, MediumPoint, Region, Segment};
use glam::{DVec3, Vec3};
use tyndall_math::{Aabb, Jet, Ray};

/// The media of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Media {
    list: Vec<Medium>,
}

impl Media {
    /// Overlapping media add up; their order does not matter.
    pub fn new(list: Vec<Medium>) -> Self {
        Self { list }
    }

    /// The media, as given.
    pub fn list(&self) -> &[Medium] {
        &self.list
    }

    /// Whether light passes as through empty space: no medium, or vacuum alone.
    pub fn is_empty(&self) -> bool {
        self.list.iter().all(Medium::is_vacuum)
    }

    /// Whether any density is from voxels, so that optical depth takes a walk through these.
    pub fn has_grids(&self) -> bool {
        let mut densities = self.list.iter().map(Medium::density);
        densities.any(|density| matches!(density, Density::Grid(_)))
    }

    /// The media at point `p`.
    pub fn at(&self, p: Vec3) -> MediumPoint<'_> {
        let mut point = MediumPoint::empty(p);
        for medium in &self.list {
            if !medium.is_vacuum() && medium.region().contains(p) {
                point.add(medium);
            }
        }
        point
    }

    /// The media along `ray` from 0 to `t_max`, which may be infinite.
    pub fn segment(&self, ray: &Ray, t_max: f32) -> Segment<'_> {
        Segment::new(&self.list, &ray.into(), t_max, f32::INFINITY)
    }

    /// As [`Media::segment`], but it may end where its optical depth exceeds `enough` in every channel: in grids, what nobody asks for
    /// need not be walked through.
    pub fn segment_until(&self, ray: &Ray, t_max: f32, enough: f32) -> Segment<'_> {
        Segment::new(&self.list, &ray.into(), t_max, enough)
    }

    /// Optical depth along `ray` from 0 to `t_max`, which may be infinite, for each channel.
    ///
    /// τ = Σ σt ∫ ρ dt over the media, each exact. May be infinite, never NaN: a channel without
    /// extinction is 0 over any distance. Transmittance is exp(−τ).
    pub fn optical_depth(&self, ray: &Ray, t_max: f32) -> Vec3 {
        self.optical_depth_until(ray, t_max, f32::INFINITY)
    }

    /// As [`Media::optical_depth`], but where it exceeds `enough` in every channel it may be told too small, though not below that.
    pub fn optical_depth_until(&self, ray: &Ray, t_max: f32, enough: f32) -> Vec3 {
        let line = Line::from(ray);
        let mut tau = Vec3::ZERO;
        for medium in &self.list {
            if !medium.is_vacuum()
                && let Some((t0, t1)) = medium.region().clip_line(&line, t_max.into())
            {
                let enough = medium.column_of_depth(enough);
                let column = medium.density().column_until(&line, t0, t1, enough);
                tau += depth(medium.sigma_t(), column);
            }
        }
        tau
    }

    /// Optical depth between `a` and `b` with its gradients with respect to moving either point.
    ///
    /// Exact, with the motion of region boundaries along the segment; see [`EndGradients`]. Zero where the points coincide.
    #[inline]
    pub fn optical_depth_gradient(&self, a: Vec3, b: Vec3) -> EndGradients {
        if self.list.is_empty() {
            return EndGradients::default();
        }
        gradient::of_ends(&self.list, a.as_dvec3(), b.as_dvec3())
    }

    /// Optical depth along `ray` to `t_max`, which may be infinite, and its gradient for each channel when the origin moves
    /// while direction and length stay.
    ///
    /// Where a medium's column is infinite (or above 10²⁰ m), its share of the gradient is zero: transmittance is and stays 0.
    pub fn optical_depth_gradient_rigid(&self, ray: &Ray, t_max: f32) -> (Vec3, [Vec3; 3]) {
        gradient::of_translation(&self.list, &ray.into(), t_max.into())
    }

    /// Optical depth between `fixed` and `moving` for each channel, with gradient and Hessian when `moving` moves.
    ///
    /// Exact and in f64, for formulas that go on with [`Jet`]s. Zero where the points coincide to f32; elsewhere as
    /// [`Media::optical_depth_gradient`], and constant where a column is infinite or above 10²⁰ m. The Hessian has the
    /// motion and the curvature of region boundaries and the kinks of a height fog at its base and of a grid on the faces
    /// of its cells; where the line grazes those within a milliradian, it is bounded instead of exact. On the base all
    /// derivatives are those from above.
    pub fn optical_depth_jet(&self, fixed: DVec3, moving: DVec3) -> [Jet; 3] {
        hessian::of_end(&self.list, fixed, moving)
    }

    /// Optical depth from `origin` along the unit vector `direction` over `length`, which may be infinite, for each
    /// channel, with gradient and Hessian when the origin moves while direction and length stay.
    ///
    /// Exact and finite as [`Media::optical_depth_jet`]; only the depth itself may be infinite.
    pub fn optical_depth_jet_rigid(
        &self,
        origin: DVec3,
        direction: DVec3,
        length: f64,
    ) -> [Jet; 3] {
        hessian::of_translation(&self.list, Line { origin, direction }, length)
    }

    /// The edges of all boxes of medium, as seen from `x`: where an integral over directions finds second derivatives that
    /// [`Media::optical_depth_jet`] does not have. Those of the boxes around grids are not among them.
    pub fn edges(&self, x: Vec3) -> Edges<'_> {
        Edges::new(self.matter(), x.as_dvec3())
    }

    /// Whether rays from `p` can graze a ball of medium from outside. Across its limb the Hessian of optical depth grows like δ^(−3/2)
    /// with the angle δ, and has no integral over directions.
    pub fn has_limb_from(&self, p: Vec3) -> bool {
        self.matter()
            .map(Medium::region)
            .any(|region| matches!(region, Region::Sphere { .. }) && !region.contains(p))
    }

    /// Whether all scattering is isotropic.
    pub fn is_isotropic(&self) -> bool {
        self.list
            .iter()
            .all(|m| m.is_vacuum() || m.sigma_s() == Vec3::ZERO || m.phase().is_isotropic())
    }

    /// The largest absolute value of the Legendre moment `χ_l` of any medium that scatters; 0 without one.
    pub fn largest_moment(&self, l: usize) -> f32 {
        let scatters = |m: &&Medium| m.sigma_s() != Vec3::ZERO;
        let moments = self.matter().filter(scatters).map(|m| m.phase().moments(l));
        moments.fold(0.0, |largest, moment| largest.max(moment.abs()))
    }

    /// Whether any medium emits light.
    pub fn emits(&self) -> bool {
        self.matter().any(|m| m.emission() != Vec3::ZERO)
    }

    /// Distance in metres from `p` to the nearest point where a medium begins or ends; infinite where none does.
    pub fn distance_to_boundary(&self, p: Vec3) -> f32 {
        self.matter()
            .map(|m| m.distance_to_boundary(p))
            .fold(f32::INFINITY, f32::min)
    }

    /// The smallest box around all media, [`Aabb::EMPTY`] where there are none; `None` where a medium has no bounds.
    pub fn bounds(&self) -> Option<Aabb> {
        self.matter()
            .try_fold(Aabb::EMPTY, |all, m| Some(all.union(m.bounds()?)))
    }

    /// The media that light notices.
    fn matter(&self) -> impl Iterator<Item = &Medium> {
        self.list.iter().filter(|m| !m.is_vacuum())
    }
}
