//! What the workspace's own tests share: the `tyndall` program, small images, and the comparison with golden images.
//!
//! The tests themselves are in `tests/`: the contract, bad inputs, golden images, and the layering of the crates.

pub mod golden;
pub mod image;
pub mod program;
pub mod readers;
pub mod room;

/// Compiles and runs the example of the workspace's README.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;
