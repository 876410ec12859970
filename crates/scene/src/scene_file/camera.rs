//! Cameras of a scene file: one view, views to move through, or one of the glTF's.

use super::numbers::{Direction, FieldOfView, FrameNumber, Position};
use crate::camera;
use crate::camera_path::{CameraKey, CameraPath, CameraPathError};
use glam::Vec3;
use serde::Deserialize;
use serde::de::{DeserializeSeed, Deserializer, Error, SeqAccess, Visitor};
use std::fmt;

/// Where a scene is seen from.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub enum Camera {
    /// From one point towards another.
    LookAt(LookAt),
    /// From frame to frame along a smooth curve.
    Path(Path),
    /// Through the glTF camera of this name.
    Gltf(String),
}

/// `LookAt(eye: (0, 1, 4), target: (0, 1, 0), up: (0, 1, 0), vfov: 40)`, known to be a camera.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "LookAtFields")]
pub struct LookAt(pub camera::Camera);

#[derive(Deserialize)]
#[serde(rename = "LookAt", deny_unknown_fields)]
struct LookAtFields {
    eye: Position,
    target: Position,
    #[serde(default = "straight_up")]
    up: Direction,
    vfov: FieldOfView,
}

fn straight_up() -> Direction {
    Direction(Vec3::Y)
}

impl TryFrom<LookAtFields> for LookAt {
    type Error = camera::CameraError;

    fn try_from(fields: LookAtFields) -> Result<Self, Self::Error> {
        let yfov = fields.vfov.get().to_radians();
        camera::Camera::look_at(fields.eye.0, fields.target.0, fields.up.0, yfov).map(Self)
    }
}

/// `Key(frame: 0, eye: (0, 1, 4), target: (0, 1, 0), up: (0, 1, 0), vfov: 40)`, known to be a camera.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(try_from = "KeyFields")]
pub struct Key(pub CameraKey);

#[derive(Deserialize)]
#[serde(rename = "Key", deny_unknown_fields)]
struct KeyFields {
    frame: FrameNumber,
    eye: Position,
    target: Position,
    #[serde(default = "straight_up")]
    up: Direction,
    vfov: FieldOfView,
}

impl TryFrom<KeyFields> for Key {
    type Error = CameraPathError;

    fn try_from(fields: KeyFields) -> Result<Self, Self::Error> {
        let yfov = fields.vfov.get().to_radians();
        let (eye, target, up) = (fields.eye.0, fields.target.0, fields.up.0);
        CameraKey::new(fields.frame.get(), eye, target, up, yfov).map(Self)
    }
}

/// `Path([Key(frame: 0, …), Key(frame: 47, …)])`: at least one key, and frames that increase.
#[derive(Clone, Debug, PartialEq)]
pub struct Path(pub CameraPath);

impl<'de> Deserialize<'de> for Path {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(Keys)
    }
}

/// Reads the keys one by one, so that a key at the wrong frame is reported where it stands.
struct Keys;

impl<'de> Visitor<'de> for Keys {
    type Value = Path;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list of keys")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut keys: A) -> Result<Path, A::Error> {
        let mut path = None;
        while keys.next_element_seed(NextKey(&mut path))?.is_some() {}
        path.map(Path).ok_or_else(|| {
            A::Error::custom("a path has at least one key, as in [Key(frame: 0, …)]")
        })
    }
}

/// Reads a key and goes on to it.
struct NextKey<'p>(&'p mut Option<CameraPath>);

impl<'de> DeserializeSeed<'de> for NextKey<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        let Key(key) = Key::deserialize(deserializer)?;
        match self.0 {
            Some(path) => path.push(key).map_err(D::Error::custom),
            None => {
                *self.0 = Some(CameraPath::new(key));
                Ok(())
            }
        }
    }
}
