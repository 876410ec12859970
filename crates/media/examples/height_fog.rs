//! How far can one see in a morning fog that thins out with height? Transmittance from eye level, by elevation.
//!
//! Run with `cargo run -p tyndall-media --example height_fog`.

#![allow(clippy::print_stdout, reason = "an example shows its result")]

use glam::Vec3;
use tyndall_math::Ray;
use tyndall_media::{Density, Media, Medium, MediumError, MediumParams};

fn main() -> Result<(), MediumError> {
    // A mean free path of 100 m on the ground, thinning to 1/e every 20 m; blue is scattered a little more than red.
    let fog = Medium::new(MediumParams {
        name: "morning fog".to_owned(),
        density: Density::Height {
            base: 0.0,
            scale_height: 20.0,
        },
        ..MediumParams::new(Vec3::new(0.009, 0.010, 0.012), Vec3::splat(0.97))
    })?;
    let media = Media::new(vec![fog]);
    let eye = Vec3::new(0.0, 1.7, 0.0);
    let distances = [10.0, 50.0, 200.0, 1000.0, f32::INFINITY];

    println!(
        "green transmittance over a distance, and the distance at which half the light is gone"
    );
    print!("elevation");
    for t in distances {
        print!("{t:>9.0} m");
    }
    println!("       half");
    for degrees in [90.0_f32, 45.0, 10.0, 2.0, 0.0, -1.0] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let ray = Ray::new(eye, Vec3::new(cos, sin, 0.0));
        print!("{degrees:>8}°");
        for t in distances {
            let transmittance = (-media.optical_depth(&ray, t)).exp();
            print!("{:>11.5}", transmittance.y);
        }
        let segment = media.segment(&ray, f32::INFINITY);
        match segment.distance_at(1, std::f32::consts::LN_2) {
            Some(t) => println!("{t:>9.1} m"),
            None => println!("      never"),
        }
    }
    Ok(())
}
