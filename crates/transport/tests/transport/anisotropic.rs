//! Records in media that do not scatter alike in all directions: towards an eye, from a field, and by directions.

use crate::rig::{Estimate, Lamps, Room, fog, sphere};
use glam::Vec3;
use tyndall_math::{Key, Purpose, Ray, Sampler, warp};
use tyndall_media::{Media, PhaseFunction};
use tyndall_transport::World;
use tyndall_transport::field::{CellWidths, Field, Filling};
use tyndall_transport::gather::{self, GatherPattern, Towards, What};
use tyndall_transport::lobe::Lobe;
use tyndall_transport::path::Reach;

const ROOM: Room = Room {
    radius: 1.0,
    reflectance: 0.5,
    emission: 0.0,
};
/// Near enough that directions to it turn fast.
const EYE: Vec3 = Vec3::new(0.0, -0.1, 0.45);
const X: Vec3 = Vec3::new(0.3, -0.24, 0.32);

fn lamp() -> Lamps {
    Lamps::points(&[(Vec3::new(0.1, 0.5, -0.2), 1.0)])
}

fn media(g: f32) -> Media {
    let phase = PhaseFunction::henyey_greenstein(g).unwrap();
    fog(1.0, 0.9, sphere(1.0), phase)
}

fn key(index: u64) -> Key {
    Key {
        seed: 41,
        purpose: Purpose::Record,
        index,
    }
}

fn field(world: &World<'_, Room, Lamps>, seed: u64) -> Field {
    /// Enough for cells around `X`.
    const WALKS: u64 = 30_000;
    let key = Key {
        seed,
        purpose: Purpose::Field,
        index: 0,
    };
    let mut found = Vec::new();
    for walk in 0..WALKS {
        let mut sampler = Sampler::new(key, walk);
        let ray = Ray::new(X, warp::uniform_sphere(sampler.next_2d()));
        Filling::walk(world, ray, &mut sampler, &mut found);
    }
    Field::new(
        world.geometry,
        world.media,
        CellWidths::even(0.0625),
        &found,
    )
}

#[test]
fn gradients_towards_an_eye_are_the_slopes_of_values() {
    let (lamps, media) = (lamp(), media(0.7));
    let world = World {
        geometry: &ROOM,
        lights: &lamps,
        media: &media,
    };
    let pattern = GatherPattern::new(1024);
    let records = 80;
    let field = field(&world, 1);
    // One field for all: it is part of what is differentiated.
    let reach = Reach {
        max_depth: None,
        field: Some(&field),
    };
    let value = |x: Vec3, i: u64| {
        let what = What::Scattered(reach);
        gather::towards(&world, x, Some(Towards::Eye(EYE)), what, &pattern, key(i))
    };
    for (axis, step) in Vec3::AXES.into_iter().enumerate() {
        let h = 0.08;
        let (mut told, mut found) = (Estimate::default(), Estimate::default());
        for i in 0..records {
            told.add(Vec3::from(value(X, i).gradient.map(|d| d[axis])));
            // Not the same keys on both sides: paths would go other ways all the same.
            let rise = value(X + step * h, 100 + i).value - value(X - step * h, 200 + i).value;
            found.add(rise / (2.0 * h));
        }
        let error = told.error().hypot(found.error());
        println!(
            "axis {axis}: {:.5} {:.5} ± {error:.5}",
            told.mean(),
            found.mean()
        );
        // The third derivative's share of a central difference.
        let curved = 0.02 * value(X, 0).gradient[0].length();
        assert!((told.mean() - found.mean()).abs() < 4.0 * error + f64::from(curved));
    }
}

#[test]
fn records_that_end_in_a_field_are_those_of_whole_paths() {
    for g in [-0.4, 0.7] {
        let (lamps, media) = (lamp(), media(g));
        let world = World {
            geometry: &ROOM,
            lights: &lamps,
            media: &media,
        };
        let pattern = GatherPattern::new(1024);
        let (mut ended, mut whole) = (Estimate::default(), Estimate::default());
        for i in 0..8 {
            let field = field(&world, i);
            let reach = Reach {
                max_depth: None,
                field: Some(&field),
            };
            let gathered = |reach, index| {
                let what = What::Scattered(reach);
                gather::towards(
                    &world,
                    X,
                    Some(Towards::Eye(EYE)),
                    what,
                    &pattern,
                    key(index),
                )
                .value
            };
            ended.add(gathered(reach, i));
            for k in 0..4 {
                whole.add(gathered(Reach::default(), 100 + 4 * i + k));
            }
        }
        let error = ended.error().hypot(whole.error());
        println!(
            "g {g}: {:.5} {:.5} ± {error:.5}",
            ended.mean(),
            whole.mean()
        );
    }
}

#[test]
fn directions_of_light_are_scattered_as_records_towards_an_eye_have_it() {
    let (lamps, media) = (lamp(), media(0.4));
    let world = World {
        geometry: &ROOM,
        lights: &lamps,
        media: &media,
    };
    let pattern = GatherPattern::new(4096);
    let what = What::Scattered(Reach::default());
    for w_o in [Vec3::X, -Vec3::Y, Vec3::new(0.48, 0.6, -0.64)] {
        let lobe = Lobe::new(&media.at(X), w_o, 6);
        let (mut held, mut direct) = (Estimate::default(), Estimate::default());
        for i in 0..12 {
            let (mean, bands) = gather::incident(&world, X, what, 6, &pattern, key(i));
            held.add(mean.value + lobe.scatters(&bands));
            let towards = Some(Towards::Direction(w_o));
            direct.add(gather::towards(&world, X, towards, what, &pattern, key(100 + i)).value);
        }
        let error = held.error().hypot(direct.error());
        println!(
            "{w_o}: {:.5} {:.5} ± {error:.5}",
            held.mean(),
            direct.mean()
        );
        // Band 7 and above: 0.4⁷ of what is there.
        assert!((held.mean() - direct.mean()).abs() < 4.0 * error + 2e-3 * direct.mean());
    }
}
