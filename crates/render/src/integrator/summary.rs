//! What the user is told when a frame is done: what was switched on, and what to beware of.

use super::camera::Tally;
use super::prepare::Prepared;
use super::{Run, Way};
use crate::stats::Stats;

/// An image errs more than asked where its error is this many times that; what is held out tells errors with some error of its own.
const TOLERATED: f64 = 1.25;

/// What to beware of.
pub(super) fn notes(
    run: &Run<'_>,
    prepared: &Prepared,
    tally: &Tally,
    stats: &Stats,
    timed_out: bool,
) -> Vec<String> {
    let mut notes = Vec::new();
    if tally.dropped > 0 {
        notes.push(format!(
            "{} camera samples were not finite and count as black: this is a bug, please report it with the scene",
            tally.dropped
        ));
    }
    // Who cancels a render knows why it is short of what was asked.
    let is_cancelled = run.progress.is_cancelled();
    if prepared.is_cut_short() && !is_cancelled {
        notes.push(
            "the time limit ended the filling of the cache: where light is not known paths are traced, with more noise"
                .to_owned(),
        );
    }
    if stats.spp < 1.0 && !is_cancelled {
        notes.push(
            "the time limit left rows of the image without samples: they repeat their neighbours"
                .to_owned(),
        );
    }
    if timed_out && !is_cancelled {
        notes.push(format!(
            "the time limit ended the render after {:.1} samples per pixel; the image is the best so far",
            stats.spp
        ));
    }
    let field = prepared.field.as_ref();
    if field.is_some_and(|filled| filled.unsure && !filled.cut_short) {
        notes.push(
            "few walks through the fog find the lights: the image may be too dark; `--integrator path` or thinner fog would tell"
                .to_owned(),
        );
    }
    let tolerated = TOLERATED * f64::from(run.error);
    if let Some(error) = prepared.error()
        && prepared
            .least_error()
            .is_some_and(|least| least > tolerated)
        && run.options.spp.is_none()
    {
        notes.push(short_of_error(prepared, error));
    }
    notes
}

/// Says that what was computed ahead errs more than the image may, and which part of it most.
fn short_of_error(prepared: &Prepared, error: f64) -> String {
    let worst = prepared.known_shares().max_by(|a, b| a.1.total_cmp(&b.1));
    let (layer, share) = worst.unwrap_or_default();
    format!(
        "the error asked for may not be met: light known ahead of the image is off by {:.1} % of it, most of that ({:.1} %) in the \
         `{layer}` layer; a smaller --error gives more and better records",
        100.0 * error,
        100.0 * share
    )
}

/// What was switched on, in one line.
pub(super) fn summary(run: &Run<'_>, prepared: &Prepared, stats: &Stats) -> String {
    let count = |kind: &str| grouped(stats.records.get(kind).copied().unwrap_or(0));
    let surface = count("surface");
    let how_single = match (&prepared.sky, &prepared.single) {
        (Some(_), _) => format!("{} records of skies, else direct", count("single")),
        (_, Some(_)) => format!("{} records", count("single")),
        (None, None) => "direct".to_owned(),
    };
    let sh = sh(prepared);
    let found = match run.way {
        Way::PathIntegrator => "integrator: path".to_owned(),
        Way::NoMultiple => format!("records: {surface} surface; single: {how_single}; SH: {sh}"),
        Way::Records if prepared.reads_field => {
            format!(
                "multiple: coarse field; records: {surface} surface; single: {how_single}; SH: {sh}"
            )
        }
        Way::Records => format!(
            "records: {} multiple, {surface} surface; single: {how_single}; SH: {sh}",
            count("multiple")
        ),
    };
    let method = if run.is_jarosz08() {
        "; method: jarosz08"
    } else {
        ""
    };
    format!("{}; {found}{method}", run.scene.summary())
}

/// To which band directions of light are held.
fn sh(prepared: &Prepared) -> String {
    let order = prepared
        .field
        .as_ref()
        .map_or(0, |filled| filled.field.order());
    if order == 0 {
        "off".to_owned()
    } else {
        format!("order {order}")
    }
}

/// A number with its thousands set apart.
fn grouped(n: u64) -> String {
    if n < 1000 {
        n.to_string()
    } else {
        format!("{} {:03}", grouped(n / 1000), n % 1000)
    }
}
