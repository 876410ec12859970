//! What is computed before the image: the coarse field, records, and how far off they are.
//!
//! A pilot tells how well each part of the light must be known; evaluations held out tell how well it is.

use super::camera::{Camera, Known, Multiple};
use super::field::FilledField;
use super::fill::media::{self, For, Media};
use super::fill::surfaces::{Side, Surfaces};
use super::fill::{Fill, Filled, Kind, Light};
use super::held_out::{HeldOut, Read, Share};
use super::pilot::{Pilot, Plan};
use super::record_map::RecordMap;
use super::view::View;
use super::{FIELD_DEADLINE, FILL_DEADLINE, Run, Way, field, has_passed, is_lit};
use crate::options::MultipleFrom;
use crate::stats::Stats;
use serde::{Deserialize, Serialize};
use tyndall_transport::gather::What;
use tyndall_transport::path::Reach;

/// Standard errors by which an error has to stand out.
const CERTAINTY: f64 = 2.0;

/// What was computed, where it is of use.
#[derive(Clone, Default, Deserialize, Serialize)]
pub(super) struct Prepared {
    /// The views it was computed for.
    pub(super) views: Vec<View>,
    /// How far off its parts may be; `None` where nothing was planned.
    plan: Option<Plan>,
    /// The error that the images it was made for were to have.
    pub(super) error: Option<f32>,
    pub(super) field: Option<FilledField>,
    /// Whether camera rays read multiple scattering from the field itself.
    pub(super) reads_field: bool,
    pub(super) multiple: Option<Filled<media::Known>>,
    /// For whom records of light in media are.
    pub(super) for_whom: For,
    /// Single scattering of light from skies.
    pub(super) sky: Option<Filled<media::Known>>,
    /// Single scattering of all light.
    pub(super) single: Option<Filled<media::Known>>,
    pub(super) surface: Option<Filled<Side>>,
    /// What each part of it adds to the relative error of the image, by layer, where that is known.
    pub(super) shares: Vec<(Light, Option<Share>)>,
    /// Whether the deadline came before all of it was done and measured.
    #[serde(skip)]
    deadline_passed: bool,
    /// Rays of the pilot and of the evaluations.
    #[serde(skip)]
    rays: u64,
}

impl Prepared {
    /// What camera samples read.
    pub(super) fn known(&self) -> Known<'_> {
        let field = self.field.as_ref().map(|filled| &filled.field);
        Known {
            multiple: match &self.multiple {
                Some(filled) => Multiple::Records(&filled.cache),
                None => field
                    .filter(|_| self.reads_field)
                    .map_or(Multiple::None, Multiple::Field),
            },
            sky: self.sky.as_ref().map(|filled| &filled.cache),
            single: self.single.as_ref().map(|filled| &filled.cache),
            for_whom: self.for_whom,
            indirect: self.surface.as_ref().map(|filled| &filled.cache),
        }
    }

    /// Whether nothing was computed ahead.
    pub(super) fn is_empty(&self) -> bool {
        self.field.is_none() && self.shares.is_empty()
    }

    /// Whether the time limit ended any of it.
    pub(super) fn is_cut_short(&self) -> bool {
        self.lacks_records() || self.field.as_ref().is_some_and(|filled| filled.cut_short)
    }

    /// Whether the time limit ended the filling of caches.
    fn lacks_records(&self) -> bool {
        let media = [&self.multiple, &self.sky, &self.single]
            .into_iter()
            .flatten();
        media.into_iter().any(|filled| filled.cut_short)
            || self.surface.as_ref().is_some_and(|filled| filled.cut_short)
            || self.deadline_passed
    }

    /// What each part adds to the relative error of the image, as far as it is known.
    pub(super) fn known_shares(&self) -> impl Iterator<Item = (&'static str, f64)> {
        let shares = self.shares.iter();
        shares.filter_map(|&(light, share)| Some((light.layer(), share?.error())))
    }

    /// The relative error that all of it makes together; `None` where there is something whose error is not known.
    pub(super) fn error(&self) -> Option<f64> {
        let squared = |share: &Option<Share>| share.map(|share| share.squared.max(0.0));
        let sum: Option<f64> = self.shares.iter().map(|(_, share)| squared(share)).sum();
        sum.map(f64::sqrt)
    }

    /// The relative error that all of it makes at least, as far as noise lets that be known.
    pub(super) fn least_error(&self) -> Option<f64> {
        let (mut squared, mut variance) = (0.0, 0.0);
        for (_, share) in &self.shares {
            let share = (*share)?;
            squared += share.squared;
            variance += share.deviation * share.deviation;
        }
        Some((squared - CERTAINTY * variance.sqrt()).max(0.0).sqrt())
    }

    /// Whether it was computed for this view.
    pub(super) fn is_for(&self, view: &View) -> bool {
        self.views.contains(view) && self.for_whom.serves(view)
    }

    /// Adds all records to a map of them.
    pub(super) fn show_records(&self, map: &mut RecordMap<'_>) {
        for filled in [&self.multiple, &self.sky, &self.single] {
            map.add(filled.as_ref().map(|filled| &filled.cache));
        }
        map.add(self.surface.as_ref().map(|filled| &filled.cache));
    }

    /// Counts no ray twice: what the next image tells as its cost is what comes from now on.
    pub(super) fn forget_costs(&mut self) {
        self.rays = 0;
        if let Some(field) = &mut self.field {
            field.rays = 0;
        }
        let media = [&mut self.multiple, &mut self.sky, &mut self.single];
        for filled in media.into_iter().flatten() {
            filled.rays = 0;
        }
        if let Some(filled) = &mut self.surface {
            filled.rays = 0;
        }
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
    /// Computes what samples from new `views` will read, beside what was computed for others.
    pub(super) fn prepare_for(&self, views: &[View], known: Prepared) -> Prepared {
        let error = known.error;
        let mut prepared = if self.is_jarosz08() {
            self.jarosz08(views, known)
        } else if known.plan.is_none() {
            self.prepare(views)
        } else {
            self.extend(views, known)
        };
        prepared.error = error.or(Some(self.error));
        // What the time limit ended is to be gone on with.
        if !prepared.lacks_records() {
            prepared.views.extend(prepared.for_whom.served(views));
        }
        prepared
    }

    /// Computes field and records.
    fn prepare(&self, views: &[View]) -> Prepared {
        let way = self.way;
        let holds_surfaces = self.has_surface_records();
        if way != Way::Records && !holds_surfaces {
            return Prepared::default();
        }
        let for_whom = For::views(self.scene, views, self.error);
        let mut prepared = Prepared {
            for_whom,
            ..Prepared::default()
        };
        let all_views = views;
        let views = &for_whom.served(views)[..];
        let field = self.has_field().then(|| self.field(all_views));
        let reach = self.reach(field.as_ref());
        let pilot = self.pilot(views, reach);
        let plan = pilot.plan(self.error);
        let is_planned = !has_passed(self.deadline(FILL_DEADLINE));
        let held_out = HeldOut {
            scene: self.scene,
            views,
            seed: self.options.seed,
            reach,
            for_whom: prepared.for_whom,
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
            let what = (What::Scattered(reach), prepared.for_whom);
            let kind = self.media(views, what, plan.multiple);
            let in_field = reach
                .field
                .filter(|_| self.options.multiple != MultipleFrom::Records);
            let field_error = in_field.and_then(|field| check(Read::Field(field), kind.n_rays()));
            let allowed = f64::from(Plan::SCATTERED * self.error);
            let is_forced = self.options.multiple == MultipleFrom::Field && in_field.is_some();
            prepared.reads_field =
                is_forced || field_error.is_some_and(|share| share.error() <= allowed);
            let error = if prepared.reads_field {
                field_error
            } else {
                let n_rays = kind.n_rays();
                let filled = self.fill(views, kind, None);
                let error = check(Read::Multiple(&filled.cache), n_rays);
                prepared.multiple = Some(filled);
                error
            };
            prepared.shares.push((Light::Multiple, error));
        }
        if let Some(error) = plan.sky_from(self.options.single)
            && self.may_hold_sky()
        {
            let kind = self.media(views, (What::Sky, prepared.for_whom), error);
            let n_rays = kind.n_rays();
            let filled = self.fill(views, kind, None);
            let error = check(Read::Sky(&filled.cache), n_rays);
            prepared.shares.push((Light::Single, error));
            prepared.sky = Some(filled);
        }
        if holds_surfaces {
            let kind = self.surfaces(reach, prepared.sky.is_some(), plan.surface);
            let (n_rays, sky) = (kind.n_rays(), kind.sky);
            let filled = self.fill(all_views, kind, None);
            let error = check(Read::Surface(&filled.cache, sky), n_rays);
            prepared.shares.push((Light::Surface, error));
            prepared.surface = Some(filled);
        }
        prepared.deadline_passed = has_passed(self.deadline(FILL_DEADLINE));
        prepared.rays = rays;
        prepared.field = field;
        // A pilot that time ended knows too little: who goes on begins anew.
        prepared.plan = is_planned.then_some(plan);
        prepared
    }

    /// Adds the records that `views` miss, by the plan that the others were made by.
    fn extend(&self, views: &[View], mut prepared: Prepared) -> Prepared {
        let Some(plan) = prepared.plan else {
            return prepared;
        };
        let reach = self.reach(prepared.field.as_ref());
        let all_views = views;
        let for_whom = For::views(self.scene, views, self.error);
        let is_served = |view: &View| prepared.for_whom.serves(view);
        // One eye after the other, where records cannot be for all.
        let stays = views.iter().all(is_served)
            || (matches!(for_whom, For::Eye(_)) && views.iter().any(is_served));
        if !stays {
            prepared.for_whom = for_whom;
            prepared.views.clear();
            for filled in [&mut prepared.multiple, &mut prepared.sky] {
                *filled = filled.take().map(|_| Filled::empty());
            }
        }
        let views = &prepared.for_whom.served(views)[..];
        if let Some(filled) = prepared.multiple.take() {
            let what = (What::Scattered(reach), prepared.for_whom);
            let kind = self.media(views, what, plan.multiple);
            prepared.multiple = Some(self.fill(views, kind, Some(filled)));
        }
        if let Some(filled) = prepared.sky.take() {
            let kind = self.media(views, (What::Sky, prepared.for_whom), plan.sky);
            prepared.sky = Some(self.fill(views, kind, Some(filled)));
        }
        if let Some(filled) = prepared.surface.take() {
            let kind = self.surfaces(reach, prepared.sky.is_some(), plan.surface);
            prepared.surface = Some(self.fill(all_views, kind, Some(filled)));
        }
        prepared.deadline_passed = has_passed(self.deadline(FILL_DEADLINE));
        prepared
    }

    /// Whether paths end in a coarse field: where they may be long, and scatter in media as a field knows it.
    fn has_field(&self) -> bool {
        self.way != Way::PathIntegrator
            && is_lit(self.scene)
            && self.max_depth.is_none()
            && (self.way == Way::Records || !self.scene.geometry.is_empty())
    }

    /// Whether indirect light on surfaces is read from records: where paths of these can end in a field.
    fn has_surface_records(&self) -> bool {
        self.has_field() && !self.scene.geometry.is_empty()
    }

    /// Whether light straight from skies may be read from records: where surfaces hide most of them, few samples find it.
    fn may_hold_sky(&self) -> bool {
        self.way == Way::Records
            && self.max_depth.is_none()
            && self.scene.lights.has_even_skies()
            && !self.scene.geometry.is_empty()
    }

    /// How far paths go that may end in a field.
    pub(super) fn reach<'f>(&self, field: Option<&'f FilledField>) -> Reach<'f> {
        Reach {
            max_depth: self.max_depth,
            field: field.map(|filled| &filled.field),
        }
    }

    fn field(&self, views: &[View]) -> FilledField {
        field::fill(
            self.scene,
            views,
            self.options.seed,
            self.error,
            self.deadline(FIELD_DEADLINE),
            self.progress,
        )
    }

    /// Fills a cache for the whole frames of `views`, whatever the crop, so that a crop shows the pixels of the full image; some of it may
    /// be `known`.
    pub(super) fn fill<K: Kind>(
        &self,
        views: &[View],
        kind: K,
        known: Option<Filled<K::Tag>>,
    ) -> Filled<K::Tag> {
        let fill = Fill {
            kind,
            scene: self.scene,
            views,
            seed: self.options.seed,
            deadline: self.deadline(FILL_DEADLINE),
        };
        fill.run(known.unwrap_or_else(Filled::empty), self.progress)
    }

    fn media<'r>(&'r self, views: &[View], what: (What<'r>, For), error: f32) -> Media<'r> {
        Media::new(self.scene, views, what, self.options.seed, error)
    }

    fn surfaces<'r>(&'r self, reach: Reach<'r>, sky: bool, error: f32) -> Surfaces<'r> {
        Surfaces {
            scene: self.scene,
            reach,
            seed: self.options.seed,
            sky,
            error,
        }
    }

    /// Camera samples that read what light there is from the field, or trace it.
    fn pilot(&self, views: &[View], reach: Reach<'_>) -> Pilot {
        let known = Known {
            multiple: match (self.way, reach.field) {
                (Way::Records, Some(field)) => Multiple::Field(field),
                (Way::Records, None) => Multiple::Paths,
                _ => Multiple::None,
            },
            sky: None,
            single: None,
            for_whom: For::Any,
            indirect: None,
        };
        let camera = |view| Camera::new(self.scene, view, reach);
        let deadline = self.deadline(FILL_DEADLINE);
        Pilot::new(camera, views, &known, self.options.seed, deadline)
    }
}
