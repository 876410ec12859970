//! `cargo xtask report radius`: how far a record may be trusted, by the best radius there is and by rules that know only the
//! field at the record. `docs/radius.md` tells what follows.

mod between;
mod field;
mod optimal;
mod rules;
mod tolerance;

use super::Report;
use anyhow::Result;
use optimal::Oracle;

/// Extinction of the fog, 1/m: a row of E5 for a light 1 m away.
const SIGMA_T: f64 = 2.0;

pub(super) fn report() -> Result<Report> {
    let oracle = Oracle::new();
    let (summary, between) = between::report(&oracle)?;
    let tolerance = tolerance::report(&oracle)?;
    Ok(Report {
        summary,
        files: between.into_iter().chain(tolerance).collect(),
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::field::PointLights;
    use super::optimal::Extrapolation;
    use super::*;
    use crate::cargo::workspace;
    use std::fs;

    /// σt d, t and best R/d without gradient, with it, and with that of ln L; `exact-benchmarks.md` E5, one light at d.
    const ONE_LIGHT: [(f64, f64, [f64; 3]); 16] = [
        (0.0, 0.01, [0.0133334061, 0.129117012, 0.164562407]),
        (0.0, 0.05, [0.0666764654, 0.288935268, 0.361251236]),
        (0.0, 0.1, [0.133412281, 0.409003092, 0.500022369]),
        (0.0, 0.2, [0.267296584, 0.579460547, 0.680418363]),
        (0.5, 0.01, [0.0106667988, 0.111383236, 0.149218545]),
        (0.5, 0.05, [0.053349368, 0.249780116, 0.328248839]),
        (0.5, 0.1, [0.106795046, 0.354576836, 0.4554835]),
        (0.5, 0.2, [0.214371719, 0.505417602, 0.622592825]),
        (2.0, 0.01, [0.00666680435, 0.0772406696, 0.118745147]),
        (2.0, 0.05, [0.0333508246, 0.174008281, 0.263383737]),
        (2.0, 0.1, [0.0668071618, 0.248470518, 0.36881733]),
        (2.0, 0.2, [0.134474085, 0.358618302, 0.511936722]),
        (8.0, 0.01, [0.00266674205, 0.0327190851, 0.0738203181]),
        (8.0, 0.05, [0.0133427953, 0.0740462468, 0.167940627]),
        (8.0, 0.1, [0.0267427388, 0.106349133, 0.242250726]),
        (8.0, 0.2, [0.0539522358, 0.155486477, 0.354190924]),
    ];

    /// σt d, t and best R/d midway between two equal lights, where all three extrapolations are one.
    const MIDWAY: [(f64, f64, f64); 4] = [
        (0.0, 0.05, 0.291064769),
        (0.0, 0.2, 0.595512718),
        (2.0, 0.05, 0.174508267),
        (2.0, 0.2, 0.363035555),
    ];

    /// Relative. Radii here are good to 1e-9 (see [`optimal`]); those of E5 were found 1.2e-4 off at most, at σt d = 8 and
    /// t = 0.2, and 1.4e-6 without gradient.
    const E5_ERROR: f64 = 1.5e-4;

    fn check(lights: &[f64], sigma_t: f64, t: f64, extrapolation: Extrapolation, expected: f64) {
        let field = PointLights {
            sigma_t,
            lights: lights.to_vec(),
        };
        let found = Oracle::new().valid_radius(&field, 0.0, extrapolation, t);
        assert!(
            (found / expected - 1.0).abs() < E5_ERROR,
            "σt {sigma_t}, t {t}, lights {lights:?}: {found} instead of {expected}"
        );
    }

    #[test]
    fn best_radii_by_one_light_are_those_of_e5() {
        for (sigma_t, t, [constant, linear, logarithmic]) in ONE_LIGHT {
            check(&[1.0], sigma_t, t, Extrapolation::Constant, constant);
            check(&[1.0], sigma_t, t, Extrapolation::Linear, linear);
            check(&[1.0], sigma_t, t, Extrapolation::Logarithmic, logarithmic);
        }
    }

    #[test]
    fn best_radii_between_two_lights_are_those_of_e5() {
        for (sigma_t, t, expected) in MIDWAY {
            check(&[-1.0, 1.0], sigma_t, t, Extrapolation::Constant, expected);
            check(&[-1.0, 1.0], sigma_t, t, Extrapolation::Linear, expected);
            check(
                &[-1.0, 1.0],
                sigma_t,
                t,
                Extrapolation::Logarithmic,
                expected,
            );
        }
    }

    #[test]
    fn the_hessian_rule_errs_by_half_the_tolerance_at_most() {
        let check = |lights: &[f64], sigma_t: f64, t: f64, expected: f64| {
            let field = PointLights {
                sigma_t,
                lights: lights.to_vec(),
            };
            let found = rules::hessian(&field.local(0.0), t);
            // Exact as t → 0; found to be off by 0.49 t at most, in a vacuum.
            assert!(
                (found / expected - 1.0).abs() < 0.5 * t,
                "σt {sigma_t}, t {t}, lights {lights:?}: {found} instead of {expected}"
            );
        };
        for (sigma_t, t, [_, _, expected]) in ONE_LIGHT {
            check(&[1.0], sigma_t, t, expected);
        }
        for (sigma_t, t, expected) in MIDWAY {
            check(&[-1.0, 1.0], sigma_t, t, expected);
        }
        for sigma_t in [0.0, 0.5, 2.0, 8.0] {
            let field = PointLights {
                sigma_t,
                lights: vec![1.0],
            };
            let best = Oracle::new().valid_radius(&field, 0.0, Extrapolation::Logarithmic, 1e-4);
            check(&[1.0], sigma_t, 1e-4, best);
        }
    }

    #[test]
    fn committed_numbers_are_what_the_code_computes() {
        let files = report().unwrap().files;
        for file in files.iter().filter(|file| file.name.ends_with(".csv")) {
            let committed = fs::read_to_string(workspace().join("docs").join(file.name)).unwrap();
            let cells = |text| str::split(text, [',', '\n']);
            assert_eq!(cells(&file.text).count(), cells(&committed).count());
            for (found, committed) in cells(&file.text).zip(cells(&committed)) {
                // The last of six digits may be rounded the other way on another machine.
                let same = match (found.parse::<f64>(), committed.parse::<f64>()) {
                    (Ok(a), Ok(b)) => a == b || (a - b).abs() < 2e-5 * b.abs(),
                    _ => found == committed,
                };
                assert!(same, "{}: {found}, committed {committed}", file.name);
            }
        }
    }
}
