//! What the glTF reader promises, on tiny files made here.

#![allow(clippy::unwrap_used, reason = "a failing test panics")]

mod accessors;
mod animations;
mod files;
mod geometry;
mod hostile;
mod materials;
mod scenes;
mod shared_files;
