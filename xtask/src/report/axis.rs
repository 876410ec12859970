//! An axis of a chart: its range, its scale and where its ticks stand. Ticks are round numbers, 1, 2 or 5 times a power of
//! ten.

use super::table::rounded;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use std::ops::Range;

/// How values are spaced along an axis.
#[derive(Clone, Copy)]
pub(crate) enum Scale {
    Linear,
    /// For ranges above 0.
    Log,
}

#[derive(Clone)]
pub(crate) struct Axis {
    /// What is drawn, with its unit.
    pub(crate) label: &'static str,
    pub(crate) range: Range<f64>,
    pub(crate) scale: Scale,
}

impl Axis {
    /// Ticks from the start of the range to its end, about `n` where the scale allows.
    fn ticks(&self, n: usize) -> Vec<f64> {
        let Range { start, end } = self.range;
        // An end that is itself a tick may lie outside by a rounding.
        let slack = 1e-9;
        match self.scale {
            Scale::Linear => {
                let least = (end - start) / n as f64;
                let unit = 10_f64.powf(least.log10().floor());
                let steps = [1.0, 2.0, 5.0].map(|step| step * unit);
                let step = steps.into_iter().find(|&step| step >= least);
                let step = step.unwrap_or(10.0 * unit);
                let first = (start / step - slack).ceil() as i64;
                let last = (end / step + slack).floor() as i64;
                (first..=last).map(|k| k as f64 * step).collect()
            }
            Scale::Log => {
                let within = start * (1.0 - slack)..=end * (1.0 + slack);
                let ticks = |steps: &[f64]| -> Vec<f64> {
                    let decades = start.log10().floor() as i32..=end.log10().ceil() as i32;
                    let all =
                        decades.flat_map(|k| steps.iter().map(move |step| step * 10_f64.powi(k)));
                    all.filter(|x| within.contains(x)).collect()
                };
                let fine = ticks(&[1.0, 2.0, 5.0]);
                if fine.len() <= n { fine } else { ticks(&[1.0]) }
            }
        }
    }
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, &x: &f64, (first, last): (i32, i32)) -> i32 {
        let Range { start, end } = self.range;
        let fraction = match self.scale {
            Scale::Linear => (x - start) / (end - start),
            Scale::Log => (x / start).ln() / (end / start).ln(),
        };
        first + (fraction * f64::from(last - first)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        self.ticks(hint.bold_points())
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, &x: &f64) -> String {
        let x = rounded(x, 12);
        if x == 0.0 || (1e-3..1e5).contains(&x.abs()) {
            x.to_string()
        } else {
            format!("{x:e}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(scale: Scale, range: Range<f64>, n: usize, labels: &[&str]) {
        let axis = Axis {
            label: "",
            range,
            scale,
        };
        let found: Vec<_> = axis.ticks(n).iter().map(|x| axis.format_ext(x)).collect();
        assert_eq!(found, labels);
    }

    #[test]
    fn ticks_are_round_numbers_within_the_range() {
        check(
            Scale::Linear,
            -0.25..0.35,
            6,
            &["-0.2", "-0.1", "0", "0.1", "0.2", "0.3"],
        );
        check(Scale::Linear, 0.0..0.6, 4, &["0", "0.2", "0.4", "0.6"]);
        check(Scale::Linear, 0.0..70.0, 4, &["0", "20", "40", "60"]);
        check(
            Scale::Log,
            0.02..5.0,
            9,
            &["0.02", "0.05", "0.1", "0.2", "0.5", "1", "2", "5"],
        );
        check(Scale::Log, 1e-4..0.1, 5, &["1e-4", "0.001", "0.01", "0.1"]);
    }
}
