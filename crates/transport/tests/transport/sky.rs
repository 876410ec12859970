//! Light from a sky that is seen through a window: records against the window's solid angle and its derivatives.

use crate::rig::Lamps;
use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, PI};
use tyndall_math::spherical::SphericalRectangle;
use tyndall_math::{Key, Purpose, Ray};
use tyndall_media::Media;
use tyndall_transport::gather::{self, GatherPattern, What};
use tyndall_transport::irradiance::irradiance;
use tyndall_transport::path::Reach;
use tyndall_transport::{Bsdf, Geometry, SurfaceHit, World};

/// A room without end below a black wall at z = 0 with a window, above a black floor at z = −3.
struct Windowed;

const CORNER: Vec3 = Vec3::new(-0.5, -0.3, 0.0);
const EDGES: [Vec3; 2] = [Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 0.6, 0.0)];
const FLOOR: f32 = -3.0;

impl Geometry for Windowed {
    fn intersect(&self, ray: &Ray, t_max: f32) -> Option<SurfaceHit> {
        let level = if ray.direction.z > 0.0 { 0.0 } else { FLOOR };
        let t = (level - ray.origin.z) / ray.direction.z;
        let position = ray.at(t).with_z(level);
        let [u, v] = [position.x - CORNER.x, position.y - CORNER.y];
        let within = |along: f32, length: f32| (0.0..length).contains(&along);
        let is_window = level == 0.0 && within(u, EDGES[0].x) && within(v, EDGES[1].y);
        let normal = Vec3::Z * -ray.direction.z.signum();
        (t > 1e-5 && t < t_max && !is_window).then(|| SurfaceHit {
            t,
            position,
            normal,
            bsdf: Bsdf::lambert(Vec3::ZERO, normal),
            emission: Vec3::ZERO,
            light: None,
            size: 100.0,
        })
    }

    fn occluded(&self, ray: &Ray, t_max: f32) -> bool {
        self.intersect(ray, t_max).is_some()
    }
}

fn key(index: u64) -> Key {
    Key {
        seed: 5,
        purpose: Purpose::Probe,
        index,
    }
}

fn window(p: Vec3) -> SphericalRectangle {
    SphericalRectangle::new(p, CORNER, EDGES).unwrap()
}

#[test]
fn a_record_of_sky_light_knows_the_window_and_how_it_moves() {
    let (sky, media) = (Lamps::sky(2.0), Media::default());
    let world = World {
        geometry: &Windowed,
        lights: &sky,
        media: &media,
    };
    // ∫ L dω / 4π
    let light = |p: Vec3| 2.0 * window(p).solid_angle() / (4.0 * PI);
    let pattern = GatherPattern::new(2048);
    for x in [Vec3::new(0.1, 0.2, -1.0), Vec3::new(0.8, -0.4, -0.7)] {
        let h = 0.02;
        let slope = |axis: Vec3| (light(x + h * axis) - light(x - h * axis)) / (2.0 * h);
        let expected = Vec3::new(slope(Vec3::X), slope(Vec3::Y), slope(Vec3::Z));
        let n = 16;
        let (mut value, mut gradient) = (0.0, Vec3::ZERO);
        for i in 0..n {
            let found = gather::towards(&world, x, None, What::Sky, &pattern, key(i));
            value += found.value.x / n as f32;
            gradient += found.gradient[0] / n as f32;
        }
        println!("{value} {} {gradient} {expected}", light(x));
        // 16 × 2048 directions, of which 4 to 8 % see the window: 0.3 % of an area by counting evenly spread points.
        assert!((value / light(x) - 1.0).abs() < 0.01);
        assert!((gradient - expected).length() < 0.1 * expected.length());
    }
}

#[test]
fn irradiance_from_a_sky_is_that_of_the_window() {
    let (sky, media) = (Lamps::sky(2.0), Media::default());
    let world = World {
        geometry: &Windowed,
        lights: &sky,
        media: &media,
    };
    let down = Ray::new(Vec3::new(0.4, 0.3, -1.0), Vec3::NEG_Z);
    let floor = Windowed.intersect(&down, f32::INFINITY).unwrap();
    let seen = window(floor.position);
    let n = 64;
    let at = |i: u32| (i as f32 + 0.5) / n as f32;
    let cosines = (0..n * n).map(|k| seen.sample([at(k % n), at(k / n)]).direction.z);
    let mean = cosines.sum::<f32>() / (n * n) as f32;
    let expected = 2.0 * mean * seen.solid_angle() * FRAC_1_PI;
    let gather = |sky| irradiance(&world, &floor, 4096, sky, Reach::default(), key(1));
    let (with, without) = (gather(true), gather(false));
    println!("{} {expected}", with.value.x);
    assert!((with.value.x - expected).abs() < 4.0 * with.value_error.x);
    assert!(with.value_error.x < 0.03 * expected);
    assert_eq!(without.value, Vec3::ZERO);
}
