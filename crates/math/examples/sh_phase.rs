//! How many bands of spherical harmonics does a phase function need?
//!
//! Projects Henyey–Greenstein onto spherical harmonics of growing order and prints the relative error in the mean square and
//! the lowest value, which is negative where the series rings. A cache of scattered light keeps this many numbers for
//! each colour of each record.
//!
//! ```text
//! cargo run --example sh_phase -- 0.7
//! ```

#![allow(
    clippy::print_stdout,
    reason = "an example shows its result to a person"
)]

use glam::Vec3;
use std::f64::consts::PI;
use tyndall_math::{quadrature::gauss_legendre, sh};

/// p(μ) = (1 − g²) / (4π (1 + g² − 2 g μ)^(3/2)) per steradian, with the denominator free of cancellation.
fn henyey_greenstein(g: f64, mu: f64) -> f64 {
    let denominator = (1.0 - g) * (1.0 - g) + 2.0 * g * (1.0 - mu);
    (1.0 - g * g) / (4.0 * PI * denominator.powf(1.5))
}

fn main() {
    let g = match std::env::args().nth(1).map(|a| a.parse::<f64>()) {
        None => 0.7,
        Some(Ok(g)) if g.abs() <= 0.95 => g,
        Some(_) => {
            println!("usage: sh_phase [mean cosine between -0.95 and 0.95]");
            return;
        }
    };
    println!("Henyey-Greenstein, mean cosine {g}");
    println!("order  numbers  relative error  lowest value");

    // Around the forward direction only the functions with m = 0 matter, so one integral over μ measures the error.
    let nodes = gauss_legendre(400);
    let norm: f64 = nodes
        .iter()
        .map(|(mu, weight)| weight * henyey_greenstein(g, *mu).powi(2))
        .sum();
    for order in 0..=16 {
        let basis = sh::Basis::new(order);
        let phase = |w: Vec3| Vec3::splat(henyey_greenstein(g, f64::from(w.z)) as f32);
        let coefficients = basis.project(128, phase);
        let (mut error, mut lowest) = (0.0, f64::INFINITY);
        for (mu, weight) in &nodes {
            let w = Vec3::new((1.0 - mu * mu).sqrt() as f32, 0.0, *mu as f32);
            let series = f64::from(basis.reconstruct(w, &coefficients).x);
            error += weight * (series - henyey_greenstein(g, *mu)).powi(2);
            lowest = lowest.min(series);
        }
        println!(
            "{order:5}  {:7}  {:13.3} %  {lowest:12.4}",
            basis.n_coefficients(),
            100.0 * (error / norm).sqrt(),
        );
    }
}
