//! How much medium there is at a point: a dimensionless factor on all coefficients of a medium.
//!
//! A new kind of density is a variant of [`Density`] and its restriction to a ray, a variant of [`Profile`]:
//! value, column, inverse column and moments of the derivatives. All else follows.

pub mod grid;
mod height;

use crate::line::Line;
use glam::{DMat3, DVec3, Vec3};
use grid::{Grid, GridProfile};
use height::HeightProfile;
use std::sync::Arc;
use tyndall_math::{Jet, Ray};

/// A density field; multiplies a medium's extinction, scattering and emission.
#[derive(Clone, Debug, PartialEq)]
pub enum Density {
    /// The same density everywhere; finite and not negative.
    Constant(f32),
    /// Fog that thins out upwards: `exp(−(y − base)/scale_height)` above `base`, 1 below it.
    Height {
        /// Height in metres up to which the density is 1.
        base: f32,
        /// Height in metres over which the density falls to 1/e; at least [`MIN_SCALE_HEIGHT`](crate::MIN_SCALE_HEIGHT).
        scale_height: f32,
    },
    /// From voxels.
    Grid(Arc<Grid>),
}

impl Default for Density {
    fn default() -> Self {
        Self::Constant(1.0)
    }
}

impl Density {
    /// The density at `p`.
    pub fn value(&self, p: Vec3) -> f32 {
        match *self {
            Self::Constant(density) => density,
            Self::Height { base, scale_height } => (-((p.y - base) / scale_height).max(0.0)).exp(),
            Self::Grid(ref grid) => grid.value(p),
        }
    }

    /// The gradient of the density at `p`, per metre; on the kink at a fog's base that from above, on those of a grid that from the side of
    /// larger coordinates.
    pub fn gradient(&self, p: Vec3) -> Vec3 {
        match *self {
            Self::Height { base, scale_height } if p.y >= base => {
                Vec3::new(0.0, -self.value(p) / scale_height, 0.0)
            }
            Self::Constant(_) | Self::Height { .. } => Vec3::ZERO,
            Self::Grid(ref grid) => grid.gradient(p),
        }
    }

    /// The density at `p` with its derivatives, in f64; on the kink at a fog's base those from above.
    pub(crate) fn jet(&self, p: DVec3) -> Jet {
        match *self {
            Self::Height { base, scale_height } if p.y >= f64::from(base) => {
                let per_metre = 1.0 / f64::from(scale_height);
                Jet::linear((f64::from(base) - p.y) * per_metre, -per_metre * DVec3::Y).exp()
            }
            Self::Height { .. } => 1.0.into(),
            Self::Constant(density) => f64::from(density).into(),
            Self::Grid(ref grid) => grid.jet(p),
        }
    }

    /// Density integrated along `ray` from `t0` to `t1 ≥ t0`, in metres; `t1` and the result may be infinite.
    ///
    /// Exact, see [`Media::optical_depth`](crate::Media::optical_depth); 0 where the density is 0, however long the ray.
    pub fn column(&self, ray: &Ray, t0: f32, t1: f32) -> f32 {
        let line = ray.into();
        self.column_on(&line, t0.into(), t1.into()) as f32
    }

    /// The distance t in [`t0`, `t1`] at which the column from `t0` reaches `column`; `None` where all of it is less.
    ///
    /// The exact inverse of [`Density::column`]. A column of 0 or less is reached at `t0`.
    pub fn invert_column(&self, ray: &Ray, t0: f32, t1: f32, column: f32) -> Option<f32> {
        let line = ray.into();
        if column <= 0.0 {
            return Some(t0);
        }
        let (begin, end) = self.clip(&line, t0.into(), t1.into())?;
        let profile = self.along(&line);
        let t = profile.invert(begin, column.into());
        if t <= f64::from(t1) {
            // An infinite distance is never reached, not even by an infinite ray.
            return (t <= f64::from(f32::MAX)).then_some(t as f32);
        }
        // The column of the whole way, rounded to f32, may lie above what f64 can reach by half a rounding.
        (t1.is_finite() && column <= profile.column(begin, end) as f32).then_some(t1)
    }

    /// The part of the stretch from `t0` to `t1` of a line on which there may be more than nothing; `None` where there is none.
    #[inline]
    pub(crate) fn clip(&self, line: &Line, t0: f64, t1: f64) -> Option<(f64, f64)> {
        match self {
            Self::Grid(grid) => grid.clip(line, t0, t1),
            Self::Constant(_) | Self::Height { .. } => Some((t0, t1)),
        }
    }

    /// The largest density anywhere.
    #[inline]
    pub fn max(&self) -> f32 {
        match self {
            Self::Constant(density) => *density,
            Self::Height { .. } => 1.0,
            Self::Grid(grid) => grid.max(),
        }
    }

    /// ∫ density dt along `line` from `t0` to `t1 ≥ t0`.
    #[inline]
    pub(crate) fn column_on(&self, line: &Line, t0: f64, t1: f64) -> f64 {
        self.column_until(line, t0, t1, f64::INFINITY)
    }

    /// ∫ density dt along `line` from `t0` to `t1 ≥ t0`; where it exceeds `enough`, perhaps only a part of it that does, too.
    #[inline]
    pub(crate) fn column_until(&self, line: &Line, t0: f64, t1: f64, enough: f64) -> f64 {
        match *self {
            // Never 0 · ∞.
            Self::Constant(0.0) => 0.0,
            Self::Constant(density) => f64::from(density) * (t1 - t0),
            Self::Height { base, scale_height } => {
                HeightProfile::new(base, scale_height, line).column(t0, t1)
            }
            Self::Grid(ref grid) => grid.column_until(line, t0, t1, enough),
        }
    }

    /// This density restricted to a ray.
    #[inline]
    pub(crate) fn along(&self, line: &Line) -> Profile<'_> {
        match *self {
            Self::Constant(density) => Profile::Constant(density.into()),
            Self::Height { base, scale_height } => {
                Profile::Height(HeightProfile::new(base, scale_height, line))
            }
            Self::Grid(ref grid) => Profile::Grid(Box::new(GridProfile::new(grid, line))),
        }
    }
}

/// A density as a function of the distance along one ray.
#[derive(Clone, Debug)]
pub(crate) enum Profile<'a> {
    Constant(f64),
    Height(HeightProfile),
    /// Boxed, so that rays through other media carry no more than before.
    Grid(Box<GridProfile<'a>>),
}

impl Profile<'_> {
    /// Prepares for many questions about the distances from `t0` to `t1`, or to a place behind that where the column is `enough`. Tells
    /// where that is.
    #[inline]
    pub(crate) fn prepare(&mut self, t0: f64, t1: f64, enough: f64) -> f64 {
        match self {
            Self::Grid(grid) => grid.tabulate(t0, t1, enough),
            Self::Constant(_) | Self::Height(_) => t1,
        }
    }

    /// The density at distance `t`.
    #[inline]
    pub(crate) fn value(&self, t: f64) -> f64 {
        match self {
            Self::Constant(density) => *density,
            Self::Height(height) => height.value(t),
            Self::Grid(grid) => grid.value(t),
        }
    }

    /// ∫ density dt from `t0` to `t1 ≥ t0`.
    #[inline]
    pub(crate) fn column(&self, t0: f64, t1: f64) -> f64 {
        match self {
            // Never 0 · ∞.
            Self::Constant(0.0) => 0.0,
            Self::Constant(density) => density * (t1 - t0),
            Self::Height(height) => height.column(t0, t1),
            Self::Grid(grid) => grid.column(t0, t1),
        }
    }

    /// The smallest t ≥ `t0` at which the column from `t0` is `column`; infinite where it is never reached.
    #[inline]
    pub(crate) fn invert(&self, t0: f64, column: f64) -> f64 {
        if column <= 0.0 {
            return t0;
        }
        match self {
            Self::Constant(density) => t0 + column / density,
            Self::Height(height) => height.invert(t0, column),
            Self::Grid(grid) => grid.invert(t0, column),
        }
    }

    /// ∫ ∇density dt and ∫ t ∇density dt from `t0` to `t1`; the first also for infinite `t1` where the column is finite.
    pub(crate) fn gradient_moments(&self, t0: f64, t1: f64) -> [DVec3; 2] {
        match self {
            Self::Constant(_) => [DVec3::ZERO; 2],
            Self::Height(height) => height.gradient_moments(t0, t1).map(|m| DVec3::Y * m),
            Self::Grid(grid) => grid.gradient_moments(t0, t1),
        }
    }

    /// ∇density at distance `t`.
    pub(crate) fn gradient(&self, t: f64) -> DVec3 {
        match self {
            Self::Constant(_) => DVec3::ZERO,
            Self::Height(height) => DVec3::Y * height.vertical_gradient(t),
            Self::Grid(grid) => grid.gradient(t),
        }
    }

    /// ∫ tʲ Hdensity dt from `t0` to `t1` for j = 0, 1, 2; for infinite `t1` as [`Profile::gradient_moments`].
    pub(crate) fn hessian_moments(&self, t0: f64, t1: f64) -> [DMat3; 3] {
        match self {
            Self::Constant(_) => [DMat3::ZERO; 3],
            Self::Height(height) => height
                .hessian_moments(t0, t1)
                .map(|m| DMat3::from_diagonal(DVec3::Y * m)),
            Self::Grid(grid) => grid.hessian_moments(t0, t1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const INF: f32 = f32::INFINITY;
    const FOG: Density = Density::Height {
        base: 1.0,
        scale_height: 2.0,
    };

    fn ray(height: f32, direction: Vec3) -> Ray {
        Ray::new(Vec3::new(3.0, height, -5.0), direction)
    }

    /// Equal to `tolerance` relative to the larger, or the same infinity.
    fn assert_near(found: f32, expected: f64, tolerance: f64) {
        let scale = f64::from(found).abs().max(expected.abs());
        assert!(
            f64::from(found) == expected
                || (f64::from(found) - expected).abs() <= tolerance * scale,
            "{found} instead of {expected}"
        );
    }

    /// The integral of the density by composite Simpson, split at the base, in f64.
    fn quadrature(fog: &Density, ray: &Ray, t1: f32) -> f64 {
        let profile = fog.along(&ray.into());
        let Density::Height { base, .. } = *fog else {
            return profile.value(0.0) * f64::from(t1);
        };
        let base_at = (f64::from(base) - f64::from(ray.origin.y)) / f64::from(ray.direction.y);
        let middle = if base_at.is_finite() {
            base_at.clamp(0.0, t1.into())
        } else {
            0.0
        };
        let simpson = |a: f64, b: f64| {
            let n = 2000;
            let h = (b - a) / f64::from(n);
            let inner: f64 = (1..n)
                .map(|i| f64::from(2 + 2 * (i % 2)) * profile.value(a + f64::from(i) * h))
                .sum();
            (profile.value(a) + inner + profile.value(b)) * h / 3.0
        };
        simpson(0.0, middle) + simpson(middle, t1.into())
    }

    #[test]
    fn columns_of_level_vertical_and_endless_rays_are_those_of_the_textbook() {
        let half = (-0.5_f64).exp();
        let rows = [
            // (height, direction, distance, column)
            (2.0, Vec3::X, 10.0, 10.0 * half),
            (2.0, Vec3::X, INF, f64::INFINITY),
            (0.0, Vec3::X, 10.0, 10.0),
            (1.0, Vec3::Z, 10.0, 10.0),
            (2.0, Vec3::Y, INF, 2.0 * half),
            (1.0, Vec3::Y, INF, 2.0),
            (-4.0, Vec3::Y, INF, 7.0),
            (-4.0, Vec3::Y, 3.0, 3.0),
            (2.0, Vec3::NEG_Y, 1.0, 2.0 * (1.0 - half)),
            (2.0, Vec3::NEG_Y, 5.0, 2.0 * (1.0 - half) + 4.0),
            (2.0, Vec3::NEG_Y, INF, f64::INFINITY),
            (-4.0, Vec3::NEG_Y, 3.0, 3.0),
            // A plane ten thousand scale heights up: nothing above, all of the layer below, no overflow.
            (20_001.0, Vec3::Y, INF, 0.0),
            (20_001.0, Vec3::X, INF, 0.0),
            (20_001.0, Vec3::NEG_Y, 20_000.0, 2.0),
            (20_001.0, Vec3::NEG_Y, 20_010.0, 12.0),
        ];
        for (height, direction, t1, column) in rows {
            let ray = ray(height, direction);
            assert_near(FOG.column(&ray, 0.0, t1), column, 1e-6);
        }
    }

    #[test]
    fn nearly_level_rays_tend_to_the_level_one() {
        for slope in [0.0, 1e-30, 1e-20, 1e-10, 1e-8, 1e-6, -1e-30, -1e-8, -1e-6] {
            for height in [0.5, 1.0, 2.0, 9.0] {
                let ray = ray(height, Vec3::new(1.0, slope, 0.0));
                let level = f64::from(FOG.value(ray.origin));
                // The height changes by at most 1e-4 m, the density by half of that.
                assert_near(FOG.column(&ray, 0.0, 100.0), 100.0 * level, 1e-4);
                let back = FOG.invert_column(&ray, 0.0, 200.0, 100.0 * level as f32);
                assert_near(back.unwrap_or(f32::NAN), 100.0, 1e-4);
            }
        }
    }

    #[test]
    fn no_density_is_no_column_over_any_distance() {
        let vacuum = Density::Constant(0.0);
        let ray = ray(0.0, Vec3::X);
        assert_eq!(vacuum.column(&ray, 0.0, INF), 0.0);
        assert_eq!(vacuum.invert_column(&ray, 0.0, INF, 1.0), None);
        assert_eq!(vacuum.invert_column(&ray, 2.0, INF, 0.0), Some(2.0));
        assert_eq!(Density::Constant(0.5).column(&ray, 0.0, INF), INF);
        assert_eq!(
            Density::Constant(0.5).invert_column(&ray, 1.0, INF, 2.0),
            Some(5.0)
        );
    }

    #[test]
    fn columns_beyond_the_end_are_not_reached_and_the_whole_column_is() {
        for direction in [Vec3::X, Vec3::Y, Vec3::NEG_Y, Vec3::new(0.6, 0.8, 0.0)] {
            for height in [-3.0, 1.0, 2.5, 40.0] {
                let ray = ray(height, direction);
                let whole = FOG.column(&ray, 1.0, 6.0);
                assert_near(
                    FOG.invert_column(&ray, 1.0, 6.0, whole).unwrap_or(f32::NAN),
                    6.0,
                    1e-5,
                );
                assert_eq!(FOG.invert_column(&ray, 1.0, 6.0, whole * 1.00001), None);
            }
        }
        assert_eq!(FOG.invert_column(&ray(1.0, Vec3::Y), 0.0, INF, 2.1), None);
    }

    fn any_direction() -> impl Strategy<Value = Vec3> {
        // Level rays and steep ones, evenly in the logarithm of the slope.
        (prop::bool::ANY, -9.0f32..0.0, 0.0f32..6.3).prop_map(|(up, log, phi)| {
            let y = if up {
                10f32.powf(log)
            } else {
                -(10f32.powf(log))
            };
            let r = (1.0 - y * y).max(0.0).sqrt();
            Vec3::new(r * phi.cos(), y, r * phi.sin()).normalize()
        })
    }

    proptest! {
        #[test]
        fn the_column_is_the_integral_of_the_density(
            base in -3.0f32..3.0, log_scale in -1.0f32..3.0, height in -5.0f32..5.0, t1 in 0.0f32..8.0,
            direction in any_direction()
        ) {
            let fog = Density::Height { base, scale_height: 10f32.powf(log_scale) };
            let ray = ray(height, direction);
            // Simpson's rule: 80 scale heights in 2000 steps, (0.04)⁴/180 relative; and f32 for the result.
            assert_near(fog.column(&ray, 0.0, t1), quadrature(&fog, &ray, t1), 3e-7);
        }

        #[test]
        fn inverting_gives_back_the_column(
            base in -3.0f32..3.0, log_scale in -1.0f32..3.0, height in -5.0f32..50.0, t0 in 0.0f32..5.0,
            direction in any_direction(), log_column in -4.0f32..3.0
        ) {
            let fog = Density::Height { base, scale_height: 10f32.powf(log_scale) };
            let ray = ray(height, direction);
            let column = 10f32.powf(log_column);
            match fog.invert_column(&ray, t0, INF, column) {
                Some(t) => {
                    prop_assert!(t >= t0);
                    // t is rounded to f32, which moves the column by the density times that rounding.
                    let rounding = f64::from(f32::EPSILON * t) * f64::from(fog.value(ray.at(t)).max(fog.value(ray.at(t0))));
                    let back = fog.along(&(&ray).into()).column(t0.into(), t.into());
                    prop_assert!((back - f64::from(column)).abs() <= 1e-6 * f64::from(column) + rounding, "{back} instead of {column}");
                }
                None => prop_assert!(fog.column(&ray, t0, INF) <= column * 1.000_001 || fog.column(&ray, t0, 1e38) < column),
            }
        }

        #[test]
        fn the_gradient_is_the_slope_of_the_value(height in -5.0f32..9.0) {
            let p = Vec3::new(0.0, height, 0.0);
            let h = 1e-2;
            prop_assume!((height - 1.0).abs() > 2.0 * h);
            let slope = (FOG.value(p + h * Vec3::Y) - FOG.value(p - h * Vec3::Y)) / (2.0 * h);
            // f32 rounding over the step.
            prop_assert!((FOG.gradient(p) - slope * Vec3::Y).length() < 2e-5);
        }
    }
}
