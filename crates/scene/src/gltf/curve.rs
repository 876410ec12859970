//! How an animation moves one property of a node: values at keyframes, and what runs between them (glTF 2.0, 3.11 and
//! appendix C).

use super::accessor::{Accessors, Expected};
use super::error::GltfError;
use super::nodes::MIN_ROTATION;
use crate::hermite;
use ::gltf::json::accessor::Type;
use ::gltf::json::animation::{Interpolation, Property, Sampler};
use ::gltf::json::validation::Checked;
use glam::{DQuat, DVec3, DVec4, Vec4};

/// Latest keyframe in seconds, some 28 hours.
const MAX_TIME: f32 = 1e5;

/// Values of a property over time.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Curve {
    /// Never empty, in order of time.
    keyframes: Vec<Keyframe>,
    interpolation: Interpolation,
}

/// A value at one time. Vectors of three have 0 in w.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Keyframe {
    /// Seconds.
    time: f32,
    value: Vec4,
    /// Slope per second at which the curve comes in; read where interpolation is cubic.
    arriving: Vec4,
    /// Slope per second at which the curve goes out; read where interpolation is cubic.
    leaving: Vec4,
}

impl Curve {
    /// Reads the curve of `property`, which is a translation, rotation or scale, from the sampler that `pointer` names.
    pub(super) fn read(
        accessors: Accessors<'_>,
        sampler: &Sampler,
        property: Property,
        pointer: &str,
    ) -> Result<Self, GltfError> {
        let Checked::Valid(interpolation) = sampler.interpolation else {
            return Err(GltfError::value(
                format!("{pointer}/interpolation"),
                "an unknown name",
                "allowed are LINEAR, STEP and CUBICSPLINE",
            ));
        };
        let times = times(accessors, sampler, &format!("{pointer}/input"))?;
        let cubic = interpolation == Interpolation::CubicSpline;
        let type_ = match property {
            Property::Rotation => Type::Vec4,
            _ => Type::Vec3,
        };
        let (per_keyframe, reason) = if cubic {
            (3, "three elements per keyframe (slope, value, slope)")
        } else {
            (1, "one element per keyframe")
        };
        let expected = Expected {
            types: &[type_],
            plain_integers: false,
            count: Some((times.len().saturating_mul(per_keyframe), reason)),
        };
        let at = format!("{pointer}/output");
        let values = accessors.floats::<4>(sampler.output, &at, expected, 0.0)?;
        let mut keyframes = Vec::with_capacity(times.len());
        for (&time, values) in times.iter().zip(values.chunks(per_keyframe)) {
            let (arriving, value, leaving) = match *values {
                [arriving, value, leaving] => (arriving.into(), value.into(), leaving.into()),
                [value] => (Vec4::ZERO, value.into(), Vec4::ZERO),
                _ => continue,
            };
            let keyframe = Keyframe {
                time,
                value,
                arriving,
                leaving,
            };
            keyframe.check(property, &at)?;
            keyframes.push(keyframe);
        }
        Ok(Self {
            keyframes,
            interpolation,
        })
    }

    /// Times of the first and the last keyframe in seconds.
    pub(super) fn span(&self) -> [f32; 2] {
        [self.keyframes.first(), self.keyframes.last()].map(|key| key.map_or(0.0, |key| key.time))
    }

    /// The vector at `time` in seconds.
    pub(super) fn vector(&self, time: f32) -> DVec3 {
        self.at(time, |from, to, u| from.lerp(to, u)).truncate()
    }

    /// The rotation at `time` in seconds; `None` where a cubic between two rotations passes through zero.
    pub(super) fn rotation(&self, time: f32) -> Option<DQuat> {
        let unit = |v: DVec4| DQuat::from_vec4(v.normalize_or(DVec4::W));
        let q = self.at(time, |from, to, u| unit(from).slerp(unit(to), u).into());
        (q.length() >= MIN_ROTATION).then(|| unit(q))
    }

    /// The value at `time`, linear interpolation being `between`. The first and the last value hold beyond their keyframes.
    fn at(&self, time: f32, between: impl Fn(DVec4, DVec4, f64) -> DVec4) -> DVec4 {
        let next = self.keyframes.partition_point(|key| key.time <= time);
        let (past, future) = self.keyframes.split_at(next);
        let (from, to) = match (past.last(), future.first()) {
            (Some(from), Some(to)) => (from, to),
            (Some(only), None) | (None, Some(only)) => (only, only),
            (None, None) => return DVec4::ZERO,
        };
        let length = f64::from(to.time) - f64::from(from.time);
        if length == 0.0 {
            return from.value.as_dvec4();
        }
        let u = (f64::from(time) - f64::from(from.time)) / length;
        let (start, end) = (from.value.as_dvec4(), to.value.as_dvec4());
        match self.interpolation {
            Interpolation::Linear => between(start, end, u),
            Interpolation::Step => start,
            Interpolation::CubicSpline => {
                let [a, ma, b, mb] = hermite::weights(u);
                a * start
                    + ma * length * from.leaving.as_dvec4()
                    + b * end
                    + mb * length * to.arriving.as_dvec4()
            }
        }
    }
}

impl Keyframe {
    /// Fails unless all is finite, and a rotation one.
    fn check(&self, property: Property, pointer: &str) -> Result<(), GltfError> {
        let wrong = |found: String, allowed: &str| Err(GltfError::value(pointer, found, allowed));
        let time = self.time;
        for v in [self.value, self.arriving, self.leaving] {
            if !v.is_finite() {
                return wrong(
                    format!("{v} at {time} s"),
                    "values of keyframes must be finite",
                );
            }
        }
        let is_rotation = property == Property::Rotation;
        if is_rotation && self.value.as_dvec4().length() < MIN_ROTATION {
            return wrong(
                format!("a rotation of length 0 at {time} s"),
                "a unit quaternion is needed",
            );
        }
        Ok(())
    }
}

/// The keyframes' times in seconds: at least one, increasing strictly from 0 on.
fn times(
    accessors: Accessors<'_>,
    sampler: &Sampler,
    pointer: &str,
) -> Result<Vec<f32>, GltfError> {
    let expected = Expected {
        types: &[Type::Scalar],
        plain_integers: false,
        count: None,
    };
    let times: Vec<f32> = accessors
        .floats::<1>(sampler.input, pointer, expected, 0.0)?
        .into_iter()
        .flatten()
        .collect();
    let mut before = None;
    for &time in &times {
        if !(0.0..=MAX_TIME).contains(&time) {
            return Err(GltfError::value(
                pointer,
                format!("a keyframe at {time} s"),
                format!("keyframes lie from 0 to {MAX_TIME} s"),
            ));
        }
        if let Some(before) = before.filter(|&before| time <= before) {
            return Err(GltfError::value(
                pointer,
                format!("a keyframe at {time} s after one at {before} s"),
                "times must increase from keyframe to keyframe",
            ));
        }
        before = Some(time);
    }
    if times.is_empty() {
        return Err(GltfError::value(
            pointer,
            "an animation without keyframes",
            "at least one is needed",
        ));
    }
    Ok(times)
}
