//! `cargo xtask report derivatives`: how well gradients and Hessians of gathered light know that silhouettes move, by the number
//! of gather directions. `docs/derivatives.md` tells what follows.

mod candidates;
mod disc;
mod quads;

use super::axis::{Axis, Scale};
use super::plot::{Chart, Line};
use super::table::Table;
use super::{File, Report};
use anyhow::Result;
use candidates::Pattern;
use disc::{Disc, Source};
use glam::{DMat3, DQuat, DVec3, Vec3};
use quads::{Floodlight, Quads};
use tyndall_math::{Key, Purpose, Sampler, SphericalFibonacci};
use tyndall_media::Media;
use tyndall_transport::World;
use tyndall_transport::gather::{Derivatives, GatherPattern, multiple_towards};
use tyndall_transport::path::Reach;

const DIRECTIONS: [u32; 6] = [256, 512, 1024, 2048, 4096, 8192];
/// Gather points.
const PLACES: u64 = 8;
/// Random rotations at each of them.
const TURNS: u64 = 32;

/// Column and label.
const VACUUM: [(&str, &str); 8] = [
    ("blind", "occlusion-blind: area form"),
    ("far_vertex", "triangles of the farthest vertex"),
    ("strata", "walls between strata"),
    ("voronoi", "Voronoi borders at the nearer depth"),
    (
        "kept",
        "kept: area form and silhouettes with κ, one set of directions",
    ),
    (
        "rendered",
        "the same as rendered: 16 sets of a 16th of the directions",
    ),
    (
        "far_vertex_hessian",
        "Hessian, triangles of the farthest vertex",
    ),
    ("voronoi_hessian", "Hessian, Voronoi borders"),
];

const FOG: [(&str, &str); 6] = [
    ("glow_blind", "glowing fog, occlusion-blind"),
    ("glow_aware", "glowing fog, aware"),
    (
        "lamp_blind",
        "lamp in fog 30° from the rim, occlusion-blind",
    ),
    ("lamp_aware", "lamp in fog 30° from the rim, aware"),
    (
        "lamp_beside_blind",
        "lamp in fog 5° to 10° from the rim, occlusion-blind",
    ),
    (
        "lamp_beside_aware",
        "lamp in fog 5° to 10° from the rim, aware",
    ),
];

/// A scene with a table of errors: what it is, its files, its columns, and a row for a number of directions.
struct Part {
    title: &'static str,
    svg: &'static str,
    csv: &'static str,
    columns: &'static [(&'static str, &'static str)],
    row: fn(u32) -> Result<Vec<f64>>,
}

const PARTS: [Part; 3] = [
    Part {
        title: "Gradient of a square light behind a square occluder: RMS relative error",
        svg: "derivatives.svg",
        csv: "derivatives.csv",
        columns: &VACUUM,
        row: |n| Ok(vacuum(Quads::CROSSING, n)),
    },
    Part {
        title: "The same, the shadow within the light: RMS relative error",
        svg: "derivatives_within.svg",
        csv: "derivatives_within.csv",
        columns: &VACUUM,
        row: |n| Ok(vacuum(Quads::WITHIN, n)),
    },
    Part {
        title: "Gradient of a record in fog with a black disc: RMS relative error",
        svg: "derivatives_fog.svg",
        csv: "derivatives_fog.csv",
        columns: &FOG,
        row: fog,
    },
];

pub(super) fn report() -> Result<Report> {
    let mut summary = String::new();
    let mut files = Vec::new();
    for part in PARTS {
        let rows: Result<_> = DIRECTIONS.into_iter().map(part.row).collect();
        let columns = part.columns.iter().map(|(column, _)| *column);
        let table = Table {
            columns: ["directions"].into_iter().chain(columns).collect(),
            rows: rows?,
        };
        let text = table.csv();
        summary += &format!("{}\n{text}\n", part.title);
        files.push(File {
            name: part.svg,
            text: chart(&part, &table.rows).svg()?,
        });
        files.push(File {
            name: part.csv,
            text,
        });
    }
    Ok(Report { summary, files })
}

/// Errors of gradients over the number of directions.
fn chart(part: &Part, rows: &[Vec<f64>]) -> Chart {
    let gradients = part.columns.iter().enumerate();
    let gradients = gradients.filter(|(_, (column, _))| !column.ends_with("_hessian"));
    let lines: Vec<_> = gradients
        .map(|(i, (_, label))| Line {
            label: (*label).to_owned(),
            points: rows.iter().map(|row| (row[0], row[i + 1])).collect(),
        })
        .collect();
    let errors = lines.iter().flat_map(|line| &line.points);
    let (least, most) = errors.fold((f64::INFINITY, 0.0_f64), |(least, most), &(_, error)| {
        (least.min(error), most.max(error))
    });
    Chart {
        title: part.title.to_owned(),
        x: Axis {
            label: "directions",
            range: f64::from(DIRECTIONS[0])..f64::from(DIRECTIONS[DIRECTIONS.len() - 1]),
            scale: Scale::Log,
        },
        y: Axis {
            label: "relative error",
            range: 0.8 * least..1.25 * most,
            scale: Scale::Log,
        },
        lines,
    }
}

/// Squares of relative errors.
#[derive(Clone, Copy, Default)]
struct Squares {
    sum: f64,
    n: u32,
}

impl Squares {
    fn push(&mut self, relative: f64) {
        self.sum += relative * relative;
        self.n += 1;
    }

    fn root_mean(&self) -> f64 {
        (self.sum / f64::from(self.n)).sqrt()
    }

    fn push_vector(&mut self, found: DVec3, exact: DVec3) {
        self.push(found.distance(exact) / exact.length());
    }

    fn push_matrix(&mut self, found: DMat3, exact: DMat3) {
        let norm = |m: DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
        self.push(norm(found - exact) / norm(exact));
    }
}

fn key(index: u64) -> Key {
    Key {
        seed: 1,
        purpose: Purpose::Probe,
        index,
    }
}

/// The key of random rotation `i` at a place.
fn trial(n: u32, place: usize, i: u64) -> Key {
    key((u64::from(n) << 32) | ((place as u64) << 16) | i)
}

/// Points up to `reach` metres from the origin along each axis.
fn places(reach: f32) -> impl Iterator<Item = Vec3> {
    (0..PLACES).map(move |i| {
        let mut sampler = Sampler::new(key(0), i);
        let u: [f32; 3] = std::array::from_fn(|_| sampler.next_1d());
        (Vec3::from(u) - 0.5) * (2.0 * reach)
    })
}

/// The errors of [`VACUUM`] for `n` directions, after that number.
fn vacuum(quads: Quads, n: u32) -> Vec<f64> {
    let media = Media::new(Vec::new());
    let world = World {
        geometry: &quads,
        lights: &Floodlight,
        media: &media,
    };
    let pattern = Pattern::new(n);
    let rendered = GatherPattern::new(n as usize);
    let mut errors = [Squares::default(); VACUUM.len()];
    for (place, x) in places(0.15).enumerate() {
        let (gradient, hessian) = (quads.gradient(x.as_dvec3()), quads.hessian(x.as_dvec3()));
        for i in 0..TURNS {
            let key = trial(n, place, i);
            let mut sampler = Sampler::new(key, 0);
            let [u, v] = sampler.next_2d();
            let turn = SphericalFibonacci::new(1, [u, v, sampler.next_1d()]).rotation();
            let turn: DQuat = turn.as_dquat().normalize();
            let seen = pattern.see(&quads, x.as_dvec3(), turn);
            let (far_vertex, far_vertex_hessian) = pattern.far_vertex(&seen);
            let (voronoi, voronoi_hessian) = pattern.voronoi(&seen, turn);
            let mut sampler = Sampler::new(key, 1);
            let strata = candidates::strata(&quads, x.as_dvec3(), n as usize, turn, &mut sampler);
            let aware = Derivatives::Aware;
            let gathered = multiple_towards(
                &world,
                x,
                None,
                &rendered,
                aware,
                Reach::depth(Some(2)),
                key,
            );
            let gradients = [
                pattern.blind(&seen),
                far_vertex,
                strata,
                voronoi,
                pattern.kept(&seen, turn),
                gathered.gradient[0].as_dvec3(),
            ];
            for (error, found) in errors.iter_mut().zip(gradients) {
                error.push_vector(found, gradient);
            }
            for (error, found) in errors[gradients.len()..]
                .iter_mut()
                .zip([far_vertex_hessian, voronoi_hessian])
            {
                error.push_matrix(found, hessian);
            }
        }
    }
    let errors = errors.iter().map(Squares::root_mean);
    [f64::from(n)].into_iter().chain(errors).collect()
}

/// The errors of [`FOG`] for `n` directions, after that number.
fn fog(n: u32) -> Result<Vec<f64>> {
    let disc = Disc::new();
    let pattern = GatherPattern::new(n as usize);
    let mut row = vec![f64::from(n)];
    for source in [Source::Glow, Source::LAMP, Source::LAMP_BESIDE] {
        let media = source.media()?;
        let world = World {
            geometry: &disc,
            lights: &source,
            media: &media,
        };
        let depth = Some(source.depth());
        let mut errors = [Squares::default(); 2];
        for (place, x) in places(0.25).enumerate() {
            let exact = source.gradient(&disc, x.as_dvec3());
            for i in 0..TURNS {
                let key = trial(n, place, i);
                let ways = [Derivatives::Blind, Derivatives::Aware];
                for (error, derivatives) in errors.iter_mut().zip(ways) {
                    let found = multiple_towards(
                        &world,
                        x,
                        None,
                        &pattern,
                        derivatives,
                        Reach::depth(depth),
                        key,
                    );
                    error.push_vector(found.gradient[0].as_dvec3(), exact);
                }
            }
        }
        row.extend(errors.iter().map(Squares::root_mean));
    }
    Ok(row)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use crate::cargo::workspace;
    use std::fs;

    #[test]
    fn committed_numbers_are_what_the_code_computes() {
        for part in PARTS {
            let csv = fs::read_to_string(workspace().join("docs").join(part.csv)).unwrap();
            let line = csv.lines().nth(1).unwrap();
            let committed: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
            // The smallest number of directions stands for all: larger ones take minutes.
            let found = (part.row)(DIRECTIONS[0]).unwrap();
            assert_eq!(found.len(), committed.len());
            for (found, committed) in found.iter().zip(committed) {
                // On another machine a ray may pass the other side of an edge, one in very many.
                assert!(
                    (found / committed - 1.0).abs() < 0.02,
                    "{}: {found}, committed {committed}",
                    part.csv
                );
            }
        }
    }
}
