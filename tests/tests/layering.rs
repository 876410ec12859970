//! The crates depend on each other only in the direction that ARCHITECTURE.md draws, and on one glam.

#![allow(clippy::unwrap_used, reason = "tests")]

use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use tyndall_tests::program::{cargo, workspace};

/// Every crate of the graph with all it may depend on: whatever lies below it.
/// math ← media ← transport ← scene ← render ← cli; math ← cache ← render.
const BELOW: &[(&str, &[&str])] = &[
    ("tyndall-math", &[]),
    ("tyndall-media", &["tyndall-math"]),
    ("tyndall-transport", &["tyndall-math", "tyndall-media"]),
    (
        "tyndall-scene",
        &["tyndall-math", "tyndall-media", "tyndall-transport"],
    ),
    ("tyndall-cache", &["tyndall-math"]),
    (
        "tyndall-render",
        &[
            "tyndall-math",
            "tyndall-media",
            "tyndall-transport",
            "tyndall-scene",
            "tyndall-cache",
        ],
    ),
    (
        "tyndall-cli",
        &[
            "tyndall-math",
            "tyndall-media",
            "tyndall-transport",
            "tyndall-scene",
            "tyndall-cache",
            "tyndall-render",
        ],
    ),
];

/// Packages that stand outside the graph and on which nothing may depend.
const OUTSIDE: &[&str] = &["xtask", "tyndall-tests"];

/// The workspace's packages, each with the packages it depends on in any way, tests and builds included.
fn dependencies() -> BTreeMap<String, Vec<String>> {
    let metadata = cargo(&["metadata", "--no-deps", "--format-version=1"]);
    let metadata: Value = serde_json::from_str(&metadata).unwrap();
    let name = |value: &Value| value["name"].as_str().unwrap().to_owned();
    let packages = metadata["packages"].as_array().unwrap().iter();
    packages
        .map(|package| {
            let dependencies = package["dependencies"].as_array().unwrap();
            (name(package), dependencies.iter().map(name).collect())
        })
        .collect()
}

#[test]
fn no_crate_depends_upwards_or_sideways() {
    let packages = dependencies();
    for (package, below) in BELOW {
        for dependency in &packages[*package] {
            let own = packages.contains_key(dependency);
            let allowed = below.contains(&dependency.as_str());
            assert!(!own || allowed, "{package} must not depend on {dependency}");
        }
    }
}

#[test]
fn every_package_has_its_place_in_the_graph() {
    for package in dependencies().keys() {
        let placed = BELOW.iter().any(|(name, _)| name == package);
        assert!(
            placed || OUTSIDE.contains(&package.as_str()),
            "where does {package} belong?"
        );
    }
}

#[test]
fn there_is_one_glam() {
    let lock = fs::read_to_string(workspace().join("Cargo.lock")).unwrap();
    assert_eq!(
        lock.lines()
            .filter(|line| *line == "name = \"glam\"")
            .count(),
        1
    );
}

#[test]
fn the_cache_is_usable_without_scenes_and_images() {
    let tree = cargo(&[
        "tree",
        "--package=tyndall-cache",
        "--edges=normal",
        "--prefix=none",
    ]);
    for heavy in ["gltf", "exr", "obvhs", "image"] {
        let found = tree
            .lines()
            .any(|line| line.split(' ').next() == Some(heavy));
        assert!(!found, "tyndall-cache brings in {heavy}");
    }
}
