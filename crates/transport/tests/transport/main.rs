//! Light transport against exact solutions, and its samplers against their densities.
#![allow(clippy::unwrap_used, reason = "tests")]
#![allow(
    clippy::print_stdout,
    reason = "a failing table is easier to read whole"
)]

mod anisotropic;
mod exact;
mod field;
mod inscatter;
mod light_choice;
mod rig;
mod samplers;
mod second_order;
mod shafts;
mod sky;
mod stage;
