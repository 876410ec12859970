//! E3.1: a lamp of power 1 in endless fog: pixels beside it, and fluence with its gradient.
//!
//! Isotropic: Davison 1947 and Case and Zweifel 1967; Henyey–Greenstein by spherical harmonics to 1e-9. Extinction is 1 per metre.

use super::measure::{Channel, Light, Point, ROUNDING, World, estimate, pixel, point_rows};
use super::world::{Lamps, Solids, fog, phase};
use super::{Budget, Row, Task};
use glam::Vec3;
use std::f32::consts::PI;
use tyndall_math::Ray;
use tyndall_media::Region;

const FAMILY: &str = "E3.1";
const PIXEL_SAMPLES: usize = 300_000;
const RAYS: usize = 640;

/// Albedo, distance to the ray's closest approach and of closest approach, radiance of a view ray; isotropic.
const PIXELS: [(f32, f32, f32, f64); 6] = [
    (0.5, 3.0, 1.0, 0.00036602197400205377),
    (0.5, 3.0, 0.25, 0.0019630405088428443),
    (0.5, 0.0, 2.0, 0.0002231016294017708),
    (0.9, 3.0, 1.0, 0.0025431558853558772),
    (0.9, 3.0, 0.25, 0.006685682278695497),
    (0.9, 0.0, 2.0, 0.0020657640519898364),
];

/// Albedo, mean cosine, distance from the lamp, fluence, its derivative.
const FLUENCE: [(f32, f32, f64, f64, f64); 33] = [
    (0.5, 0.0, 0.5, 0.29476312212603956, -1.2845018011021605),
    (0.5, 0.0, 1.0, 0.05869513751300359, -0.14852455843208978),
    (0.5, 0.0, 2.0, 0.00792762373575656, -0.01330375828994354),
    (0.8, 0.0, 0.5, 0.4145872750691593, -1.5626655188925842),
    (0.8, 0.0, 1.0, 0.10741258974596922, -0.2205923665135125),
    (0.8, 0.0, 2.0, 0.022065805520931563, -0.028697865205121),
    (0.9, 0.0, 0.5, 0.4828326918728754, -1.6786132702973893),
    (0.9, 0.0, 1.0, 0.14328386152545275, -0.2579210571677805),
    (0.9, 0.0, 2.0, 0.03712639932400528, -0.040237619599928685),
    (0.5, -0.5, 0.5, 0.3313703376991224, -1.468738230860018),
    (0.5, -0.5, 1.0, 0.06231805802704404, -0.16590555501864754),
    (0.5, -0.5, 2.0, 0.007398210252463997, -0.013310043723260459),
    (0.5, 0.5, 0.5, 0.2669006997576541, -1.1773969934110116),
    (0.5, 0.5, 1.0, 0.05331165807777521, -0.1322616954820185),
    (0.5, 0.5, 2.0, 0.007878559431147148, -0.012309493471948083),
    (0.5, 0.75, 0.5, 0.2562677639306019, -1.1420122273094477),
    (0.5, 0.75, 1.0, 0.0506143611970623, -0.1257570042223247),
    (0.5, 0.75, 2.0, 0.007640047525655277, -0.01162573419448158),
    (0.5, 0.9, 0.5, 0.25099169509715563, -1.1252343913049652),
    (0.5, 0.9, 1.0, 0.0491516957693622, -0.12253926702761715),
    (0.5, 0.9, 2.0, 0.007451202654130941, -0.011225257118598807),
    (0.9, -0.5, 0.5, 0.6378767517035997, -2.213405535205678),
    (0.9, -0.5, 1.0, 0.1831153069160306, -0.3482893586120189),
    (0.9, -0.5, 2.0, 0.042437246464424594, -0.05075668537305631),
    (0.9, 0.5, 0.5, 0.37087580071692267, -1.3888313685050362),
    (0.9, 0.5, 1.0, 0.10252859259365572, -0.18967591150988183),
    (0.9, 0.5, 2.0, 0.027458826365441905, -0.027452030239802652),
    (0.9, 0.75, 0.5, 0.3303105056027689, -1.3008602921308288),
    (0.9, 0.75, 1.0, 0.08459027387619777, -0.1662528070213437),
    (0.9, 0.75, 2.0, 0.021337764047287582, -0.021664158824239096),
    (0.9, 0.9, 0.5, 0.31225993907430266, -1.2624810559839725),
    (0.9, 0.9, 1.0, 0.0762529460674477, -0.15637062232701343),
    (0.9, 0.9, 2.0, 0.01800273464953858, -0.019143578200968098),
];

pub(super) fn tasks() -> Vec<Task> {
    let pixels = PIXELS
        .iter()
        .map(|&row| -> Task { Box::new(move |budget| vec![pixel_row(budget, row)]) });
    let records = FLUENCE
        .iter()
        .map(|&row| -> Task { Box::new(move |budget| record_rows(budget, row)) });
    pixels.chain(records).collect()
}

fn pixel_row(budget: &Budget, (albedo, t0, h, exact): (f32, f32, f32, f64)) -> Row {
    let media = fog(1.0, albedo, Region::Everywhere, phase(0.0));
    let world = World {
        geometry: &Solids::default(),
        lights: &Lamps::at_origin(0.25 / PI),
        media: &media,
    };
    let ray = Ray::new(Vec3::new(-t0, h, 0.0), Vec3::X);
    let value = pixel(&world, budget, PIXEL_SAMPLES, None, Channel::Mean, |_| ray);
    let name = format!("endless fog, albedo {albedo}: pixel t0 {t0} h {h}");
    Row::random(FAMILY, name, estimate(&value), exact, ROUNDING * exact)
}

fn record_rows(
    budget: &Budget,
    (albedo, g, r, fluence, slope): (f32, f32, f64, f64, f64),
) -> Vec<Row> {
    let media = fog(1.0, albedo, Region::Everywhere, phase(g));
    let world = World {
        geometry: &Solids::default(),
        lights: &Lamps::at_origin(0.25 / PI),
        media: &media,
    };
    // Light straight from the lamp, exp(−r)/(4π r²), is not in a record.
    let direct = (-r).exp() / (4.0 * std::f64::consts::PI * r * r);
    let direct_slope = -direct * (1.0 + 2.0 / r);
    let n = Vec3::new(0.6, -0.48, 0.64);
    let per_sphere = 0.25 * std::f64::consts::FRAC_1_PI;
    let point = Point {
        x: n * r as f32,
        towards: None,
        light: Light::Multiple,
        value: (fluence - direct) * per_sphere,
        gradient: (n.as_dvec3() * ((slope - direct_slope) * per_sphere)).to_array(),
    };
    let name = format!("endless fog, albedo {albedo} g {g}: record r {r}");
    point_rows(&world, budget, (FAMILY, &name), RAYS, &point)
}
