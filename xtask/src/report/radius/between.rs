//! The first figure: rules for a record's radius against the best one, along a line through two point lights. It is the
//! picture of Jarosz et al. 2008, "Radiance caching for participating media", with second derivatives added.

use super::field::PointLights;
use super::optimal::{Extrapolation, Oracle};
use super::{SIGMA_T, rules};
use crate::report::File;
use crate::report::axis::{Axis, Scale};
use crate::report::plot::{Chart, Line};
use crate::report::table::Table;
use anyhow::Result;

/// Relative error allowed over a record's ball; one of E5's.
const TOLERANCE: f64 = 0.05;
/// The lights stand at x = ±1 m.
const LIGHTS: [f64; 2] = [-1.0, 1.0];
/// Records from −2.5 m to 2.5 m, this many a metre.
const PER_METRE: i32 = 50;

/// The radii at one place, in metres.
struct Radii {
    x: f64,
    optimal: f64,
    /// One for each of [`RULES`].
    rules: [f64; 4],
}

/// Column and label of each rule.
const RULES: [(&str, &str); 4] = [
    ("sum_of_norms_m", "α ΣL / Σ‖∇L‖"),
    ("norm_of_sum_m", "α ΣL / ‖Σ∇L‖"),
    (
        "hessian_m",
        "√(10 t / (3 mean |w·H w|)), H the Hessian of ln L, w directions",
    ),
    ("hessian_bound_m", "κ √(10 t / Σ|λ|), λ its eigenvalues"),
];

/// A summary for the terminal, the figure and its numbers.
pub(super) fn report(oracle: &Oracle) -> Result<(String, [File; 2])> {
    let (alpha, kappa) = constants(oracle);
    let radii = radii(oracle, alpha, kappa);
    let chart = Chart {
        title: format!(
            "Radius of a record between two lights: fog of σt = {SIGMA_T}/m, relative error t = {TOLERANCE}"
        ),
        x: Axis {
            label: "place of the record x (m); the lights are at −1 and 1",
            range: -2.5..2.5,
            scale: Scale::Linear,
        },
        y: Axis {
            label: "radius R (m)",
            range: 0.0..0.6,
            scale: Scale::Linear,
        },
        lines: lines(&radii, alpha, kappa),
    };
    let files = [
        File {
            name: "radius.svg",
            text: chart.svg()?,
        },
        File {
            name: "radius.csv",
            text: table(&radii).csv(),
        },
    ];
    Ok((summary(&radii, alpha, kappa), files))
}

/// α and κ, with which the rules give the best radius of a record 1 m from a single light.
fn constants(oracle: &Oracle) -> (f64, f64) {
    let one = PointLights {
        sigma_t: SIGMA_T,
        lights: vec![0.0],
    };
    let best = oracle.valid_radius(&one, 1.0, Extrapolation::Logarithmic, TOLERANCE);
    let local = one.local(1.0);
    (
        best / rules::sum_of_norms(&local, 1.0),
        best / rules::hessian_bound(&local, TOLERANCE, 1.0),
    )
}

/// Along the line, except in the lights.
fn radii(oracle: &Oracle, alpha: f64, kappa: f64) -> Vec<Radii> {
    let field = PointLights {
        sigma_t: SIGMA_T,
        lights: LIGHTS.to_vec(),
    };
    let half = 5 * PER_METRE / 2;
    let places = (-half..=half).map(|i| f64::from(i) / f64::from(PER_METRE));
    places
        .filter(|x| !LIGHTS.contains(x))
        .map(|x| {
            let local = field.local(x);
            Radii {
                x,
                optimal: oracle.valid_radius(&field, x, Extrapolation::Logarithmic, TOLERANCE),
                rules: [
                    rules::sum_of_norms(&local, alpha),
                    rules::norm_of_sum(&local, alpha),
                    rules::hessian(&local, TOLERANCE),
                    rules::hessian_bound(&local, TOLERANCE, kappa),
                ],
            }
        })
        .collect()
}

fn lines(radii: &[Radii], alpha: f64, kappa: f64) -> Vec<Line> {
    let optimal = Line {
        label: "best radius of a record that extrapolates ln L by its gradient".to_owned(),
        points: radii.iter().map(|r| (r.x, r.optimal)).collect(),
    };
    let constants = [
        format!(", α = {alpha:.4}"),
        ", the same α".to_owned(),
        String::new(),
        format!(", κ = {kappa:.4}"),
    ];
    let rules = RULES.iter().zip(constants).enumerate();
    let rules = rules.map(|(i, ((_, label), constant))| Line {
        label: format!("{label}{constant}"),
        points: radii.iter().map(|r| (r.x, r.rules[i])).collect(),
    });
    [optimal].into_iter().chain(rules).collect()
}

fn table(radii: &[Radii]) -> Table {
    let columns = ["x_m", "optimal_m"].into_iter();
    let rows = radii.iter();
    Table {
        columns: columns.chain(RULES.map(|(column, _)| column)).collect(),
        rows: rows
            .map(|r| [&[r.x, r.optimal], &r.rules[..]].concat())
            .collect(),
    }
}

/// The constants, and how many times the best radius each rule gives.
fn summary(radii: &[Radii], alpha: f64, kappa: f64) -> String {
    let mut summary = format!("alpha {alpha:.5}, kappa {kappa:.5}\n");
    summary += "rule / best          least   median     most   midway\n";
    for (i, (column, _)) in RULES.iter().enumerate() {
        let ratio = |r: &Radii| r.rules[i] / r.optimal;
        let mut ratios: Vec<_> = radii.iter().map(ratio).collect();
        ratios.sort_by(f64::total_cmp);
        let midway = radii.iter().filter(|r| r.x == 0.0).map(ratio);
        summary += &format!("{column:16}");
        let shown = [
            ratios[0],
            ratios[ratios.len() / 2],
            ratios[ratios.len() - 1],
        ];
        for ratio in shown.into_iter().chain(midway) {
            summary += &format!(" {ratio:8.4}");
        }
        summary += "\n";
    }
    summary
}
