//! E2b: single scattering at a point, with its gradient, for lamps of several shapes.
//!
//! Closed forms (points, vacuum) and quadrature; the gradient of a rectangle's solid angle is the Biot–Savart field of its
//! edges. Seen from (0.3, 0.2, 0.1), the light leaves along (0.2, 0.3, −0.9).

use super::measure::{Light, Point, World, point_rows};
use super::world::{Lamp, Lamps, Shape, Solid, Solids, fog, phase};
use super::{Budget, Row, Task};
use glam::{DVec3, Vec3};
use tyndall_math::{Key, Purpose};
use tyndall_media::Region;
use tyndall_transport::gather::Derivatives;
use tyndall_transport::inscatter::{self, Order};

const FAMILY: &str = "E2b";
const X: Vec3 = Vec3::new(0.3, 0.2, 0.1);
const TOWARDS: Vec3 = Vec3::new(0.2, 0.3, -0.9);
const SAMPLES: usize = 1024;

/// Mean cosine, value, gradient: a lamp of 2.5 W/sr at (1.1, −0.4, 1.6), extinction 0.8.
const POINT: [(f32, f64, [f64; 3]); 4] = [
    (
        0.0,
        0.014470994365050189,
        [
            0.012261502426130694,
            -0.00919612681959802,
            0.02299031704899505,
        ],
    ),
    (
        0.5,
        0.03409774815960881,
        [
            0.06261379008927302,
            -0.018713630366640734,
            0.03736850518316383,
        ],
    ),
    (
        0.9,
        0.010903925816867588,
        [
            0.031911035711437954,
            -0.0049425828682479805,
            0.0060262258655097885,
        ],
    ),
    (
        -0.7,
        0.0017733201980903723,
        [
            0.0010601700483935418,
            -0.0011656880178197541,
            0.0030377402050575848,
        ],
    ),
];

/// Extinction, mean cosine, value, gradient.
type Extended = (f32, f32, f64, [f64; 3]);

/// A ball of radiance 3 and radius 0.6 at (0.5, 0.4, 2).
const BALL: [Extended; 4] = [
    (
        0.0,
        0.0,
        0.07504813945240635,
        [
            0.008349531153871492,
            0.008349531153871492,
            0.07932054596177918,
        ],
    ),
    (
        0.25,
        0.0,
        0.05192510359512541,
        [
            0.007160493303003613,
            0.007160493303003613,
            0.06802468637853432,
        ],
    ),
    (
        0.8,
        0.0,
        0.02315694313556554,
        [
            0.004549078954397253,
            0.004549078954397253,
            0.043216250066773904,
        ],
    ),
    (
        3.0,
        0.0,
        0.0009490023356168448,
        [
            0.0004078038884107386,
            0.0004078038884107386,
            0.003874136939902017,
        ],
    ),
];

/// A rectangle of radiance 1, |x| < 1 and |y| < 0.5 at z = 2.
const RECTANGLE: [Extended; 4] = [
    (
        0.0,
        0.0,
        0.03647843269281897,
        [
            -0.06871789654871124 / FOUR_PI,
            -0.061371630653361826 / FOUR_PI,
            0.4050085548597061 / FOUR_PI,
        ],
    ),
    (
        0.8,
        0.0,
        0.007282578897521665,
        [
            -0.0015154915499154572,
            -0.0014667065310150279,
            0.012032924991757551,
        ],
    ),
    (
        0.8,
        0.7,
        0.05654529165605473,
        [
            0.00022233097788167081,
            0.043784676897880785,
            0.08656327411339593,
        ],
    ),
    (
        3.0,
        -0.4,
        2.8680199155361154e-05,
        [
            -9.11824829189335e-06,
            -1.2264052316653234e-05,
            0.00010902240424545539,
        ],
    ),
];

const FOUR_PI: f64 = 4.0 * std::f64::consts::PI;

pub(super) fn tasks() -> Vec<Task> {
    let ball = Shape::Sphere {
        center: Vec3::new(0.5, 0.4, 2.0),
        radius: 0.6,
    };
    let rectangle = Shape::Rectangle {
        corner: Vec3::new(-1.0, -0.5, 2.0),
        edges: [Vec3::new(2.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0)],
    };
    let mut tasks: Vec<Task> = vec![Box::new(|_| POINT.iter().flat_map(point).collect())];
    for (name, shape, radiance, rows) in [
        ("ball", ball, 3.0, &BALL),
        ("rectangle", rectangle, 1.0, &RECTANGLE),
    ] {
        for row in rows {
            tasks.push(Box::new(move |budget| {
                extended(budget, name, (shape, radiance), row)
            }));
        }
    }
    tasks
}

/// A lamp without extent leaves nothing to chance.
fn point(&(g, value, gradient): &(f32, f64, [f64; 3])) -> Vec<Row> {
    let media = fog(0.8, 0.5, Region::Everywhere, phase(g));
    let world = World {
        geometry: &Solids::default(),
        lights: &Lamps::one(Lamp::Point {
            position: Vec3::new(1.1, -0.4, 1.6),
            intensity: 2.5,
        }),
        media: &media,
    };
    let key = Key {
        seed: 0,
        purpose: Purpose::Probe,
        index: 0,
    };
    let asked = (Order::Gradient, Derivatives::Aware);
    let found = inscatter::single(&world, X, Some(TOWARDS.normalize()), 1, asked, key);
    let slope = found.gradient[0].as_dvec3();
    let exact = DVec3::from(gradient);
    // A dozen f32 roundings; at g = 0.9 the peak magnifies those of the angle.
    let tolerance = 3e-6;
    vec![
        Row::fixed(
            FAMILY,
            format!("point lamp, g {g}: value"),
            found.value.x.into(),
            value,
            tolerance * value,
        ),
        Row::fixed(
            FAMILY,
            format!("point lamp, g {g}: gradient, distance from exact"),
            slope.distance(exact),
            0.0,
            tolerance * exact.length(),
        ),
    ]
}

fn extended(
    budget: &Budget,
    name: &str,
    (shape, radiance): (Shape, f32),
    &(sigma_t, g, value, gradient): &Extended,
) -> Vec<Row> {
    let media = fog(sigma_t, 0.5, Region::Everywhere, phase(g));
    let solids = Solids(vec![Solid {
        emission: radiance,
        lamp: Some(0),
        ..Solid::black(shape)
    }]);
    let world = World {
        geometry: &solids,
        lights: &Lamps::one(Lamp::Solid { shape, radiance }),
        media: &media,
    };
    let point = Point {
        x: X,
        towards: Some(TOWARDS.normalize()),
        light: Light::Single,
        value,
        gradient,
    };
    let name = format!("{name}, σt {sigma_t} g {g}");
    point_rows(&world, budget, (FAMILY, &name), SAMPLES, &point)
}
