//! E3.7: a closed diffuse room with fog and a lamp, exact global illumination between surfaces and volume.
//!
//! A spherical wall around a homogeneous sphere of extinction 1, a lamp of power 1 in the centre; by superposition of E3.6.

use super::measure::{Channel, Light, Point, ROUNDING, World, estimate, pixel, point_rows};
use super::world::{Lamps, Solid, Solids, ball, fog, phase};
use super::{Budget, Row, Task};
use glam::Vec3;
use std::f32::consts::PI;
use tyndall_math::Ray;

const FAMILY: &str = "E3.7";
const SAMPLES: usize = 80_000;
const RAYS: usize = 384;

/// A room.
struct Closed {
    radius: f32,
    albedo: f32,
    reflectance: f32,
    /// Radiance that leaves the wall.
    wall: f64,
    /// At 0.5 and 0.9 of the radius.
    fluence: [f64; 2],
    slope: [f64; 2],
    /// Views across the room at impact 0.5 and 0.9 of the radius.
    pixels: [f64; 2],
}

const ROOMS: [Closed; 9] = [
    Closed {
        radius: 0.5,
        albedo: 0.5,
        reflectance: 0.5,
        wall: 0.06055038563217474,
        fluence: [1.834243318850981, 0.9844091400394218],
        slope: [-10.224147486646883, -1.3954425099452716],
        pixels: [0.05622284400809589, 0.052714605682541785],
    },
    Closed {
        radius: 0.5,
        albedo: 0.9,
        reflectance: 0.5,
        wall: 0.08982747301143283,
        fluence: [2.5825503108311505, 1.5286551190443716],
        slope: [-11.76463660202782, -2.231603317906257],
        pixels: [0.1197491716210492, 0.09587979267770141],
    },
    Closed {
        radius: 0.5,
        albedo: 1.0,
        reflectance: 0.5,
        wall: 0.10132118364233779,
        fluence: [2.8684964084858016, 1.7442980929346654],
        slope: [-12.236395891290922, -2.5623737997742686],
        pixels: [0.14521874176912147, 0.11340193461785125],
    },
    Closed {
        radius: 1.0,
        albedo: 0.5,
        reflectance: 0.5,
        wall: 0.009745275212479513,
        fluence: [0.3628023007409902, 0.15821310913661407],
        slope: [-1.2644677648515121, -0.14944679318683174],
        pixels: [0.009460452162116752, 0.007642250950236106],
    },
    Closed {
        radius: 1.0,
        albedo: 0.9,
        reflectance: 0.5,
        wall: 0.01974963132638313,
        fluence: [0.6537460334463382, 0.34781489909647234],
        slope: [-1.670714463056013, -0.3328611701625256],
        pixels: [0.03121825372489978, 0.022304090725046938],
    },
    Closed {
        radius: 1.0,
        albedo: 0.9,
        reflectance: 0.8,
        wall: 0.059568095353859554,
        fluence: [1.0988698789534896, 0.8130718869729512],
        slope: [-1.6398841945199512, -0.25178054593594107],
        pixels: [0.06507180093435318, 0.05848042423547417],
    },
    Closed {
        radius: 1.0,
        albedo: 1.0,
        reflectance: 0.5,
        wall: 0.025330295910584447,
        fluence: [0.8060787450427591, 0.45539344577109003],
        slope: [-1.818946144175464, -0.4355663875647935],
        pixels: [0.04368249461956576, 0.031001743011445135],
    },
    Closed {
        radius: 3.0,
        albedo: 0.5,
        reflectance: 0.5,
        wall: 0.0002152625748623364,
        fluence: [0.01997893804957705, 0.003707484437214941],
        slope: [-0.03792405922942962, -0.0029023823403708654],
        pixels: [0.0002811019440924565, 0.0001430234471297425],
    },
    Closed {
        radius: 3.0,
        albedo: 0.9,
        reflectance: 0.5,
        wall: 0.0012080562007833113,
        fluence: [0.07182945535276125, 0.024287257717802154],
        slope: [-0.08718056026542316, -0.016057023880438594],
        pixels: [0.0025168683090095807, 0.0015825639534675284],
    },
];

pub(super) fn tasks() -> Vec<Task> {
    ROOMS
        .iter()
        .map(|room| -> Task { Box::new(move |budget| room.rows(budget)) })
        .collect()
}

/// Views start this far inside the wall, as a share of the radius, where f32 tells inside from outside.
const INSIDE: f32 = 1.0 - 1e-6;

impl Closed {
    fn rows(&self, budget: &Budget) -> Vec<Row> {
        let solids = Solids(vec![Solid::room(self.radius, self.reflectance, 0.0)]);
        let media = fog(1.0, self.albedo, ball(self.radius), phase(0.0));
        let world = World {
            geometry: &solids,
            lights: &Lamps::at_origin(0.25 / PI),
            media: &media,
        };
        let name = format!(
            "room R {}, albedo {}, wall {}",
            self.radius, self.albedo, self.reflectance
        );
        let views = [0.5f32, 0.9].map(|b| {
            let start = Vec3::new(-(1.0 - b * b).sqrt(), b, 0.0) * (self.radius * INSIDE);
            (format!("pixel b {b} R"), Ray::new(start, Vec3::X))
        });
        // The wall itself, seen from so near that the fog between takes and adds less than rounding.
        let near = Vec3::new(0.0, 0.0, self.radius * INSIDE);
        let wall = ("wall".to_owned(), Ray::new(near, Vec3::Z));
        let [half, edge] = self.pixels;
        let mut rows: Vec<Row> = views
            .into_iter()
            .chain([wall])
            .zip([half, edge, self.wall])
            .map(|((what, ray), exact)| {
                let value = pixel(&world, budget, SAMPLES, None, Channel::Mean, |_| ray);
                let name = format!("{name}: {what}");
                Row::random(FAMILY, name, estimate(&value), exact, ROUNDING * exact)
            })
            .collect();
        // Light straight from the lamp, exp(−r)/(4π r²), is not in a record.
        let r = 0.5 * f64::from(self.radius);
        let direct = (-r).exp() / (4.0 * std::f64::consts::PI * r * r);
        let per_sphere = 0.25 * std::f64::consts::FRAC_1_PI;
        let n = Vec3::new(0.6, -0.48, 0.64);
        let slope = (self.slope[0] + direct * (1.0 + 2.0 / r)) * per_sphere;
        let point = Point {
            x: n * r as f32,
            towards: None,
            light: Light::Multiple,
            value: (self.fluence[0] - direct) * per_sphere,
            gradient: (n.as_dvec3() * slope).to_array(),
        };
        let name = format!("{name}: record r 0.5 R");
        rows.extend(point_rows(&world, budget, (FAMILY, &name), RAYS, &point));
        rows
    }
}
