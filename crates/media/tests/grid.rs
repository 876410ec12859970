//! Density from voxels: exact values, closed forms, differences, and what holds for any grid.

#![allow(clippy::unwrap_used, reason = "tests")]

mod trilinear_benchmark;

use glam::{DAffine3, DMat3, DVec3, IVec3, Vec3};
use proptest::prelude::*;
use std::sync::Arc;
use trilinear_benchmark::{ROWS, SPACING, sample};
use tyndall_math::{Jet, Ray};
use tyndall_media::grid::{BRICK_VOXELS, Grid, GridEdge, GridError, Voxels, VoxelsBuilder};
use tyndall_media::{Density, Media, Medium, MediumParams, Region};

const LIMIT: u64 = 1 << 28;

/// Voxels from a function of their coordinates, in the bricks between two corners.
fn voxels(
    background: f32,
    [low, high]: [[i32; 3]; 2],
    value: impl Fn(IVec3) -> f32,
) -> Arc<Voxels> {
    let (low, high) = (IVec3::from(low), IVec3::from(high));
    let mut builder = VoxelsBuilder::new(background, [low, high], 0, LIMIT).unwrap();
    let [first, last]: [IVec3; 2] = [low >> 3, high >> 3];
    for x in first.x..=last.x {
        for y in first.y..=last.y {
            for z in first.z..=last.z {
                let min = IVec3::new(x, y, z) * 8;
                let mut brick = [background; BRICK_VOXELS];
                for (i, voxel) in (0..).zip(&mut brick) {
                    let p = min + (IVec3::new(i >> 6, i >> 3, i) & 7);
                    if p.cmpge(low).all() && p.cmple(high).all() {
                        *voxel = value(p);
                    }
                }
                builder.set_brick(min, &brick);
            }
        }
    }
    Arc::new(builder.finish().unwrap().voxels)
}

fn medium(region: Region, grid: Grid) -> Media {
    let params = MediumParams {
        region,
        density: Density::Grid(Arc::new(grid)),
        ..MediumParams::new(Vec3::ONE, Vec3::ONE)
    };
    Media::new(vec![Medium::new(params).unwrap()])
}

fn media(voxels: Arc<Voxels>, world_from_index: DAffine3, edge: GridEdge) -> Media {
    medium(
        Region::Everywhere,
        Grid::new(voxels, world_from_index, 1.0, edge).unwrap(),
    )
}

/// The benchmark's grid of 5 × 4 × 3 samples, (0.5, 0.75, 1) apart.
fn benchmark(shift: [i32; 3]) -> Arc<Voxels> {
    let shift = IVec3::from(shift);
    let bounds = [shift, shift + IVec3::new(4, 3, 2)].map(|c| c.to_array());
    voxels(0.0, bounds, move |p| {
        let [i, j, k] = (p - shift).to_array();
        sample(i, j, k) as f32
    })
}

#[test]
fn the_trilinear_benchmark_is_met_to_the_last_digits_wherever_bricks_lie() {
    // Rotated, sheared and mirrored about the benchmark's coordinates: gradients turn with it.
    let turned = DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 1.0)
        * DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
    for shift in [[0, 0, 0], [6, -2, 7], [-509, 510, -1]] {
        for rotation in [DMat3::IDENTITY, turned] {
            let offset = IVec3::from(shift).as_dvec3() * SPACING;
            let map = DAffine3 {
                matrix3: rotation * DMat3::from_diagonal(SPACING),
                translation: rotation * -offset,
            };
            let media = media(benchmark(shift), map, GridEdge::Background);
            for (a, b, tau, gradient) in ROWS {
                let found = media.optical_depth_jet(rotation * a, rotation * b)[1];
                let gradient = rotation * DVec3::from(gradient);
                // Rounding of f64, of coordinates up to 510 too.
                assert!((found.value / tau - 1.0).abs() < 1e-12, "{shift:?}");
                assert!(
                    (found.gradient - gradient).length() < 1e-11 * gradient.length(),
                    "{shift:?}: {} {gradient}",
                    found.gradient
                );
            }
        }
    }
}

/// Voxels of value 2 at the centres of n³ cells of a cube of side 1, clamped at its faces, as Mitsuba has them.
fn cube(n: [i32; 3]) -> (Arc<Voxels>, DAffine3, GridEdge) {
    let size = IVec3::from(n);
    let voxels = voxels(0.0, [[0; 3], (size + 1).to_array()], |_| 2.0);
    let map = DAffine3 {
        matrix3: DMat3::from_diagonal(size.as_dvec3().recip()),
        translation: -0.5 / size.as_dvec3(),
    };
    let faces = [DVec3::splat(0.5), size.as_dvec3() + 0.5];
    (voxels, map, GridEdge::Box(faces))
}

#[test]
fn a_constant_grid_is_the_homogeneous_box_rotated_and_mirrored_too() {
    let homogeneous = Media::new(vec![
        Medium::new(MediumParams {
            region: Region::Box {
                min: Vec3::ZERO,
                max: Vec3::ONE,
            },
            density: Density::Constant(2.0),
            ..MediumParams::new(Vec3::ONE, Vec3::ONE)
        })
        .unwrap(),
    ]);
    let ends = [
        (DVec3::new(0.1, 0.2, 0.3), DVec3::new(0.9, 0.6, 0.4)),
        (DVec3::new(-0.5, 0.3, 0.2), DVec3::new(0.4, 0.6, 0.55)),
        (DVec3::new(-0.5, -0.3, 0.1), DVec3::new(1.7, 1.6, 1.2)),
        (DVec3::new(2.0, 0.3, 0.7), DVec3::new(-2.0, 0.3, 0.7)),
        (DVec3::new(2.0, 3.0, 0.7), DVec3::new(-2.0, 3.0, 0.7)),
    ];
    let turned = DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.7)
        * DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0));
    for n in [[1, 1, 1], [2, 2, 2], [1, 9, 4], [33, 20, 8]] {
        for rotation in [DMat3::IDENTITY, turned] {
            let (voxels, map, edge) = cube(n);
            let grid = media(voxels, DAffine3::from_mat3(rotation) * map, edge);
            for (a, b) in ends {
                let [expected, ..] = homogeneous.optical_depth_jet(a, b);
                let [found, ..] = grid.optical_depth_jet(rotation * a, rotation * b);
                let gradient = rotation * expected.gradient;
                let hessian = rotation * expected.hessian * rotation.transpose();
                let off = hessian - found.hessian;
                // Rounding of f64 in index coordinates, divided by the cosine at the faces.
                assert!((found.value - expected.value).abs() < 1e-12, "{n:?}");
                assert!((found.gradient - gradient).length() < 1e-11, "{n:?}");
                assert!(
                    off.to_cols_array().iter().all(|x| x.abs() < 1e-9),
                    "{n:?} {a} {b}: {off}"
                );
                let p = (rotation * a).as_vec3();
                let expected = homogeneous.at(a.as_vec3()).sigma_t;
                assert_eq!(grid.at(p).sigma_t, expected);
            }
        }
    }
}

#[test]
fn a_box_around_a_grid_cuts_it_with_the_right_derivatives() {
    // Half of a constant cube, cut by a region, is a smaller homogeneous box.
    let (voxels, map, edge) = cube([8, 8, 8]);
    let region = |min: [f32; 3], max: [f32; 3]| Region::Box {
        min: min.into(),
        max: max.into(),
    };
    let grid = Grid::new(voxels, map, 0.5, edge).unwrap();
    let cut = medium(region([0.5, -1.0, -1.0], [3.0, 0.75, 3.0]), grid);
    let same = Media::new(vec![
        Medium::new(MediumParams {
            region: region([0.5, 0.0, 0.0], [1.0, 0.75, 1.0]),
            ..MediumParams::new(Vec3::ONE, Vec3::ONE)
        })
        .unwrap(),
    ]);
    assert_eq!(cut.bounds(), same.bounds());
    for (a, b) in [
        (DVec3::new(-1.0, 0.2, 0.3), DVec3::new(2.0, 0.6, 0.7)),
        (DVec3::new(0.7, -1.0, 0.3), DVec3::new(0.8, 2.0, 0.7)),
        (DVec3::new(0.7, 0.1, 0.3), DVec3::new(0.8, 0.4, -5.0)),
    ] {
        let ([found, ..], [expected, ..]) =
            (cut.optical_depth_jet(a, b), same.optical_depth_jet(a, b));
        assert!((found.value - expected.value).abs() < 1e-12);
        assert!((found.gradient - expected.gradient).length() < 1e-11);
    }
}

#[test]
fn a_background_that_is_something_fills_space() {
    let grid = media(
        voxels(0.25, [[0; 3], [7; 3]], |_| 1.0),
        DAffine3::IDENTITY,
        GridEdge::Background,
    );
    let ray = Ray::new(Vec3::new(-100.0, 3.0, 3.0), Vec3::X);
    // 7 m of density 1, two metres in which it falls to 0.25, and the rest of 200 m.
    let expected = 7.0 + 2.0 * 0.625 + 191.0 * 0.25;
    let tau = grid.optical_depth(&ray, 200.0).x;
    assert!((tau / expected - 1.0).abs() < 1e-6, "{tau}");
    assert_eq!(grid.optical_depth(&ray, f32::INFINITY).x, f32::INFINITY);
    let beside = Ray::new(Vec3::new(-100.0, 600.0, 3.0), Vec3::X);
    assert!((grid.optical_depth(&beside, 200.0).x / 50.0 - 1.0).abs() < 1e-6);
    assert_eq!(grid.bounds(), None);
    let t = grid.segment(&beside, f32::INFINITY).distance_at(0, 2500.0);
    assert!((t.unwrap() / 10_000.0 - 1.0).abs() < 1e-6);
    let t = grid.segment(&ray, f32::INFINITY).distance_at(0, 2500.0);
    assert!((grid.optical_depth(&ray, t.unwrap()).x / 2500.0 - 1.0).abs() < 1e-6);
    assert_eq!(grid.at(Vec3::splat(1e20)).sigma_t.x, 0.25);
}

#[test]
fn a_grid_of_zeros_is_vacuum_and_one_bright_voxel_is_not() {
    let empty = media(
        voxels(0.0, [[0; 3], [7; 3]], |_| 0.0),
        DAffine3::IDENTITY,
        GridEdge::Background,
    );
    let ray = Ray::new(Vec3::new(3.0, 3.0, -9.0), Vec3::Z);
    assert!(empty.is_empty());
    assert!(empty.segment(&ray, f32::INFINITY).is_empty());
    let at = IVec3::new(3, 3, 4);
    let bright = media(
        voxels(0.0, [[0; 3], [7; 3]], |p| if p == at { 1e4 } else { 0.0 }),
        DAffine3::IDENTITY,
        GridEdge::Background,
    );
    assert_eq!(bright.optical_depth(&ray, f32::INFINITY).x, 1e4);
    let segment = bright.segment(&ray, f32::INFINITY);
    assert_eq!(segment.range(), (12.0, 14.0));
    // ρ = 10⁴ (t − 12) at first.
    let t = segment.distance_at(0, 50.0).unwrap();
    assert!((t - 12.1).abs() < 1e-5, "{t}");
    let beside = Ray::new(Vec3::new(4.5, 3.0, -9.0), Vec3::Z);
    assert!(bright.segment(&beside, f32::INFINITY).is_empty());
}

#[test]
fn maps_that_flatten_space_and_wrong_scales_are_refused() {
    let voxels = voxels(0.0, [[0; 3], [7; 3]], |_| 1.0);
    let new = |matrix3: DMat3, translation: DVec3, scale| {
        let map = DAffine3 {
            matrix3,
            translation,
        };
        Grid::new(voxels.clone(), map, scale, GridEdge::Background).map(|_| ())
    };
    let flat = DMat3::from_diagonal(DVec3::new(1.0, 0.0, 1.0));
    let sheared = DMat3::from_cols(DVec3::X, DVec3::X, DVec3::Z);
    let huge = DMat3::from_diagonal(DVec3::splat(1e-320));
    for matrix in [
        flat,
        sheared,
        DMat3::ZERO,
        DMat3::IDENTITY * f64::NAN,
        DMat3::IDENTITY * f64::INFINITY,
        huge,
    ] {
        let error = new(matrix, DVec3::ZERO, 1.0);
        assert!(
            matches!(error, Err(GridError::Transform { .. })),
            "{matrix}"
        );
    }
    assert!(new(DMat3::IDENTITY, DVec3::NAN, 1.0).is_err());
    for scale in [-1.0, f32::NAN, f32::INFINITY] {
        let error = new(DMat3::IDENTITY, DVec3::ZERO, scale);
        assert!(matches!(error, Err(GridError::Scale(_))));
    }
    // Voxels of very different edges are none of these.
    let thin = DMat3::from_diagonal(DVec3::new(0.001, 1.0, 1000.0));
    assert_eq!(new(thin, DVec3::ZERO, 0.0), Ok(()));
}

/// Sparse voxels: single ones, whole bricks and larger tiles, on both sides of zero.
fn any_voxels() -> impl Strategy<Value = Arc<Voxels>> {
    let brick = (
        prop::array::uniform3(-3i32..3),
        0.1f32..3.0,
        0u32..4,
        prop::collection::vec(0.0f32..2.0, 7),
    );
    let background = prop_oneof![3 => Just(0.0f32), 1 => Just(0.125f32)];
    (background, prop::collection::vec(brick, 1..12)).prop_map(|(background, bricks)| {
        let far = IVec3::splat(1023);
        let mut builder = VoxelsBuilder::new(background, [-far, far], 0, LIMIT).unwrap();
        for (at, value, kind, noise) in bricks {
            let min = IVec3::from(at) * 8;
            match kind {
                0 => builder.set_tile(min, 8, value),
                1 => builder.set_tile((min >> 6) << 6, 64, value),
                _ => {
                    let mut brick = [background; BRICK_VOXELS];
                    for (i, voxel) in brick.iter_mut().enumerate() {
                        if kind == 2 || i % 5 == 0 {
                            *voxel = noise[i * 31 % 7];
                        }
                    }
                    builder.set_brick(min, &brick);
                }
            }
        }
        Arc::new(builder.finish().unwrap().voxels)
    })
}

/// Rotation, shear, mirror and scale: any map of space that is not nearly flat, about the middle of the voxels.
fn any_map() -> impl Strategy<Value = DAffine3> {
    (
        prop::array::uniform9(-1.0f64..1.0),
        prop::array::uniform3(-4.0f64..4.0),
    )
        .prop_filter_map("nearly flat", |(m, translation)| {
            let matrix3 = DMat3::from_cols_array(&m) * 0.2;
            let lengths = [0, 1, 2].map(|i| matrix3.col(i).length());
            (matrix3.determinant().abs() > 0.2 * lengths.iter().product::<f64>()).then_some(
                DAffine3 {
                    matrix3,
                    translation: translation.into(),
                },
            )
        })
}

fn any_grid() -> impl Strategy<Value = Grid> {
    (any_voxels(), any_map()).prop_map(|(voxels, map)| {
        // Cut where there are values, so that they jump to zero there.
        let edge = if voxels.max() > 1.5 {
            GridEdge::Box([
                DVec3::new(-20.5, -10.0, -17.25),
                DVec3::new(9.5, 13.0, 20.0),
            ])
        } else {
            GridEdge::Background
        };
        Grid::new(voxels, map, 0.5, edge).unwrap()
    })
}

fn any_point() -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-6.0f64..6.0).prop_map(DVec3::from)
}

/// Central differences of `f` in three directions; `None` where two step lengths disagree, across a kink.
fn differences<const N: usize>(f: impl Fn(DVec3) -> [f64; N]) -> Option<[DVec3; N]> {
    let [coarse, fine] = [2e-5, 1e-5].map(|h| {
        let slopes = DVec3::AXES.map(|axis| {
            let (after, before) = (f(h * axis), f(-h * axis));
            std::array::from_fn::<f64, N, _>(|i| (after[i] - before[i]) / (2.0 * h))
        });
        std::array::from_fn::<DVec3, N, _>(|i| slopes.map(|slope| slope[i]).into())
    });
    let agree = |(a, b): (&DVec3, &DVec3)| (a - b).length() < 1e-6 * (1.0 + a.length());
    coarse.iter().zip(&fine).all(agree).then_some(fine)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn moving_an_end_along_the_line_adds_the_extinction_there(grid in any_grid(), a in any_point(), b in any_point()) {
        let (density, media) = (Density::Grid(Arc::new(grid.clone())), medium(Region::Everywhere, grid));
        let n = (b - a).normalize();
        let [tau, ..] = media.optical_depth_jet(a, b);
        // `b` is rounded to f32 for its density, which moves it by 4e-7 m where densities change by up to some 30/m.
        let expected = f64::from(density.value(b.as_vec3()));
        let (slope, moved) = (n.dot(tau.gradient), f64::from(f32::EPSILON) * 6.0);
        let steep = f64::from(density.gradient(b.as_vec3()).length()) + 30.0;
        let near_jump = media.distance_to_boundary(b.as_vec3()) < 1e-5;
        prop_assert!(near_jump || (slope - expected).abs() < 2.0 * moved * steep, "{slope} {expected}");
    }

    #[test]
    fn gradient_and_hessian_are_differences(grid in any_grid(), a in any_point(), b in any_point()) {
        let media = medium(Region::Everywhere, grid);
        let [exact, ..] = media.optical_depth_jet(a, b);
        let depth = |h: DVec3| [media.optical_depth_jet(a, b + h)[0].value];
        if let Some([difference]) = differences(depth) {
            // h² of third derivatives, and rounding over h.
            prop_assert!((exact.gradient - difference).length() < 1e-5 * (1.0 + difference.length()), "{} {difference}", exact.gradient);
        }
        let gradient = |h: DVec3| media.optical_depth_jet(a, b + h)[0].gradient.to_array();
        if let Some(difference) = differences(gradient) {
            let scale = 1.0 + difference.iter().map(|d| d.length()).sum::<f64>();
            for (i, row) in difference.into_iter().enumerate() {
                prop_assert!((exact.hessian.col(i) - row).length() < 1e-5 * scale, "{} {difference:?}", exact.hessian);
            }
        }
    }

    #[test]
    fn rigid_motion_has_the_derivatives_of_differences(grid in any_grid(), a in any_point(), to in any_point(), length in 0.1f64..9.0) {
        let media = medium(Region::Everywhere, grid);
        let d = (to - a).normalize();
        let jet = |h: DVec3| media.optical_depth_jet_rigid(a + h, d, length)[0];
        let exact: Jet = jet(DVec3::ZERO);
        if let Some([difference]) = differences(|h| [jet(h).value]) {
            prop_assert!((exact.gradient - difference).length() < 1e-5 * (1.0 + difference.length()), "{} {difference}", exact.gradient);
        }
    }

    #[test]
    fn optical_depth_is_the_integral_of_density(grid in any_grid(), a in any_point(), b in any_point()) {
        let (density, media) = (grid.clone(), medium(Region::Everywhere, grid));
        let n = 4000;
        let length = a.distance(b);
        let sum: f64 = (0..n)
            .map(|i| f64::from(density.value(a.lerp(b, (f64::from(i) + 0.5) / f64::from(n)).as_vec3())))
            .sum();
        let [tau, ..] = media.optical_depth_jet(a, b);
        // A step of 4 mm at a jump of up to 1.5, at both ends; second derivatives are far below.
        prop_assert!((tau.value - sum * length / f64::from(n)).abs() < 2.0 * 1.5 * length / f64::from(n) + 1e-3 * tau.value);
    }

    #[test]
    fn segments_know_optical_depth_and_its_inverse(
        grid in any_grid(), a in any_point(), b in any_point(), fraction in 0.0f32..1.0, endless in prop::bool::ANY
    ) {
        let media = medium(Region::Everywhere, grid);
        let ray = Ray::new(a.as_vec3(), (b - a).normalize().as_vec3());
        let t_max = if endless { f32::INFINITY } else { 4.0 };
        let segment = media.segment(&ray, t_max);
        let total = segment.total().x;
        let direct = media.optical_depth(&ray, t_max).x;
        prop_assert!(total == direct || (total / direct - 1.0).abs() < 1e-6);
        if total == 0.0 {
            prop_assert_eq!(segment.distance_at(0, 1e-6), None);
            return Ok(());
        }
        let t = (fraction * 12.0).min(t_max);
        let (table, marched) = (segment.optical_depth(t).x, media.optical_depth(&ray, t).x);
        prop_assert!((table - marched).abs() <= 1e-6 * (marched + 1e-3), "{table} {marched}");
        let tau = fraction * total.min(20.0);
        let t = segment.distance_at(0, tau).ok_or(TestCaseError::fail("within the total"))?;
        let (first, last) = segment.range();
        prop_assert!(first <= t && t <= last);
        let back = segment.optical_depth(t).x;
        // Rounding of t to f32 where the density is at most 1.5, and of the sum.
        prop_assert!((back - tau).abs() <= 1.5 * f32::EPSILON * t + 2e-6 * tau, "{back} {tau}");
    }

    #[test]
    fn what_is_known_up_to_some_depth_is_known_as_well(
        grid in any_grid(), a in any_point(), to in any_point(), enough in 0.01f32..4.0, share in 0.0f32..1.0,
    ) {
        let media = medium(Region::Everywhere, grid);
        let ray = Ray::new(a.as_vec3(), (to - a).normalize().as_vec3());
        let (whole, part) = (media.optical_depth(&ray, 20.0).x, media.optical_depth_until(&ray, 20.0, enough).x);
        prop_assert!(part == whole || (enough < part && part < whole), "{part} of {whole}, {enough} asked for");
        let (all, cut) = (media.segment(&ray, 20.0), media.segment_until(&ray, 20.0, enough));
        prop_assert!(cut.total().x == all.total().x || cut.total().x > enough);
        let tau = enough * share;
        prop_assert_eq!(cut.distance_at(0, tau), all.distance_at(0, tau));
        let t = 20.0 * share;
        if all.optical_depth(t).x < enough {
            prop_assert_eq!(cut.optical_depth(t), all.optical_depth(t));
        }
    }
}
