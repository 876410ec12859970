//! What is computed before the image: the coarse field, records, and how far off they are.
//!
//! A pilot tells how well each part of the light must be known; evaluations held out tell how well it is.

use super::camera::{Camera, Known, Multiple};
use super::field::FilledField;
use super::fill::Filled;
use super::fill::media::{Holds, Media};
use super::fill::surfaces::{Side, Surfaces};
use super::held_out::{HeldOut, Read};
use super::pilot::{Pilot, Plan};
use super::record_map::RecordMap;
use super::{FILL_DEADLINE, Run, Way, has_passed};
use crate::image::Image;
use crate::options::{Crop, MultipleFrom};
use crate::stats::Stats;
use tyndall_transport::path::Reach;
use tyndall_transport::walls::Walls;

/// What was computed, where it is of use.
#[derive(Default)]
pub(super) struct Prepared {
    pub(super) field: Option<FilledField>,
    /// Whether camera rays read multiple scattering from the field itself.
    pub(super) reads_field: bool,
    pub(super) multiple: Option<Filled<Walls>>,
    /// Single scattering of light from skies.
    pub(super) sky: Option<Filled<Walls>>,
    /// Single scattering of all light.
    pub(super) single: Option<Filled<Walls>>,
    pub(super) surface: Option<Filled<Side>>,
    /// What each part of it adds to the relative error of the image, by layer, where that is known.
    pub(super) shares: Vec<(&'static str, Option<f64>)>,
    /// Whether the deadline came before all of it was done and measured.
    pub(super) deadline_passed: bool,
    /// Rays of the pilot and of the evaluations.
    pub(super) rays: u64,
}

impl Prepared {
    /// What camera samples read.
    pub(super) fn known(&self, way: Way) -> Known<'_> {
        let field = self.field.as_ref().map(|filled| &filled.field);
        Known {
            multiple: match (&self.multiple, way) {
                (Some(filled), _) => Multiple::Records(&filled.cache),
                (None, Way::Paths) => Multiple::Paths,
                (None, _) => field
                    .filter(|_| self.reads_field)
                    .map_or(Multiple::None, Multiple::Field),
            },
            sky: self.sky.as_ref().map(|filled| &filled.cache),
            single: self.single.as_ref().map(|filled| &filled.cache),
            indirect: self.surface.as_ref().map(|filled| &filled.cache),
        }
    }

    /// Whether nothing was computed ahead.
    pub(super) fn is_empty(&self) -> bool {
        self.field.is_none() && self.shares.is_empty()
    }

    /// Whether the time limit ended any of it.
    pub(super) fn is_cut_short(&self) -> bool {
        let media = [&self.multiple, &self.sky, &self.single]
            .into_iter()
            .flatten();
        media.into_iter().any(|filled| filled.cut_short)
            || self.surface.as_ref().is_some_and(|filled| filled.cut_short)
            || self.field.as_ref().is_some_and(|filled| filled.cut_short)
            || self.deadline_passed
    }

    /// What each part adds to the relative error of the image, as far as it is known.
    pub(super) fn known_shares(&self) -> impl Iterator<Item = (&'static str, f64)> {
        let shares = self.shares.iter();
        shares.filter_map(|&(layer, share)| Some((layer, share?)))
    }

    /// The relative error that all of it makes together; `None` where there is something whose error is not known.
    pub(super) fn error(&self) -> Option<f64> {
        let squared = |share: &Option<f64>| share.map(|share| share * share);
        let sum: Option<f64> = self.shares.iter().map(|(_, share)| squared(share)).sum();
        sum.map(f64::sqrt)
    }

    /// Shows the records in the layers of `image`, the part `crop` of the frame, that are for that.
    pub(super) fn show_records(&self, crop: Crop, image: &mut Image) {
        let mut map = RecordMap::new(crop);
        for filled in [&self.multiple, &self.sky, &self.single] {
            map.add(filled.as_ref());
        }
        map.add(self.surface.as_ref());
        map.show(image);
    }

    /// Tells `stats` what it cost.
    pub(super) fn count(&self, stats: &mut Stats) {
        let field = self.field.as_ref().map_or(0, |filled| filled.rays);
        stats.rays += field + self.rays;
        let mut add = |kind: &str, rays: u64, records: usize| {
            stats.rays += rays;
            stats.records.insert(kind.to_owned(), records as u64);
        };
        let single = self.single.as_ref().or(self.sky.as_ref());
        for (kind, filled) in [("multiple", self.multiple.as_ref()), ("single", single)] {
            if let Some(filled) = filled {
                add(kind, filled.rays, filled.cache.len());
            }
        }
        if let Some(filled) = &self.surface {
            add("surface", filled.rays, filled.cache.len());
        }
    }
}

impl Run<'_> {
    /// Computes what samples on this `way` will read.
    pub(super) fn prepare(&self, way: Way) -> Prepared {
        if self.is_jarosz08() {
            return self.jarosz08(way);
        }
        let holds_surfaces = self.has_surface_records(way);
        if way != Way::Records && !holds_surfaces {
            return Prepared::default();
        }
        let mut prepared = Prepared::default();
        let field = self.has_field(way).then(|| self.field());
        let reach = self.reach(field.as_ref());
        let pilot = self.pilot(way, reach);
        let plan = pilot.plan(self.error);
        let held_out = HeldOut {
            scene: self.scene,
            frame: self.frame,
            seed: self.options.seed,
            reach,
            pilot: &pilot,
            deadline: self.deadline(FILL_DEADLINE),
        };
        let mut rays = pilot.rays;
        let mut check = |read: Read<'_>, n_rays: usize| {
            let (error, more) = held_out.error(read, n_rays);
            rays += more;
            error
        };
        if way == Way::Records {
            let kind = self.media(Holds::Multiple(reach), plan.multiple);
            let in_field = reach
                .field
                .filter(|_| self.options.multiple != MultipleFrom::Records);
            let field_error = in_field.and_then(|field| check(Read::Field(field), kind.n_rays()));
            let allowed = f64::from(Plan::SCATTERED * self.error);
            let is_forced = self.options.multiple == MultipleFrom::Field && in_field.is_some();
            prepared.reads_field = is_forced || field_error.is_some_and(|error| error <= allowed);
            let error = if prepared.reads_field {
                field_error
            } else {
                let n_rays = kind.n_rays();
                let filled = self.fill(kind);
                let error = check(Read::Multiple(&filled.cache), n_rays);
                prepared.multiple = Some(filled);
                error
            };
            prepared.shares.push(("multiple", error));
        }
        if let Some(error) = plan.sky(self.options.single)
            && self.may_hold_sky(way)
        {
            let kind = self.media(Holds::Sky, error);
            let n_rays = kind.n_rays();
            let filled = self.fill(kind);
            let error = check(Read::Sky(&filled.cache), n_rays);
            prepared.shares.push(("single", error));
            prepared.sky = Some(filled);
        }
        if holds_surfaces {
            let kind = Surfaces {
                scene: self.scene,
                frame: self.frame,
                reach,
                seed: self.options.seed,
                sky: prepared.sky.is_some(),
                error: plan.surface,
            };
            let (n_rays, sky) = (kind.n_rays(), kind.sky);
            let filled = self.fill(kind);
            let error = check(Read::Surface(&filled.cache, sky), n_rays);
            prepared.shares.push(("surface", error));
            prepared.surface = Some(filled);
        }
        prepared.deadline_passed = has_passed(self.deadline(FILL_DEADLINE));
        prepared.rays = rays;
        prepared.field = field;
        prepared
    }

    fn media<'s>(&'s self, holds: Holds<'s>, error: f32) -> Media<'s> {
        Media::new(self.scene, self.frame, holds, self.options.seed, error)
    }

    /// Camera samples that read what light there is from the field, or trace it.
    fn pilot(&self, way: Way, reach: Reach<'_>) -> Pilot {
        let known = Known {
            multiple: match (way, reach.field) {
                (Way::Records, Some(field)) => Multiple::Field(field),
                (Way::Records | Way::Paths, _) => Multiple::Paths,
                _ => Multiple::None,
            },
            sky: None,
            single: None,
            indirect: None,
        };
        let camera = || Camera::new(self.scene, self.frame, reach);
        let deadline = self.deadline(FILL_DEADLINE);
        Pilot::new(camera, self.frame, &known, self.options.seed, deadline)
    }
}
