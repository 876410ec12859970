//! A coarse field of light, known in cells, that ends paths: light behind the second scattering is read from it instead of traced.
//!
//! Walks from the eye leave at each of their vertices an unbiased estimate of the light there; a cell's mean is right for the cell as a
//! whole. Only a path's later vertices read it, so that what a cell blurs is seen through one scattering more.

mod bands;
mod cells;
mod end;
mod stored;
mod walk;

use crate::world::{Geometry, Lights, SurfaceHit, World};
use bands::ORDER;
use cells::{Cells, Kind, Light, MOST_SIDES, NO_LINK, Place, SIZES, Side, width};
use glam::{IVec3, Vec3};
use serde::{Deserialize, Serialize};
use smallvec::SmallVec;
use std::collections::BTreeMap;
use stored::Stored;
use tyndall_math::{Ray, Sampler};
use tyndall_media::{Media, MediumPoint};

pub use cells::CellWidths;
pub use walk::Found;

/// Light found in a cell before it is believed.
const TRUSTED: [u32; 2] = [32, 16];
/// Places on surfaces are seen from this far off them, as a share of the cell's width: convex surfaces do not part their own cells.
const LIFT: f32 = 0.25;
/// A surface is flat where it lies within this share of a cell's width of the plane the cell was seen first in.
const FLAT: f32 = 0.1;
/// Surfaces closer than this many cells are not read: their cells are too large there.
const CLOSE: f32 = 2.0;
/// Nearer than this many cells light straight from lights is sampled instead of read: it changes most.
const NEAR: f32 = 8.0;

/// Light that is being collected; see [`Field`].
///
/// Filling goes in batches: [`Filling::walk`] for any number of walks at once, [`Filling::place`] for all they found, in order,
/// [`Filling::side`] for each at once, and [`Filling::add`] in order. The result follows from the walks and their order alone.
#[derive(Clone, Debug)]
pub struct Filling {
    widths: CellWidths,
    cells: Cells,
    unheld: f32,
}

impl Filling {
    /// Nothing yet, in cells of `widths`, for light in `media`.
    pub fn new(widths: CellWidths, media: &Media) -> Self {
        Self {
            widths,
            cells: Cells::new(!media.is_isotropic()),
            unheld: media.largest_moment(ORDER + 1),
        }
    }

    /// Walks from the start of `ray` and appends what light it finds.
    pub fn walk<G: Geometry, L: Lights>(
        world: &World<'_, G, L>,
        ray: Ray,
        sampler: &mut Sampler,
        found: &mut Vec<Found>,
    ) {
        walk::walk(world, ray, sampler, found);
    }

    fn seen_from(&self, found: &Found) -> Vec3 {
        let Asked { position, kind, .. } = found.place;
        found.place.eye(width(self.widths.exponent(position, kind)))
    }

    /// The cell of each of `found`, made where it is new.
    pub fn place(&mut self, found: &[Found]) -> Vec<u32> {
        let mut cell = |f: &Found| {
            let Asked {
                position,
                kind,
                normal,
            } = f.place;
            let place = Place::of(position, self.widths.exponent(position, kind), kind);
            self.cells.find_or_add(place, self.seen_from(f), normal)
        };
        found.iter().map(&mut cell).collect()
    }

    /// The side of `cell` on which `found` lies, where there is one already.
    pub fn side<G: Geometry>(&self, geometry: &G, cell: u32, found: &Found) -> Option<u32> {
        self.cells.seen(geometry, cell, self.seen_from(found))
    }

    /// Counts the light of `found` on a `side` of `cell`, which is what [`Filling::side`] said.
    pub fn add<G: Geometry>(&mut self, geometry: &G, cell: u32, side: Option<u32>, found: &Found) {
        let from = self.seen_from(found);
        let side = side.or_else(|| {
            self.cells
                .seen_or_added(geometry, cell, (from, found.place.normal))
        });
        let Some(side) = side else {
            return;
        };
        let side = &mut self.cells.sides[side as usize];
        side.sum.add(&found.light.into());
        if let (Some(index), Some(w_i)) = (side.bands, found.from) {
            self.cells.bands[index as usize].add(w_i, found.light.indirect);
        }
    }

    /// Ends the filling: larger cells take what smaller ones within them hold.
    pub fn end<G: Geometry>(mut self, geometry: &G) -> Field {
        let mut by_size: BTreeMap<i32, Vec<u32>> = BTreeMap::new();
        for (i, side) in self.cells.sides.iter().enumerate() {
            by_size
                .entry(side.place.exponent)
                .or_default()
                .push(i as u32);
        }
        while let Some((exponent, sides)) = by_size.pop_first() {
            let held = self.cells.sides.len() as u32;
            for side in sides {
                let Side {
                    place,
                    anchor,
                    normal,
                    sum,
                    bands,
                    ..
                } = self.cells.sides[side as usize];
                if exponent + 1 >= self.widths.exponent(anchor, place.kind) + SIZES {
                    continue;
                }
                let cell = self.cells.find_or_add(place.larger(), anchor, normal);
                if let Some(larger) = self.cells.seen_or_added(geometry, cell, (anchor, normal)) {
                    let larger = &mut self.cells.sides[larger as usize];
                    larger.sum.add(&sum);
                    if let (Some(from), Some(to)) = (bands, larger.bands) {
                        let bands = self.cells.bands[from as usize];
                        self.cells.bands[to as usize].merge(&bands);
                    }
                }
            }
            let added = held..self.cells.sides.len() as u32;
            by_size.entry(exponent + 1).or_default().extend(added);
            by_size.retain(|_, sides| !sides.is_empty());
        }
        Field {
            surroundings: vec![Surroundings::UNKNOWN; self.cells.sides.len()],
            light: self.cells.means(),
            widths: self.widths,
            cells: self.cells,
            unheld: self.unheld,
        }
    }
}

impl Cells {
    /// The side of the cell with the first side `cell` that is seen from `p`.
    fn seen<G: Geometry>(&self, geometry: &G, cell: u32, p: Vec3) -> Option<u32> {
        self.sides_from(cell)
            .find(|&side| sees(geometry, p, self.sides[side as usize].anchor))
    }

    /// That side, or a new one that is first seen from `p`, where surfaces have the `normal`.
    fn seen_or_added<G: Geometry>(
        &mut self,
        geometry: &G,
        cell: u32,
        (p, normal): (Vec3, Vec3),
    ) -> Option<u32> {
        let is_full = self.sides_from(cell).count() >= MOST_SIDES;
        let seen = self.seen(geometry, cell, p);
        seen.or_else(|| (!is_full).then(|| self.add_side(cell, p, normal)))
    }
}

/// Whether nothing stands between two points.
fn sees<G: Geometry>(geometry: &G, a: Vec3, b: Vec3) -> bool {
    let way = b - a;
    let distance = way.length();
    distance <= 0.0 || !geometry.occluded(&Ray::new(a, way / distance), distance)
}

/// Steps to the 26 cells around one.
const NEIGHBOURS: [[i32; 3]; 26] = {
    let mut steps = [[0; 3]; 26];
    let mut i = 0;
    while i < 26 {
        let code = if i < 13 { i } else { i + 1 } as i32;
        steps[i] = [code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1];
        i += 1;
    }
    steps
};

/// Which of [`NEIGHBOURS`] is `step` away; the cell itself is none.
fn neighbour(step: IVec3) -> Option<usize> {
    let code = (step.x + 1) + 3 * (step.y + 1) + 9 * (step.z + 1);
    match code {
        13 => None,
        _ => Some(code as usize - usize::from(code > 13)),
    }
}

/// Which light of a cell is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// All of it.
    All,
    /// What does not come straight from lights.
    Indirect,
}

impl Part {
    fn of(self, light: &Light) -> Vec3 {
        match self {
            Self::All => light.all,
            Self::Indirect => light.indirect,
        }
    }
}

/// Light in a medium as a field knows it.
#[derive(Clone, Copy, Debug)]
pub struct FieldLight {
    /// In-scattered radiance ∫ p L dω, W/(m² sr).
    pub value: Vec3,
    /// Its gradient per metre, one vector per colour channel.
    pub gradient: [Vec3; 3],
}

/// Light in cells, ready to be read.
#[derive(Clone, Debug, Deserialize)]
#[serde(try_from = "Stored<'_>")]
pub struct Field {
    widths: CellWidths,
    cells: Cells,
    light: Vec<Light>,
    surroundings: Vec<Surroundings>,
    /// How much scattering leaves of the first band that cells do not hold.
    unheld: f32,
}

/// What surrounds the place from which a cell was seen first.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Surroundings {
    /// The cells around that light in a medium is interpolated with: those that are seen from here.
    links: [u32; NEIGHBOURS.len()],
    /// Whether all corners of the cell are seen, so that no wall crosses it; on surfaces the corners of the cell's plane.
    is_clear: bool,
}

impl Surroundings {
    const UNKNOWN: Self = Self {
        links: [NO_LINK; NEIGHBOURS.len()],
        is_clear: false,
    };
}

/// A place where light is asked for.
#[derive(Clone, Copy, Debug)]
struct Asked {
    position: Vec3,
    kind: Kind,
    /// Unit normal on the lit side; zero in media.
    normal: Vec3,
}

impl Asked {
    fn in_medium(p: Vec3) -> Self {
        Self {
            position: p,
            kind: Kind::Medium,
            normal: Vec3::ZERO,
        }
    }

    fn on_surface(hit: &SurfaceHit) -> Self {
        Self {
            position: hit.position,
            kind: Kind::facing(hit.normal),
            normal: hit.normal,
        }
    }

    /// The place from where a cell of `width` metres is seen.
    fn eye(&self, width: f32) -> Vec3 {
        self.position + self.normal * (LIFT * width)
    }
}

impl Field {
    /// The field of what walks `found`, computed by one thread; for many there is [`Filling`].
    pub fn new<G: Geometry>(
        geometry: &G,
        media: &Media,
        widths: CellWidths,
        found: &[Found],
    ) -> Self {
        let mut filling = Filling::new(widths, media);
        let cells = filling.place(found);
        for (found, &cell) in found.iter().zip(&cells) {
            let side = filling.side(geometry, cell, found);
            filling.add(geometry, cell, side, found);
        }
        let mut field = filling.end(geometry);
        let seen = (0..field.len()).map(|cell| field.surroundings_of(geometry, cell));
        field.set_surroundings(seen.collect());
        field
    }

    /// Number of cells of all sizes, each side of one that surfaces part counted by itself.
    pub fn len(&self) -> usize {
        self.light.len()
    }

    /// Whether there are no cells.
    pub fn is_empty(&self) -> bool {
        self.light.is_empty()
    }

    fn is_trusted(&self, side: u32) -> bool {
        let Side { sum, place, .. } = &self.cells.sides[side as usize];
        sum.n >= TRUSTED[usize::from(place.kind != Kind::Medium)]
    }

    /// What is seen from cell number `index`; of use for cells alone that are trusted.
    pub fn surroundings_of<G: Geometry>(&self, geometry: &G, index: usize) -> Surroundings {
        if !self.is_trusted(index as u32) {
            return Surroundings::UNKNOWN;
        }
        let Side {
            place,
            anchor,
            normal,
            ..
        } = self.cells.sides[index];
        let corner = |i: i32| {
            let high = IVec3::new(i & 1, i >> 1 & 1, i >> 2);
            let corner = (place.lattice + high).as_vec3() * width(place.exponent);
            corner - normal * normal.dot(corner - anchor)
        };
        let is_clear = (0..8).all(|i| sees(geometry, anchor, corner(i)));
        let link = |step: [i32; 3]| {
            let lattice = place.lattice + IVec3::from(step);
            let cell = self.cells.find(Place { lattice, ..place })?;
            let side = self.cells.seen(geometry, cell, anchor)?;
            self.is_trusted(side).then_some(side)
        };
        let links = match place.kind {
            Kind::Medium => NEIGHBOURS.map(|step| link(step).unwrap_or(NO_LINK)),
            Kind::Surface(_) => [NO_LINK; 26],
        };
        Surroundings { links, is_clear }
    }

    /// Sets what [`Field::surroundings_of`] found for all cells in order; before, nothing is read across cells, and each read of a
    /// cell takes a ray.
    pub fn set_surroundings(&mut self, surroundings: Vec<Surroundings>) {
        debug_assert_eq!(surroundings.len(), self.light.len());
        self.surroundings = surroundings;
    }

    /// The smallest cell at a place that is trusted, on the side that is seen from there.
    fn side_at<G: Geometry>(&self, geometry: &G, asked: &Asked) -> Option<u32> {
        let Asked {
            position,
            kind,
            normal,
        } = *asked;
        let smallest = self.widths.exponent(position, kind);
        // As far off the surface as light was found from: farther, it could lie behind what is opposite.
        let eye = asked.eye(width(smallest));
        (smallest..smallest + SIZES).find_map(|exponent| {
            let cell = self.cells.find(Place::of(position, exponent, kind))?;
            let width = width(exponent);
            let anchor = self.cells.sides[cell as usize].anchor;
            // In a clear cell everything sees everything, on a surface as far as it is flat.
            let is_clear = self.surroundings[cell as usize].is_clear
                && normal.dot(eye - anchor).abs() < FLAT * width;
            let side = if is_clear {
                cell
            } else {
                self.cells.seen(geometry, cell, eye)?
            };
            self.is_trusted(side).then_some(side)
        })
    }

    /// A distance from `p` within which the size of cells in media would show, and light straight from lights is sampled: everywhere
    /// if cells tell directions, which are too few for it.
    pub(crate) fn near(&self, p: Vec3) -> f32 {
        if self.cells.has_bands() {
            return f32::INFINITY;
        }
        NEAR * width(self.widths.exponent(p, Kind::Medium))
    }

    /// The highest band of the directions that cells in media hold.
    pub fn order(&self) -> usize {
        if self.cells.has_bands() { ORDER } else { 0 }
    }

    /// The share of the finest directions of light that one scattering leaves and that cells do not hold.
    pub fn unheld(&self) -> f32 {
        self.unheld
    }

    /// `part` of the light in the medium at `p` where media scatter alike in all directions, interpolated between the middles of cells;
    /// `None` where too little is known of it.
    pub fn medium<G: Geometry>(&self, geometry: &G, p: Vec3, part: Part) -> Option<FieldLight> {
        self.interpolated(geometry, p, |side| part.of(&self.light[side]))
    }

    /// Indirect light that leaves the point `p` of `medium` in the unit direction `w_o`, as [`Field::medium`] has it; of the light's
    /// directions as much counts as cells hold, so that it may come out a little below zero.
    pub fn leaving<G: Geometry>(
        &self,
        geometry: &G,
        (p, medium): (Vec3, &MediumPoint<'_>),
        w_o: Vec3,
    ) -> Option<FieldLight> {
        if !self.cells.has_bands() {
            return self.medium(geometry, p, Part::Indirect);
        }
        let lobe = bands::lobe(medium, w_o);
        self.interpolated(geometry, p, |side| {
            let Side { sum, bands, .. } = &self.cells.sides[side];
            let bands = bands.map(|index| &self.cells.bands[index as usize]);
            let turned = bands.map_or(Vec3::ZERO, |bands| bands.leaving(&lobe));
            self.light[side].indirect + turned / sum.n as f32
        })
    }

    /// What `light` says of cells, interpolated at `p`.
    fn interpolated<G: Geometry>(
        &self,
        geometry: &G,
        p: Vec3,
        light: impl Fn(usize) -> Vec3,
    ) -> Option<FieldLight> {
        let home = self.side_at(geometry, &Asked::in_medium(p))? as usize;
        let place = self.cells.sides[home].place;
        let inv_width = 1.0 / width(place.exponent);
        let u = p * inv_width - 0.5;
        let base = u.floor();
        let f = u - base;
        let first = base.as_ivec3() - place.lattice;
        let mut corners: SmallVec<[(f32, Vec3, Vec3); 8]> = SmallVec::new();
        for i in 0..8 {
            let step = IVec3::new(i & 1, i >> 1 & 1, i >> 2);
            let cell = match neighbour(first + step) {
                None => home,
                Some(n) => match self.surroundings[home].links[n] {
                    NO_LINK => continue,
                    link => link as usize,
                },
            };
            let high = step.as_vec3();
            let w = high * f + (1.0 - high) * (1.0 - f);
            let sign = 2.0 * high - 1.0;
            let slope = Vec3::new(w.y * w.z, w.x * w.z, w.x * w.y) * sign * inv_width;
            corners.push((w.element_product(), slope, light(cell)));
        }
        let total: f32 = corners.iter().map(|(w, ..)| w).sum();
        let sum: Vec3 = corners.iter().map(|&(w, _, light)| light * w).sum();
        let value = sum / total;
        // Of a quotient of sums: where cells are left out the weights of the others make up for them.
        let gradient = |channel: usize| {
            let rise = |light: Vec3| light[channel] - value[channel];
            let terms = corners.iter().map(|&(_, slope, light)| slope * rise(light));
            terms.sum::<Vec3>() / total
        };
        value.is_finite().then(|| FieldLight {
            value,
            gradient: std::array::from_fn(gradient),
        })
    }

    /// Radiance that the surface at `hit`, met by `ray`, reflects, and whether that is all or only of indirect light, as where it is near;
    /// `None` where too little is known of it, where it is closer still and may not be `close`, or so shiny that irradiance says little.
    pub(crate) fn surface<G: Geometry>(
        &self,
        geometry: &G,
        ray: &Ray,
        hit: &SurfaceHit,
        close: bool,
    ) -> Option<(Vec3, Part)> {
        if hit.bsdf.is_shiny() {
            return None;
        }
        let side = self.side_at(geometry, &Asked::on_surface(hit))? as usize;
        let width = width(self.cells.sides[side].place.exponent);
        if !close && hit.t < CLOSE * width {
            return None;
        }
        let part = if hit.t < NEAR * width {
            Part::Indirect
        } else {
            Part::All
        };
        Some((
            part.of(&self.light[side]) * hit.bsdf.albedo(-ray.direction),
            part,
        ))
    }
}
