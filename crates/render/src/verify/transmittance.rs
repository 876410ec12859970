//! E1: optical depth between two points and its gradient when one end moves.
//!
//! Elementary calculus; fields and points as in the table, whose z is our y, x our z and y our x.

use super::world::media;
use super::{Row, Task};
use glam::{DVec3, Vec3};
use tyndall_media::{Density, MediumParams};

const FAMILY: &str = "E1";
/// The end that stays, and the one that moves; (z, x, y) of (x, y, z) in the table.
const FIXED: Vec3 = Vec3::new(-0.5, 0.125, 0.25);
const MOVING: Vec3 = Vec3::new(0.75, 1.5, 1.75);

/// Name, scale height of the density (infinite for constant), extinction at height 0, height of the moving end above
/// [`FIXED`], optical depth, gradient.
type Field = (&'static str, f64, f32, f32, f64, [f64; 3]);

const FIELDS: [Field; 6] = [
    (
        "constant",
        f64::INFINITY,
        0.7,
        1.375,
        1.671685152772495,
        [0.36639674581314957, 0.4030364203944646, 0.43967609497577953],
    ),
    (
        "height",
        1.0 / 1.3,
        0.9,
        1.375,
        0.8509967169603773,
        [
            0.18651982837487718,
            -0.19134142939663748,
            0.22382379404985264,
        ],
    ),
    (
        "height, level",
        1.0 / 1.3,
        0.9,
        0.0,
        1.4937385259696303,
        [0.48975033638348536, -0.9709300418802598, 0.5877004036601825],
    ),
    (
        "height, level to 1e-3",
        1.0 / 1.3,
        0.9,
        1e-3,
        1.4927682123002397,
        [0.4894320723785514, -0.9696975608199422, 0.5873184868542617],
    ),
    (
        "height, level to 1e-5",
        1.0 / 1.3,
        0.9,
        1e-5,
        1.4937288167308749,
        [0.48974715301367056, -0.9709177092297611, 0.5876965836164046],
    ),
    (
        "height, level to 1e-7",
        1.0 / 1.3,
        0.9,
        1e-7,
        1.4937384288766324,
        [0.48975030454971424, -0.9709299185529705, 0.5877003654596571],
    ),
];

/// f32 parameters and results: a few roundings of 6e-8 each, times the derivative of τ with respect to height.
const TOLERANCE: f64 = 2e-6;

pub(super) fn tasks() -> Vec<Task> {
    vec![Box::new(|_| FIELDS.iter().flat_map(rows).collect())]
}

fn rows(&(name, scale_height, sigma_t, rise, tau, gradient): &Field) -> Vec<Row> {
    let density = if scale_height.is_finite() {
        Density::Height {
            base: 0.0,
            scale_height: scale_height as f32,
        }
    } else {
        Density::Constant(1.0)
    };
    let media = media(MediumParams {
        density,
        ..MediumParams::new(Vec3::splat(sigma_t), Vec3::ZERO)
    });
    let end = Vec3::new(MOVING.x, FIXED.y + rise, MOVING.z);
    let found = media.optical_depth_gradient(FIXED, end);
    let found_gradient = found.d_b[0].as_dvec3();
    let exact = DVec3::from(gradient);
    let n = (end - FIXED).as_dvec3().normalize();
    let sigma = f64::from(media.at(end).sigma_t.x);
    vec![
        Row::fixed(
            FAMILY,
            format!("{name}: optical depth"),
            found.tau.x.into(),
            tau,
            TOLERANCE * tau,
        ),
        Row::fixed(
            FAMILY,
            format!("{name}: gradient, distance from exact"),
            found_gradient.distance(exact),
            0.0,
            TOLERANCE * exact.length(),
        ),
        Row::fixed(
            FAMILY,
            format!("{name}: n · gradient = σt"),
            n.dot(found_gradient),
            sigma,
            TOLERANCE * sigma,
        ),
    ]
}
