//! Values of options as text: lists of numbers, fog, crops, times.
//!
//! Each function says what is allowed; clap puts the option and what was found in front.

use std::ops::Range;
use std::time::Duration;
use tyndall_render::error::RenderError;
use tyndall_render::layers::LayerSet;
use tyndall_render::options::{Crop, Depth};
use tyndall_scene::Fog;
use tyndall_scene::scene_file::numbers::Stops;

/// A point or direction `X,Y,Z`.
pub(crate) fn vector(text: &str) -> Result<[f32; 3], String> {
    <[f32; 3]>::try_from(numbers(text)?).map_err(|_| "three numbers X,Y,Z are wanted".to_owned())
}

/// A size in GiB, as bytes.
pub(crate) fn gibibytes(text: &str) -> Result<u64, String> {
    match text.parse::<f64>() {
        Ok(size) if size > 0.0 && size.is_finite() => Ok((size * f64::from(1 << 30)) as u64),
        _ => Err("a size in GiB above 0 is wanted".to_owned()),
    }
}

/// Fog as `SIGMA_T[,ALBEDO[,G]]`.
pub(crate) fn fog(text: &str) -> Result<Fog, String> {
    let numbers = numbers(text)?;
    let fog = match *numbers.as_slice() {
        [sigma_t] => Fog::new(sigma_t),
        [sigma_t, albedo] => Fog {
            albedo,
            ..Fog::new(sigma_t)
        },
        [sigma_t, albedo, g] => Fog { sigma_t, albedo, g },
        _ => return Err("one to three numbers SIGMA_T[,ALBEDO[,G]] are wanted".to_owned()),
    };
    if fog.sigma_t < 0.0 {
        return Err("the extinction SIGMA_T must be at least 0 per metre".to_owned());
    }
    if !(0.0..=1.0).contains(&fog.albedo) {
        return Err("the albedo must be from 0 to 1".to_owned());
    }
    if fog.g.abs() >= 1.0 {
        return Err("the asymmetry G must be above -1 and below 1".to_owned());
    }
    Ok(fog)
}

/// A crop `X,Y,W,H`.
pub(crate) fn crop(text: &str) -> Result<Crop, String> {
    text.parse().map_err(allowed)
}

/// A path depth, or `none`.
pub(crate) fn depth(text: &str) -> Result<Depth, String> {
    text.parse().map_err(allowed)
}

/// Frames of one command, at most: each view's places for records have random numbers of their own.
const MOST_FRAMES: usize = 1 << 16;

/// Numbers of frames, `A..B` without B or `A..=B` with it.
pub(crate) fn frames(text: &str) -> Result<Range<u32>, String> {
    let range = text.split_once("..").and_then(|(first, end)| {
        let first: u32 = first.trim().parse().ok()?;
        let end = match end.strip_prefix('=') {
            Some(last) => last.trim().parse::<u32>().ok()?.checked_add(1)?,
            None => end.trim().parse().ok()?,
        };
        Some(first..end)
    });
    let is_sound = |range: &Range<u32>| !range.is_empty() && range.len() <= MOST_FRAMES;
    range.filter(is_sound).ok_or_else(|| {
        format!("frames A..B with A below B, at most {MOST_FRAMES}, are wanted, as in 0..48")
    })
}

/// A list of layers.
pub(crate) fn layers(text: &str) -> Result<LayerSet, String> {
    text.parse().map_err(allowed)
}

/// A number of seconds.
pub(crate) fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.trim().parse::<f64>().ok();
    let duration = seconds.and_then(|s| Duration::try_from_secs_f64(s).ok());
    duration.ok_or_else(|| "a number of seconds from 0 is wanted".to_owned())
}

/// A finite number.
pub(crate) fn finite(text: &str) -> Result<f32, String> {
    match *numbers(text)?.as_slice() {
        [number] => Ok(number),
        _ => Err("one number is wanted".to_owned()),
    }
}

/// A number of stops, in the range that the scene file allows.
pub(crate) fn stops(text: &str) -> Result<f32, String> {
    let stops = Stops::try_from(f64::from(finite(text)?));
    stops.map(Stops::get).map_err(str::to_owned)
}

/// What an error allows, without the option and the value that clap already names.
fn allowed(error: RenderError) -> String {
    match error {
        RenderError::Option { allowed, .. } => format!("it must be {allowed}"),
        other => other.to_string(),
    }
}

fn numbers(text: &str) -> Result<Vec<f32>, String> {
    let number = |part: &str| part.trim().parse::<f32>().ok().filter(|n| n.is_finite());
    text.split(',')
        .map(number)
        .collect::<Option<_>>()
        .ok_or_else(|| "finite numbers are wanted, with commas between".to_owned())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;

    #[test]
    fn fog_takes_one_to_three_numbers_in_range() {
        assert_eq!(
            fog("0.1").unwrap(),
            Fog {
                sigma_t: 0.1,
                albedo: 0.95,
                g: 0.0
            }
        );
        assert_eq!(
            fog("0.1,0.5").unwrap(),
            Fog {
                sigma_t: 0.1,
                albedo: 0.5,
                g: 0.0
            }
        );
        assert_eq!(
            fog("0.1, 1, -0.7").unwrap(),
            Fog {
                sigma_t: 0.1,
                albedo: 1.0,
                g: -0.7
            }
        );
        for bad in [
            "",
            "x",
            "-1",
            "nan",
            "inf",
            "1e400",
            "0.1,1.5",
            "0.1,-0.1",
            "0.1,0.9,1",
            "0.1,0.9,0.5,2",
            "0.1,,0.5",
        ] {
            assert!(fog(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn times_are_finite_and_not_negative() {
        assert_eq!(seconds("1.5").unwrap(), Duration::from_millis(1500));
        assert_eq!(seconds("0").unwrap(), Duration::ZERO);
        for bad in ["", "-1", "nan", "inf", "1e30", "10 s"] {
            assert!(seconds(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn vectors_are_three_finite_numbers() {
        assert_eq!(vector("-1,0.5, 2").unwrap(), [-1.0, 0.5, 2.0]);
        for bad in ["1,2", "1,2,3,4", "1,2,nan", "a,b,c"] {
            assert!(vector(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn messages_say_what_is_allowed_without_repeating_what_was_found() {
        assert_eq!(
            crop("1,2").unwrap_err(),
            "it must be four whole numbers X,Y,W,H in pixels"
        );
        assert!(layers("beauty,x").unwrap_err().contains("transmittance"));
    }
}
