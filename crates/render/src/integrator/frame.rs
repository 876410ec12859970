//! One frame: its samples, what its error is believed to be, and what its user should know.

use super::checkpoint::OfFrame;
use super::estimate::Estimate;
use super::prepare::Prepared;
use super::record_map::RecordMap;
use super::sampling::Sampling;
use super::stages::State;
use super::summary::{notes, summary};
use super::view::View;
use super::{Outcome, Run};
use crate::error::RenderError;
use crate::stats::Stats;
use std::time::Instant;

/// Least and greatest share of the target error that noise may take where the field or records are read; the rest is left to these. The
/// least, where their error is not known.
const NOISE_SHARES: [f64; 2] = [0.6, 0.85];

/// One frame to be rendered.
pub(super) struct Frame<'f> {
    pub(super) run: &'f Run<'f>,
    pub(super) prepared: &'f Prepared,
    pub(super) view: View,
    pub(super) seed: u64,
}

impl Frame<'_> {
    /// Renders the frame, from a state that an earlier process left where there is one.
    pub(super) fn render(
        &self,
        known: Option<State>,
        checkpoint: &mut OfFrame<'_>,
    ) -> Result<Outcome, RenderError> {
        let Self { run, prepared, .. } = *self;
        let mut stats = Stats::default();
        prepared.count(&mut stats);
        let layers = run.options.layers_of(run.scene);

        let rendering = Instant::now();
        let sampling = Sampling {
            run,
            view: self.view,
            seed: self.seed,
            known: prepared.known(),
            reach: run.reach(prepared.field.as_ref()),
            layers: &layers,
            target: self.noise_target(),
        };
        let (mut film, tally, timed_out) = sampling.run(known, checkpoint)?;
        stats.error_shares.extend(prepared.known_shares());
        if let Some(noise) = film.relative_error() {
            stats.error_shares.insert("noise", noise);
        }
        stats.spp = film.mean_samples();
        film.fill_gaps();
        stats.render_s = rendering.elapsed().as_secs_f64();

        let estimating = Instant::now();
        let estimate = Estimate {
            scene: run.scene,
            view: self.view,
            max_depth: run.max_depth,
            seed: self.seed,
            deadline: run.deadline(1.0),
        };
        let (error, estimate_tally) = estimate.run(&film, run.progress);
        stats.estimated_error = error;
        stats.estimate_s = estimating.elapsed().as_secs_f64();

        stats.rays += tally.rays + estimate_tally.rays;
        stats.lookups = tally.lookups;
        stats.lookups_missed = tally.missed;
        let cut_short = timed_out || prepared.is_cut_short();
        let cancelled = cut_short && run.progress.is_cancelled();
        let mut image = film.image();
        let mut map = RecordMap::new(&run.scene.geometry, self.view, run.crop);
        prepared.show_records(&mut map);
        map.show(&mut image);
        Ok(Outcome {
            notes: notes(run, prepared, &tally, &stats, timed_out),
            summary: summary(run, prepared, &stats),
            image,
            stats,
            timed_out: cut_short && !cancelled,
            cancelled,
        })
    }

    /// The noise up to which samples are taken, beside the error of what was prepared: errors add in squares.
    fn noise_target(&self) -> f64 {
        let error = f64::from(self.run.error);
        if self.prepared.is_empty() {
            return error;
        }
        let [least, most] = NOISE_SHARES;
        let own = self.prepared.error();
        let left = own.map(|own| 1.0 - (own / error).powi(2));
        error * left.unwrap_or(0.0).max(0.0).sqrt().clamp(least, most)
    }
}
