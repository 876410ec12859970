//! Volume files: what is read, what is refused, and that nothing in them makes the reader panic.

#![allow(clippy::unwrap_used, reason = "tests")]

mod broken;
mod openvdb;
mod shared_files;
mod vdb_writer;
mod vol;
