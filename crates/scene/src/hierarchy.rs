//! A bounding volume hierarchy over bare triangles: which of them a ray meets first, and whether it meets any.
//!
//! Joins `obvhs` (eight-wide, compressed boxes) to the watertight test of [`crate::watertight`]; what a triangle looks like is
//! left to [`crate::triangles`].

use crate::watertight::{ShearedRay, TriangleHit};
use glam::{DVec3, Vec3, Vec3A};
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::cwbvh::{CwBvh, bvh2_to_cwbvh::bvh2_to_cwbvh};
use obvhs::ploc::PlocBuilder;
use obvhs::ray::RayHit;
use tyndall_math::{Aabb, Ray};

/// Triangles under a hierarchy of boxes.
///
/// Inside, all lengths are multiplied by a power of two that brings the largest coordinate close to 2²⁰. That is exact,
/// and it makes the fixed smallest distance of `obvhs` (10⁻⁴) negligible whatever the size of the scene.
#[derive(Debug)]
pub struct Hierarchy {
    bvh: CwBvh,
    /// Scaled corners, in the order in which the hierarchy names them: neighbours in space are neighbours in memory.
    corners: Vec<[Vec3; 3]>,
    /// What the caller calls each of `corners`.
    triangle_of_slot: Vec<u32>,
    scale: f32,
    bounds: Aabb,
}

/// A triangle and where a ray meets it.
#[derive(Clone, Copy, Debug)]
pub struct Met {
    /// Index of the triangle, in the order given to [`Hierarchy::new`].
    pub triangle: u32,
    /// Distance in metres, and weights of the corners.
    pub hit: TriangleHit,
    /// The point, in metres; more accurate than the ray at the distance.
    pub position: Vec3,
    /// Unit normal of the side on which the corners wind counter-clockwise.
    pub front_normal: Vec3,
    /// Its longest side in metres, for needles up to 32 times as much (see [`SurfaceHit::size`](tyndall_transport::SurfaceHit)).
    pub size: f32,
}

impl Hierarchy {
    /// Builds over `n_triangles` triangles whose finite corners, in metres, `corners` tells.
    pub fn new(n_triangles: usize, corners: impl Fn(usize) -> [Vec3; 3]) -> Self {
        let bounds = (0..n_triangles)
            .flat_map(&corners)
            .fold(Aabb::EMPTY, Aabb::grow);
        let scale = scale_for(&bounds);
        let padding = box_padding(&bounds) * scale;
        let boxes: Vec<obvhs::aabb::Aabb> = (0..n_triangles)
            .map(|triangle| {
                let [a, b, c] = corners(triangle).map(|p| p * scale);
                let [below, above] = [0, 1].map(|side| padding * uneven(triangle, side));
                obvhs::aabb::Aabb::new(
                    Vec3A::from(a.min(b).min(c) - below),
                    Vec3A::from(a.max(b).max(c) + above),
                )
            })
            .collect();
        let mut bvh = build(&boxes);
        let triangle_of_slot = std::mem::take(&mut bvh.primitive_indices);
        Self {
            bvh,
            corners: triangle_of_slot
                .iter()
                .map(|&triangle| corners(triangle as usize).map(|p| p * scale))
                .collect(),
            triangle_of_slot,
            scale,
            bounds,
        }
    }

    /// The box around all triangles, in metres; empty where there are none.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Number of triangles.
    pub fn len(&self) -> usize {
        self.corners.len()
    }

    /// Whether there is no triangle at all.
    pub fn is_empty(&self) -> bool {
        self.corners.is_empty()
    }

    /// Memory held, in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.bvh.nodes.as_slice())
            + size_of_val(self.corners.as_slice())
            + size_of_val(self.triangle_of_slot.as_slice())
    }

    /// The nearest triangle before `t_max`, among those of which `counts` says so.
    ///
    /// A ray that is not finite meets nothing.
    pub fn nearest(
        &self,
        ray: &Ray,
        t_max: f32,
        counts: impl Fn(u32, &TriangleHit) -> bool,
    ) -> Option<Met> {
        let (traversal, sheared) = self.traversal(ray, t_max)?;
        let mut nearest = None;
        self.bvh.ray_traverse(
            traversal,
            &mut RayHit::none(),
            |traversal, slot| match sheared.intersect(&self.corners[slot], traversal.tmax) {
                Some(hit) if counts(self.triangle_of_slot[slot], &hit) => {
                    nearest = Some((slot, hit));
                    hit.t
                }
                _ => f32::INFINITY,
            },
        );
        let (slot, TriangleHit { t, barycentric }) = nearest?;
        let [a, b, c] = self.corners[slot];
        // Differences first: the sum of three weighted corners loses more far from the origin.
        let position = a + ((b - a) * barycentric.y + (c - a) * barycentric.z);
        let t = t / self.scale;
        Some(Met {
            triangle: self.triangle_of_slot[slot],
            hit: TriangleHit { t, barycentric },
            position: position / self.scale,
            front_normal: geometric_normal([a, b, c]),
            size: hit_size([a, b, c]) / self.scale,
        })
    }

    /// Whether any triangle of which `counts` says so stands before `t_max`.
    pub fn any(&self, ray: &Ray, t_max: f32, counts: impl Fn(u32, &TriangleHit) -> bool) -> bool {
        let Some((traversal, sheared)) = self.traversal(ray, t_max) else {
            return false;
        };
        // The name says what it returns: whether the ray missed.
        !self.bvh.ray_traverse_miss(traversal, |traversal, slot| {
            match sheared.intersect(&self.corners[slot], traversal.tmax) {
                Some(hit) if counts(self.triangle_of_slot[slot], &hit) => hit.t,
                _ => f32::INFINITY,
            }
        })
    }

    /// `ray` and `t_max` in the hierarchy's units; `None` where a number is not finite.
    fn traversal(&self, ray: &Ray, t_max: f32) -> Option<(obvhs::ray::Ray, ShearedRay)> {
        let scaled = Ray {
            origin: ray.origin * self.scale,
            direction: ray.direction,
        };
        if !scaled.origin.is_finite() || !scaled.direction.is_finite() {
            return None;
        }
        let traversal = obvhs::ray::Ray {
            origin: Vec3A::from(scaled.origin),
            direction: Vec3A::from(scaled.direction),
            inv_direction: Vec3A::from_array(scaled.direction.to_array().map(inverse)),
            tmin: 0.0,
            tmax: t_max * self.scale,
        };
        Some((traversal, ShearedRay::new(&scaled)))
    }
}

/// The unit normal of the side on which `corners` wind counter-clockwise.
///
/// In f64, where the cross product of f32 edges keeps its direction for needles too; +Y for a triangle without area.
pub(crate) fn geometric_normal(corners: [Vec3; 3]) -> Vec3 {
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    (b - a).cross(c - a).normalize_or(DVec3::Y).as_vec3()
}

/// What rounding of a hit is in proportion to: the longest side of a triangle, for a needle half as many times as the side is longer
/// than the triangle is wide. No more than 32 times: a step off the surface must stay far below the needle's own width.
fn hit_size(corners: [Vec3; 3]) -> f32 {
    const SLENDEREST: f32 = 32.0;
    let [a, b, c] = corners;
    let longest = (b - a)
        .length_squared()
        .max((c - b).length_squared())
        .max((a - c).length_squared());
    let double_area = (b - a).cross(c - a).length().max(f32::MIN_POSITIVE);
    longest.sqrt() * (0.5 * longest / double_area).clamp(1.0, SLENDEREST)
}

/// The three steps of `obvhs`'s `build_cwbvh` with its `medium_build` preset, without its debug check, whose tolerance is an
/// absolute 10⁻⁵ and fails for large coordinates. Slower presets split triangles, which would then stand in several leaves.
fn build(boxes: &[obvhs::aabb::Aabb]) -> CwBvh {
    let preset = obvhs::BvhBuildParams::medium_build();
    let mut binary = PlocBuilder::with_capacity(boxes.len()).build(
        preset.ploc_search_distance,
        boxes,
        (0..boxes.len() as u32).collect(),
        preset.sort_precision,
        preset.search_depth_threshold,
    );
    ReinsertionOptimizer::default().run(&mut binary, preset.reinsertion_batch_ratio, None);
    /// Most triangles that a leaf of a `CwBvh` can hold.
    const LEAF: u32 = 3;
    bvh2_to_cwbvh(
        &binary,
        preset.max_prims_per_leaf.clamp(1, LEAF),
        true,
        false,
    )
}

/// The power of two that brings the largest coordinate of `bounds` to between 2¹⁹ and 2²⁰.
fn scale_for(bounds: &Aabb) -> f32 {
    let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
    if bounds.is_empty() || largest == 0.0 {
        return 1.0;
    }
    // Exponents near the ends of f32's range would leave no room for products.
    let exponent = (19.0 - largest.log2().floor()).clamp(-100.0, 100.0);
    exponent.exp2()
}

/// How far boxes reach beyond their triangles at least, in metres, so that rounding in the box test cannot lose a hit.
///
/// The box test rounds three times, each by 2⁻²⁴ of the distance between box and origin. 2⁻²¹ of the scene's diagonal
/// covers origins within a few diagonals; one unit in the last place of the largest coordinate makes the sum take effect.
fn box_padding(bounds: &Aabb) -> f32 {
    if bounds.is_empty() {
        return 0.0;
    }
    let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
    bounds.diagonal() * 2f32.powi(-21) + largest * f32::EPSILON
}

/// Factors between 1 and 4, different for every triangle and `side` of its box.
///
/// The builder merges neighbours that agree on being each other's best. Among equal boxes (a regular grid, copies of one
/// triangle) only one pair a round would agree: quadratic time, and a tree too deep for the traversal's stack.
fn uneven(triangle: usize, side: u32) -> Vec3 {
    // A 32-bit hash (Wellons 2018, "lowbias32"), then three fields of ten bits.
    let mut h = (triangle as u32).wrapping_mul(2).wrapping_add(side);
    h ^= h >> 16;
    h = h.wrapping_mul(0x7feb_352d);
    h ^= h >> 15;
    h = h.wrapping_mul(0x846c_a68b);
    h ^= h >> 16;
    let field = |shift: u32| (h >> shift & 1023) as f32 / 1024.0;
    Vec3::splat(1.0) + 3.0 * Vec3::new(field(0), field(10), field(20))
}

/// 1/x, or a huge finite number with the sign that `obvhs` gives the direction where x vanishes.
///
/// An infinite inverse would make 0 · ∞ = NaN in the box test; its own stand-in, 1/`f32::EPSILON`, is too small and loses
/// hits of axis-aligned rays. `obvhs` takes −0 for a positive direction (x < 0 decides), so the sign of zero is dropped.
fn inverse(x: f32) -> f32 {
    const HUGE: f32 = 1e30;
    if x.abs() >= 1.0 / HUGE {
        1.0 / x
    } else if x < 0.0 {
        -HUGE
    } else {
        HUGE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Levels of nodes below and with `node`.
    fn depth(bvh: &CwBvh, node: usize) -> usize {
        let node = &bvh.nodes[node];
        let inner = (0..8).filter(|&child| !node.is_child_empty(child) && !node.is_leaf(child));
        1 + inner
            .map(|child| depth(bvh, node.child_node_index(child) as usize))
            .max()
            .unwrap_or(0)
    }

    #[test]
    fn equal_boxes_and_nested_sizes_make_trees_that_fit_the_traversals_stack() {
        let unit = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let copies = Hierarchy::new(200_000, |_| unit);
        let far_copies = Hierarchy::new(20_000, |_| unit.map(|p| p + 1e5));
        let strip = Hierarchy::new(100_000, |i| unit.map(|p| p + Vec3::X * i as f32));
        let nested = Hierarchy::new(100, |i| unit.map(|p| (p + Vec3::X) * 0.5f32.powi(i as i32)));
        for (name, hierarchy, most) in [
            ("copies", copies, 26),
            ("far copies", far_copies, 20),
            ("strip", strip, 16),
            ("nested", nested, 10),
        ] {
            // The stack of obvhs holds 32 levels; the bounds leave some room over what was measured.
            let levels = depth(&hierarchy.bvh, 0);
            assert!(levels <= most, "{name}: {levels} levels");
        }
    }

    #[test]
    fn scaling_brings_any_scene_near_two_to_the_twentieth() {
        for size in [1e-20f32, 1e-4, 1.0, 3.0, 1e6, 1e20] {
            let bounds = Aabb::from_corners(Vec3::ZERO, Vec3::splat(size));
            let scaled = size * scale_for(&bounds);
            assert!(
                (524_288.0..1_048_576.0).contains(&scaled),
                "{size}: {scaled}"
            );
        }
        assert_eq!(scale_for(&Aabb::EMPTY), 1.0);
    }

    #[test]
    fn inverses_are_finite_and_agree_with_the_sign_that_the_box_test_sees() {
        assert_eq!(inverse(0.5), 2.0);
        assert_eq!(inverse(-1e-20), -1e20);
        for (x, sign) in [(0.0, 1.0), (-0.0, 1.0), (1e-38, 1.0), (-1e-38, -1.0)] {
            assert_eq!(inverse(x), sign * 1e30);
        }
    }
}
