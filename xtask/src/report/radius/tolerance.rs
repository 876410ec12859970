//! The second figure: how the best radius grows with the tolerance, a metre from a single light, and what extrapolation by a
//! gradient is worth.

use super::field::PointLights;
use super::optimal::{Extrapolation, Oracle};
use super::{SIGMA_T, rules};
use crate::report::File;
use crate::report::axis::{Axis, Scale};
use crate::report::plot::{Chart, Line};
use crate::report::table::Table;
use anyhow::Result;

const LABELS: [&str; 4] = [
    "best radius without gradient",
    "best radius with the gradient of L",
    "best radius with the gradient of ln L",
    "√(10 t / (3 mean |w·H w|)), H the Hessian of ln L, w directions",
];

/// The figure and its numbers.
pub(super) fn report(oracle: &Oracle) -> Result<[File; 2]> {
    let field = PointLights {
        sigma_t: SIGMA_T,
        lights: vec![1.0],
    };
    let local = field.local(0.0);
    // Tolerances from 0.001 to 0.2, twenty a decade.
    let rows = (-60..=-14).map(|i| {
        let t = 10_f64.powf(f64::from(i) / 20.0);
        let best = |extrapolation| oracle.valid_radius(&field, 0.0, extrapolation, t);
        vec![
            t,
            best(Extrapolation::Constant),
            best(Extrapolation::Linear),
            best(Extrapolation::Logarithmic),
            rules::hessian(&local, t),
        ]
    });
    let table = Table {
        columns: vec!["t", "constant_m", "linear_m", "logarithmic_m", "hessian_m"],
        rows: rows.collect(),
    };
    let lines = LABELS.iter().enumerate().map(|(i, label)| Line {
        label: (*label).to_owned(),
        points: table.rows.iter().map(|row| (row[0], row[i + 1])).collect(),
    });
    let chart = Chart {
        title: format!("Radius of a record 1 m from a light, in fog of σt = {SIGMA_T}/m"),
        x: Axis {
            label: "relative error allowed t",
            range: 0.001..0.2,
            scale: Scale::Log,
        },
        y: Axis {
            label: "radius R (m)",
            range: 0.0005..1.0,
            scale: Scale::Log,
        },
        lines: lines.collect(),
    };
    Ok([
        File {
            name: "radius_tolerance.svg",
            text: chart.svg()?,
        },
        File {
            name: "radius_tolerance.csv",
            text: table.csv(),
        },
    ])
}
