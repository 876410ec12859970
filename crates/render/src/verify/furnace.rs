//! E3.5: furnaces, whose answers are exact by symmetry.

use super::measure::{Channel, ROUNDING, World, estimate, pixel};
use super::world::{Lamps, Shape, Solid, Solids, ball, fog, media, phase};
use super::{Budget, Row, Task};
use glam::Vec3;
use std::f32::consts::PI;
use tyndall_math::Ray;
use tyndall_math::stats::Welford;
use tyndall_media::{Density, Media, MediumParams, PhaseFunction, Region};

const FAMILY: &str = "E3.5";
const SAMPLES: usize = 90_000;
const CHANNELS: [&str; 3] = ["red", "green", "blue"];

pub(super) fn tasks() -> Vec<Task> {
    vec![
        Box::new(|budget| {
            white(
                budget,
                "F1 isotropic",
                Vec3::ONE,
                PhaseFunction::Isotropic,
                Density::Constant(2.0),
            )
        }),
        Box::new(|budget| {
            white(
                budget,
                "F1 g 0.8",
                Vec3::ONE,
                phase(0.8),
                Density::Constant(4.0),
            )
        }),
        Box::new(|budget| {
            white(
                budget,
                "F1 g -0.6",
                Vec3::ONE,
                phase(-0.6),
                Density::Constant(8.0),
            )
        }),
        Box::new(|budget| {
            let rayleigh = PhaseFunction::Rayleigh;
            white(
                budget,
                "F1 Rayleigh",
                Vec3::ONE,
                rayleigh,
                Density::Constant(4.0),
            )
        }),
        Box::new(|budget| {
            let lobes = [(0.7, phase(0.8)), (0.3, phase(-0.3))];
            let mixture = PhaseFunction::mixture(&lobes).unwrap_or_default();
            white(
                budget,
                "F1 g 0.8 and -0.3",
                Vec3::ONE,
                mixture,
                Density::Constant(4.0),
            )
        }),
        Box::new(|budget| white(budget, "F1 height, g 0.5", Vec3::ONE, phase(0.5), HEIGHT)),
        Box::new(|budget| {
            let sigma = Vec3::new(0.2, 1.0, 5.0);
            white(
                budget,
                "F2 coloured",
                sigma,
                PhaseFunction::Isotropic,
                Density::Constant(1.0),
            )
        }),
        Box::new(|budget| {
            let sigma = Vec3::new(0.0, 2.0, 2.0);
            white(
                budget,
                "F2 coloured, g 0.8",
                sigma,
                phase(0.8),
                Density::Constant(1.0),
            )
        }),
        Box::new(|budget| room(budget, "F3 walls 0.8 + 0.2", 0.8, 0.2, 3.0)),
        Box::new(|budget| room(budget, "F3 walls 0.3 + 0.7", 0.3, 0.7, 1.0)),
        Box::new(isothermal),
        Box::new(card),
        Box::new(absorbing),
        Box::new(|budget| room(budget, "F8 grey, empty", 0.5, 0.5, 0.0)),
        Box::new(|budget| room(budget, "F8 grey, fog", 0.5, 0.5, 2.0)),
        Box::new(lamp),
    ]
}

const HEIGHT: Density = Density::Height {
    base: -1.0,
    scale_height: 0.4,
};

/// A view that misses the centre.
fn view() -> Ray {
    Ray::new(Vec3::new(-2.0, 0.3, 0.0), Vec3::X)
}

fn channel_rows(
    budget: &Budget,
    (name, samples): (&str, usize),
    world: &World<'_>,
    ray: Ray,
) -> Vec<Row> {
    CHANNELS
        .iter()
        .enumerate()
        .map(|(c, channel)| {
            let value = pixel(world, budget, samples, None, Channel::One(c), |_| ray);
            let name = format!("furnace {name}: {channel}");
            Row::random(FAMILY, name, estimate(&value), 1.0, ROUNDING)
        })
        .collect()
}

/// F1, F2: albedo 1 under a white sky shows 1 everywhere.
fn white(
    budget: &Budget,
    name: &str,
    sigma_t: Vec3,
    phase: PhaseFunction,
    density: Density,
) -> Vec<Row> {
    let media = media(MediumParams {
        region: ball(1.0),
        phase,
        density,
        ..MediumParams::new(sigma_t, Vec3::ONE)
    });
    let world = World {
        geometry: &Solids::default(),
        lights: &Lamps::sky(),
        media: &media,
    };
    if sigma_t == Vec3::ONE {
        let value = pixel(&world, budget, SAMPLES, None, Channel::Mean, |_| view());
        let name = format!("furnace {name}");
        return vec![Row::random(FAMILY, name, estimate(&value), 1.0, ROUNDING)];
    }
    channel_rows(budget, (name, SAMPLES), &world, view())
}

/// F3, F8: a closed room whose walls emit what they do not reflect, with fog of albedo 1.
fn room(budget: &Budget, name: &str, reflectance: f32, emission: f32, sigma_t: f32) -> Vec<Row> {
    let media = fog(sigma_t, 1.0, ball(1.0), phase(0.4));
    let solids = Solids(vec![Solid::room(1.0, reflectance, emission)]);
    let world = World {
        geometry: &solids,
        lights: &Lamps::none(),
        media: &media,
    };
    let ray = Ray::new(Vec3::new(0.3, -0.2, 0.5), Vec3::new(0.6, 0.0, 0.8));
    let value = pixel(&world, budget, SAMPLES, None, Channel::Mean, |_| ray);
    let name = format!("furnace {name}");
    vec![Row::random(FAMILY, name, estimate(&value), 1.0, ROUNDING)]
}

/// F4: walls and fog of one temperature show it, whatever they scatter.
fn isothermal(budget: &Budget) -> Vec<Row> {
    let sigma_t = Vec3::new(0.5, 2.0, 1.0);
    let albedo = Vec3::new(0.3, 0.9, 0.0);
    let media = media(MediumParams {
        region: ball(1.0),
        emission: sigma_t * (Vec3::ONE - albedo),
        phase: phase(0.5),
        ..MediumParams::new(sigma_t, albedo)
    });
    let solids = Solids(vec![Solid::room(1.5, 0.4, 0.6)]);
    let world = World {
        geometry: &solids,
        lights: &Lamps::none(),
        media: &media,
    };
    let ray = Ray::new(Vec3::new(0.9, 0.9, 0.0), Vec3::NEG_X);
    channel_rows(budget, ("F4 isothermal", SAMPLES), &world, ray)
}

/// F6: a black card in a white furnace never brightens a pixel, and the more darkens it the larger it is.
fn card(budget: &Budget) -> Vec<Row> {
    const RADII: [f32; 3] = [0.1, 0.3, 0.6];
    let media = fog(2.0, 1.0, ball(1.0), PhaseFunction::Isotropic);
    let mut before: Option<Welford> = None;
    let mut rows = Vec::new();
    for radius in RADII {
        // Beside the view ray, which meets no card.
        let solids = Solids(vec![Solid::black(Shape::Disk {
            center: Vec3::new(0.0, -0.1, 0.0),
            normal: Vec3::Y,
            radius,
        })]);
        let world = World {
            geometry: &solids,
            lights: &Lamps::sky(),
            media: &media,
        };
        let value = pixel(&world, budget, SAMPLES, None, Channel::Mean, |_| view());
        let (limit, error, what) = match before {
            None => (1.0, 0.0, "the sky".to_owned()),
            Some(b) => (b.mean(), b.standard_error(), "a smaller one".to_owned()),
        };
        rows.push(Row::at_most(
            FAMILY,
            format!("furnace F6 card of {radius}: at most as with {what}"),
            (value.mean(), value.standard_error().hypot(error)),
            limit,
            ROUNDING,
        ));
        before = Some(value);
    }
    rows
}

/// F7: without scattering a pixel shows exp(−τ) of the sky, without noise.
fn absorbing(_budget: &Budget) -> Vec<Row> {
    let row = |name: &str, media: &Media, tau: f64| {
        let world = World {
            geometry: &Solids::default(),
            lights: &Lamps::sky(),
            media,
        };
        let one = Budget {
            seed: 0,
            task: 0,
            share: 1.0,
        };
        let value = pixel(&world, &one, 1, None, Channel::Mean, |_| view());
        let exact = (-tau).exp();
        let name = format!("furnace F7 {name}: exp(-τ)");
        // Rounding of the optical depth and of its exponential.
        Row::fixed(
            FAMILY,
            name,
            value.mean(),
            exact,
            1e-6 * (1.0 + tau) * exact,
        )
    };
    let chord = 2.0 * (1.0 - f64::from(0.3_f32).powi(2)).sqrt();
    let everywhere = |density| {
        media(MediumParams {
            density,
            region: Region::Box {
                min: Vec3::splat(-1.0),
                max: Vec3::ONE,
            },
            ..MediumParams::new(Vec3::splat(3.0), Vec3::ZERO)
        })
    };
    // Level at height 0.3, two metres through the box.
    let level = 6.0 * (-f64::from((0.3_f32 + 1.0) / 0.4)).exp();
    vec![
        row(
            "ball",
            &fog(3.0, 0.0, ball(1.0), PhaseFunction::Isotropic),
            3.0 * chord,
        ),
        row("height", &everywhere(HEIGHT), level),
    ]
}

/// F8 with a lamp: intensity π in the centre of an empty grey room of radius 1 makes its wall show 1.
fn lamp(budget: &Budget) -> Vec<Row> {
    let solids = Solids(vec![Solid::room(1.0, 0.5, 0.0)]);
    let world = World {
        geometry: &solids,
        lights: &Lamps::at_origin(PI),
        media: &Media::default(),
    };
    let ray = Ray::new(Vec3::new(0.3, -0.2, 0.5), Vec3::new(0.6, 0.0, 0.8));
    let value = pixel(&world, budget, SAMPLES, None, Channel::Mean, |_| ray);
    let name = "furnace F8 grey, lamp".to_owned();
    vec![Row::random(FAMILY, name, estimate(&value), 1.0, ROUNDING)]
}
