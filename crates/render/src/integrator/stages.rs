//! What samples are taken of a frame, stage by stage, and where a render stands that goes on later.
//!
//! Path-traced images, and those of a fixed number, get equally many samples everywhere. Else a pilot of a few tiles finds the rule by
//! which blocks of pixels ask for samples; then the part of the frame that is asked for gets its first samples, and those of the rule.

use super::camera::Tally;
use super::sampling::Sampling;
use super::{PILOT_DEADLINE, RENDER_DEADLINE, Run};
use crate::error::RenderError;
use crate::film::Film;
use crate::noise::{MOST_SAMPLES, Region, Rule, pilot, whole_blocks, with_margin};
use crate::options::{Crop, Integrator};
use serde::{Deserialize, Serialize};
use tyndall_math::{Key, Purpose};

/// Samples per pixel before the noise is believed.
const FIRST_SAMPLES: u32 = 8;
/// By how much the samples of a path-traced image may grow at once.
const GROWTH: f64 = 4.0;
/// Keeps the numbers of the pilot's places from those of its samples.
const PLACES: u64 = 1 << 32;

/// Where the sampling of a frame stands. A pixel's samples have an order of their own, so that whoever goes on from here gets the sums
/// that he would have without a break, whichever pixels have come closer to their goals by now.
#[derive(Deserialize, Serialize)]
pub(super) struct State {
    stage: Stage,
    /// How many samples the pixels of each of the stage's films are to have.
    pub(super) goals: Vec<Vec<u32>>,
    /// What the samples cost that this process took.
    #[serde(skip)]
    pub(super) tally: Tally,
}

#[derive(Deserialize, Serialize)]
enum Stage {
    /// Equally many samples everywhere.
    Even { film: Film, goal: u32 },
    /// First samples of the pilot's tiles and of the pixels around them.
    PilotBegins { begun: Vec<Film> },
    /// More samples of the pilot's tiles, by a rule that they change.
    Pilot {
        begun: Vec<Film>,
        regions: Vec<Region>,
        rule: Rule,
    },
    /// First samples of the part of the frame that is asked for, with pixels around it.
    PartBegins {
        begun: Film,
        regions: Vec<Region>,
        rule: Rule,
    },
    /// More samples of that part.
    Part { region: Region, rule: Rule },
    /// The one row that is always taken, where that stood around the part.
    Gaps { film: Film },
}

/// What follows a stage.
pub(super) enum Next {
    Stage(State),
    /// The film of the part asked for, and what it cost.
    End(Film, Tally),
}

impl Stage {
    fn films(&mut self) -> Vec<&mut Film> {
        match self {
            Self::Even { film, .. } | Self::Gaps { film } => vec![film],
            Self::PilotBegins { begun } => begun.iter_mut().collect(),
            Self::Pilot { regions, .. } => regions.iter_mut().map(|r| &mut r.film).collect(),
            Self::PartBegins { begun, .. } => vec![begun],
            Self::Part { region, .. } => vec![&mut region.film],
        }
    }
}

impl State {
    /// The films that get samples, and how many their pixels are to have.
    pub(super) fn films(&mut self) -> (Vec<&mut Film>, &[Vec<u32>]) {
        (self.stage.films(), &self.goals)
    }

    /// The share of a time limit that may be gone when the stage ends: a pilot leaves some for the image itself.
    pub(super) fn deadline(&self) -> f64 {
        match self.stage {
            Stage::PilotBegins { .. } | Stage::Pilot { .. } => PILOT_DEADLINE,
            _ => RENDER_DEADLINE,
        }
    }

    /// A stage whose pixels are all to have as many samples.
    fn even(mut stage: Stage, goal: u32, tally: Tally) -> Self {
        let films = stage.films();
        let goals = films.iter().map(|film| vec![goal; film.len()]).collect();
        Self {
            stage,
            goals,
            tally,
        }
    }
}

impl Sampling<'_> {
    /// The first stage.
    pub(super) fn begin(&self) -> Result<State, RenderError> {
        let (options, tally) = (self.run.options, Tally::default());
        if options.integrator == Integrator::Path || options.spp.is_some() {
            // Samples that decide where more are taken would bias the ground truth.
            let film = self.film(self.run.crop)?;
            let goal = options.spp.unwrap_or(FIRST_SAMPLES);
            return Ok(State::even(Stage::Even { film, goal }, goal, tally));
        }
        let frame = self.run.frame;
        let begun = self.pilot().into_iter();
        let begun = begun.map(|tile| self.film(with_margin(tile, frame)));
        let begun = begun.collect::<Result<_, _>>()?;
        let stage = Stage::PilotBegins { begun };
        Ok(State::even(stage, FIRST_SAMPLES, tally))
    }

    /// What follows where all goals of a stage are met, or where the end came before that, and is to be kept short.
    pub(super) fn next(&self, state: State, is_met: bool) -> Result<Next, RenderError> {
        let tally = state.tally;
        match state.stage {
            Stage::Even { film, goal } => Ok(self.more_evenly(film, goal, is_met, tally)),
            Stage::PilotBegins { begun } => {
                let tiles = self.pilot().into_iter().zip(&begun);
                let regions = tiles
                    .map(|(tile, first)| self.region(tile, first))
                    .collect::<Result<Vec<Region>, _>>()?;
                self.more_of_pilot(begun, regions, tally)
            }
            Stage::Pilot { begun, regions, .. } if is_met => {
                self.more_of_pilot(begun, regions, tally)
            }
            Stage::Pilot {
                begun,
                regions,
                rule,
            } => self.begin_part(&begun, regions, rule, tally),
            Stage::PartBegins {
                begun,
                regions,
                rule,
            } => {
                let mut region = self.region(self.part(), &begun)?;
                for of_pilot in &regions {
                    region.film.adopt(&of_pilot.film);
                }
                if region.film.has_gaps() {
                    self.end(&region, tally)
                } else {
                    self.more_of_part(region, rule, tally)
                }
            }
            Stage::Part { region, rule } if is_met => self.more_of_part(region, rule, tally),
            Stage::Part { region, .. } => self.end(&region, tally),
            Stage::Gaps { film } => Ok(Next::End(film, tally)),
        }
    }

    /// More samples everywhere, as long as the noise is too much.
    fn more_evenly(&self, film: Film, goal: u32, is_met: bool, tally: Tally) -> Next {
        if !is_met {
            return Next::End(film, tally);
        }
        let error = film.relative_error();
        // Where it is not a number there is nothing to aim at.
        let short = error.filter(|error| *error > self.target && goal < MOST_SAMPLES);
        let Some(error) = short.filter(|_| self.run.options.spp.is_none()) else {
            return Next::End(film, tally);
        };
        let factor = (error / self.target).powi(2).clamp(1.1, GROWTH);
        let goal = ((f64::from(goal) * factor).ceil() as u32 + 1).min(MOST_SAMPLES) & !1;
        Next::Stage(State::even(Stage::Even { film, goal }, goal, tally))
    }

    /// More samples of the pilot where it asks for them.
    fn more_of_pilot(
        &self,
        begun: Vec<Film>,
        regions: Vec<Region>,
        tally: Tally,
    ) -> Result<Next, RenderError> {
        let (rule, noise) = Rule::new(&regions, self.target);
        let goals: Vec<Vec<u32>> = regions.iter().map(|region| rule.goals(region)).collect();
        let mut wanted = regions.iter().zip(&goals);
        let is_met = wanted.all(|(region, goals)| region.meets(goals));
        // Where the noise is not a number there is nothing to aim at.
        if noise.is_nan() || noise <= self.target || is_met {
            return self.begin_part(&begun, regions, rule, tally);
        }
        let stage = Stage::Pilot {
            begun,
            regions,
            rule,
        };
        Ok(Next::Stage(State {
            stage,
            goals,
            tally,
        }))
    }

    /// First samples of the part of the frame that is asked for; which ones a block gets does not depend on that part.
    fn begin_part(
        &self,
        of_pilot: &[Film],
        regions: Vec<Region>,
        rule: Rule,
        tally: Tally,
    ) -> Result<Next, RenderError> {
        let mut begun = self.film(with_margin(self.part(), self.run.frame))?;
        of_pilot.iter().for_each(|other| begun.adopt(other));
        let stage = Stage::PartBegins {
            begun,
            regions,
            rule,
        };
        Ok(Next::Stage(State::even(stage, FIRST_SAMPLES, tally)))
    }

    /// More samples of the part where the rule asks for them.
    fn more_of_part(&self, region: Region, rule: Rule, tally: Tally) -> Result<Next, RenderError> {
        let goals = rule.goals(&region);
        if region.meets(&goals) {
            return self.end(&region, tally);
        }
        Ok(Next::Stage(State {
            stage: Stage::Part { region, rule },
            goals: vec![goals],
            tally,
        }))
    }

    fn end(&self, region: &Region, tally: Tally) -> Result<Next, RenderError> {
        let mut film = self.film(self.run.crop)?;
        film.adopt(&region.film);
        if film.has_gaps() {
            let stage = Stage::Gaps { film };
            return Ok(Next::Stage(State::even(stage, FIRST_SAMPLES, tally)));
        }
        Ok(Next::End(film, tally))
    }

    /// The tiles of the pilot.
    fn pilot(&self) -> Vec<Crop> {
        let key = Key {
            seed: self.run.options.seed,
            purpose: Purpose::Pilot,
            index: PLACES,
        };
        pilot(self.run.frame, key)
    }

    /// The blocks that hold what is asked for.
    fn part(&self) -> Crop {
        whole_blocks(self.run.crop, self.run.frame)
    }

    fn film(&self, part: Crop) -> Result<Film, RenderError> {
        Film::new(self.run.frame, part, self.layers.clone())
    }

    fn region(&self, part: Crop, first: &Film) -> Result<Region, RenderError> {
        Region::new(part, self.run.frame, self.layers, first)
    }

    /// Whether a state can be one of this frame. One that is not would ask for pixels that are not there.
    pub(super) fn fits(&self, state: &mut State) -> bool {
        let Run { frame, crop, .. } = *self.run;
        let margin = |tile: &Crop| with_margin(*tile, frame);
        let is = |film: &Film, crop: Crop| film.is_of(frame, crop, self.layers);
        let are = |films: &[Film], crops: Vec<Crop>| {
            let mut pairs = films.iter().zip(&crops);
            films.len() == crops.len() && pairs.all(|(film, &crop)| is(film, crop))
        };
        let tiles = self.pilot();
        let are_tiles = |regions: &[Region]| {
            let mut pairs = regions.iter().zip(&tiles);
            regions.len() == tiles.len() && pairs.all(|(region, &tile)| is(&region.film, tile))
        };
        let fits = match &state.stage {
            Stage::Even { film, .. } | Stage::Gaps { film } => is(film, crop),
            Stage::PilotBegins { begun } => are(begun, tiles.iter().map(margin).collect()),
            Stage::Pilot { begun, regions, .. } => {
                are(begun, tiles.iter().map(margin).collect()) && are_tiles(regions)
            }
            Stage::PartBegins { begun, regions, .. } => {
                is(begun, margin(&self.part())) && are_tiles(regions)
            }
            Stage::Part { region, .. } => is(&region.film, self.part()),
        };
        let (films, goals) = state.films();
        let mut wanted = films.iter().zip(goals);
        fits && films.len() == goals.len() && wanted.all(|(film, goals)| film.len() == goals.len())
    }
}
