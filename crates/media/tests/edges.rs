//! The kinks of optical depth at the edges of boxes, against the volume integral that they are the Hessian of.

#![allow(clippy::unwrap_used, reason = "tests")]

use glam::{DMat3, DVec3, Vec3};
use tyndall_math::quadrature::gauss_legendre;
use tyndall_media::{Density, Media, Medium, MediumParams, Region};

const MIN: Vec3 = Vec3::new(-1.0, -0.5, 0.25);
const MAX: Vec3 = Vec3::new(0.5, 1.0, 2.0);

fn media(density: Density) -> Media {
    let params = MediumParams {
        region: Region::Box { min: MIN, max: MAX },
        density,
        ..MediumParams::new(Vec3::new(0.5, 1.0, 0.0), Vec3::ONE)
    };
    Media::new(vec![Medium::new(params).unwrap()])
}

/// The Hessian of ∫ |p − x|⁻² dV over the box at a point outside: ∫ (8 d dᵀ − 2 d² I)/d⁶ dV with d = x − p.
fn volume_hessian(x: DVec3) -> DMat3 {
    let rule = gauss_legendre(24);
    let (half, middle) = ((MAX - MIN).as_dvec3() * 0.5, (MAX + MIN).as_dvec3() * 0.5);
    let mut sum = DMat3::ZERO;
    for &(u, wu) in &rule {
        for &(v, wv) in &rule {
            for &(w, ww) in &rule {
                let d = x - middle - half * DVec3::new(u, v, w);
                let outer = DMat3::from_cols(d * d.x, d * d.y, d * d.z);
                let d2 = d.length_squared();
                sum += (outer * 8.0 - DMat3::IDENTITY * (2.0 * d2)) * (wu * wv * ww / d2.powi(3));
            }
        }
    }
    sum * half.element_product()
}

/// The mean over all choices of an edge, evenly spread; along it nothing changes in an even box.
fn mean(media: &Media, x: Vec3) -> [DMat3; 3] {
    let edges = media.edges(x);
    let n = 1 << 20;
    let mut sum = [DMat3::ZERO; 3];
    for i in 0..n {
        let u = (i as f32 + 0.5) / n as f32;
        for (sum, h) in sum.iter_mut().zip(edges.sample([u, 0.5]).unwrap().hessian) {
            *sum += h * (1.0 / f64::from(n));
        }
    }
    sum
}

fn norm(m: DMat3) -> f64 {
    m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// The column through an even box is linear in the point but for its kinks, and its integral over directions is ∫ |p − x|⁻² dV.
#[test]
fn all_second_derivatives_of_the_columns_of_a_box_sit_on_its_edges() {
    let media = media(Density::Constant(1.0));
    // Before a face, before an edge, before a corner.
    for x in [
        Vec3::new(-0.25, 0.25, -0.75),
        Vec3::new(1.5, 0.0, -0.5),
        Vec3::new(-1.75, 2.0, 3.25),
    ] {
        let exact = volume_hessian(x.as_dvec3());
        let [red, green, blue] = mean(&media, x);
        let error = norm(green - exact) / norm(exact);
        // Where the choice passes from one edge to the next: some 12 of 10⁶ numbers, of terms ten times their sum.
        assert!(error < 1e-4, "{x}: {error:.1e}, {green} {exact}");
        assert!(norm(red * 2.0 - green) < 1e-12 * norm(green) && blue == DMat3::ZERO);
    }
}

#[test]
fn points_of_edges_lie_on_edges() {
    let fog = media(Density::Height {
        base: 0.0,
        scale_height: 0.5,
    });
    let x = Vec3::new(0.2, 3.0, -1.0);
    let edges = fog.edges(x);
    for i in 0..100 {
        let u = i as f32 / 100.0;
        let point = edges.sample([u, (7.0 * u).fract()]).unwrap();
        let p = x.as_dvec3() + point.direction * point.distance;
        assert!((point.direction.length() - 1.0).abs() < 1e-14);
        let [below, above] = [MIN, MAX].map(|corner| (p - corner.as_dvec3()).abs());
        let on_faces = below.min(above).to_array().map(|d| d < 1e-13);
        assert!(on_faces.iter().filter(|on| **on).count() >= 2, "{p}");
    }
    assert!(Media::default().edges(x).sample([0.5, 0.5]).is_none());
}

/// On faces, edges and corners and in their planes.
#[test]
fn all_numbers_are_finite_wherever_the_point_lies() {
    for density in [
        Density::Constant(1e9),
        Density::Height {
            base: -3.0,
            scale_height: 1e-6,
        },
    ] {
        let media = media(density);
        for x in [-1.0, -1.0 + 1e-7, 0.0, 0.5, 0.5 + 1e-7, 1e-38, 1e30] {
            for y in [-0.5, 0.3, 1.0, 1e-38, -1e30] {
                for z in [0.25, 0.0, 2.0, 1e-38, 1e30] {
                    let edges = media.edges(Vec3::new(x, y, z));
                    for u in [0.0, 0.3, 0.7, 1.0 - f32::EPSILON / 2.0] {
                        let Some(point) = edges.sample([u, u]) else {
                            continue;
                        };
                        assert!(
                            point.direction.is_finite()
                                && point.distance.is_finite()
                                && point.hessian.iter().all(|h| h.is_finite()),
                            "{x} {y} {z}: {point:?}"
                        );
                    }
                }
            }
        }
    }
}
