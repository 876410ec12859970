//! The cache itself: records in, values out.
//! It keeps the records as they came, for whoever looks after them, and a copy in the index's order for lookups.

use crate::blend::{Blend, weight};
use crate::crossings::Crossings;
use crate::error::CacheError;
use crate::grid::Ball;
use crate::lipschitz;
use crate::octree::{MAX_RECORDS, Octree};
use crate::record::{Record, is_radius};
use crate::segment::Segment;
use crate::shape::{self, Shape};
use glam::Vec3;

/// Records of a field with `N` channels, and an index that finds the valid ones at a point.
///
/// Filling needs `&mut self` and reading `&self`, so that threads may read together between two batches. Every answer
/// follows from the records and their order alone: bits do not depend on how they were divided into batches.
///
/// Memory for three channels: about 570 bytes a record where balls overlap, 2 kB where they stand alone. Most of it are
/// the lists of cells: a record is in at most 27 of them, mostly in 12.
///
/// Where a ball alone does not say where a record is valid, records carry a tag `T` that does: the side of a wall, the normal of a
/// surface. See [`Cache::tagged`] and [`Cache::lookup_where`].
#[derive(Clone, Debug, Default)]
pub struct Cache<const N: usize, T = ()> {
    records: Vec<Record<N>>,
    tags: Vec<T>,
    octree: Octree,
    /// What the records add to a blend, by slot: one for each group of channels.
    shapes: Vec<Shape>,
    /// Tags by slot.
    slot_tags: Vec<T>,
    /// Index of the record in each slot.
    order: Vec<u32>,
}

impl<const N: usize> Cache<N> {
    /// A cache without records.
    pub fn new() -> Self {
        Self::tagged()
    }

    /// As [`Cache::insert_tagged`], for records that are valid in their whole balls.
    ///
    /// # Errors
    /// Those of [`Cache::insert_tagged`].
    pub fn insert(&mut self, batch: Vec<Record<N>>) -> Result<(), CacheError> {
        self.insert_tagged(batch.into_iter().map(|record| (record, ())).collect())
    }
}

impl<const N: usize, T: Clone> Cache<N, T> {
    /// A cache without records, for records with tags.
    pub fn tagged() -> Self {
        Self {
            records: Vec::new(),
            tags: Vec::new(),
            octree: Octree::default(),
            shapes: Vec::new(),
            slot_tags: Vec::new(),
            order: Vec::new(),
        }
    }

    /// Appends records with one tag each and builds the index anew: one to four microseconds per record held, so insert in batches.
    ///
    /// # Errors
    /// If a number in a record is not finite, a value is negative, a radius is not positive (1.2e-38 to 8.5e37), or
    /// there are too many records (33 million). The cache is unchanged then.
    pub fn insert_tagged(&mut self, batch: Vec<(Record<N>, T)>) -> Result<(), CacheError> {
        let n_records = self.records.len() + batch.len();
        if n_records > MAX_RECORDS {
            return Err(CacheError::TooManyRecords {
                records: n_records,
                allowed: MAX_RECORDS,
            });
        }
        for (index, (record, _)) in batch.iter().enumerate() {
            record.check(index)?;
        }
        for (record, tag) in batch {
            self.records.push(record);
            self.tags.push(tag);
        }
        self.build_index();
        Ok(())
    }

    /// Number of records.
    pub fn len(&self) -> usize {
        self.records.len()
    }

    /// Whether there are no records.
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// The records' tags, in the same order.
    pub fn tags(&self) -> &[T] {
        &self.tags
    }

    /// All records in the order of their insertion.
    pub fn records(&self) -> &[Record<N>] {
        &self.records
    }

    /// The field at `p`, blended from all records whose balls hold `p`; `None` if there are none.
    ///
    /// Per channel, with weights w = 3s² − 2s³, s = 1 − |p − xₖ|/Rₖ, normalised to Σ w = 1, and gₖ = ∇ln Lₖ:
    ///
    /// ln L = Σ w (ln Lₖ + ½ (gₖ + Σ w g)·(p − xₖ)) + a correction for the records' noise
    ///
    /// Records with Lₖ = 0 take their share of the weight, and noise that the records own up to (their variance) does not
    /// darken the mean. The result is finite, lies in [½ min Lₖ, 2 max Lₖ], and is smooth in `p`
    /// but where a clamp holds: the last one may jump where a record with a new least or greatest value begins.
    ///
    /// Sums run over records by level (from large radii to small ones by powers of two), by cell, then by insertion.
    #[inline]
    pub fn lookup(&self, p: Vec3) -> Option<[f32; N]> {
        self.lookup_where(p, |_, _| true)
    }

    /// As [`Cache::lookup`], from those records alone that are `valid` by their tag and the offset (p − x)/R from the record.
    #[inline]
    pub fn lookup_where(
        &self,
        p: Vec3,
        mut valid: impl FnMut(&T, Vec3) -> bool,
    ) -> Option<[f32; N]> {
        let mut blend = Blend::EMPTY;
        self.octree.for_each_holding(p, |slot, offset| {
            if valid(&self.slot_tags[slot], offset) {
                let w = weight(1.0 - offset.length());
                blend.add(w, self.shapes_of(slot), offset);
            }
        });
        blend.value()
    }

    /// All records whose balls the segment crosses, for the field at many of its points: see [`Crossings::march`].
    ///
    /// Tags have no say yet: they are asked at each point of a march. A record on the list costs two thirds of a lookup, a point of the
    /// march between a fifth and a quarter: lists pay where points stand closer than records.
    pub fn crossings(&self, segment: &Segment) -> Crossings<'_, N, T> {
        Crossings::new(self, *segment, self.octree.along(segment))
    }

    /// Whether the ball of any record holds `p`, whatever its tag: whether [`Cache::lookup`] finds a value.
    pub fn covers(&self, p: Vec3) -> bool {
        self.octree.covers(p)
    }

    /// Whether [`Cache::lookup_where`] finds a value.
    pub fn covers_where(&self, p: Vec3, valid: impl Fn(&T, Vec3) -> bool) -> bool {
        let mut found = false;
        self.octree.for_each_holding(p, |slot, offset| {
            found = found || valid(&self.slot_tags[slot], offset);
        });
        found
    }

    /// The sum of the weights of all records whose balls hold `p`, whatever their tags: 0 where there are none, at least 1 at a record.
    pub fn coverage(&self, p: Vec3) -> f32 {
        let mut sum = 0.0;
        self.octree
            .for_each_holding(p, |_, offset| sum += weight(1.0 - offset.length()));
        sum
    }

    /// Calls `f` with index and record of all records that stand within `radius` of `p`, whatever their own radii.
    ///
    /// The order follows from the records alone; it is not that of the indices.
    pub fn for_each_near(&self, p: Vec3, radius: f32, mut f: impl FnMut(usize, &Record<N>)) {
        // In f64: squares of large distances overflow f32.
        let radius = f64::from(radius);
        let centre = p.as_dvec3();
        self.octree.for_each_near(
            p,
            |_| radius,
            |slots| {
                for &index in &self.order[slots] {
                    let record = &self.records[index as usize];
                    if record.position.as_dvec3().distance(centre) <= radius {
                        f(index as usize, record);
                    }
                }
            },
        );
    }

    /// Spreads small radii: Rᵢ ← minⱼ (Rⱼ + slope · |xᵢ − xⱼ|), so that radii grow no faster than `slope`.
    ///
    /// A record that stands in a flat part of the field cannot know of the edge its neighbours have seen; their small
    /// radii tell it ("neighbour clamping", Křivánek et al. 2006). A slope of 0.5 to 1 is usual; 0 gives all records the
    /// smallest radius. To one part in 10⁶; a second call with the same slope changes nothing.
    ///
    /// # Errors
    /// If `slope` is negative or not finite.
    pub fn clamp_radii(&mut self, slope: f32) -> Result<(), CacheError> {
        if !(slope >= 0.0 && slope.is_finite()) {
            return Err(CacheError::InvalidSlope { slope });
        }
        let radii = lipschitz::clamp(&self.balls(), slope);
        for (record, radius) in self.records.iter_mut().zip(radii) {
            record.radius = radius;
        }
        self.build_index();
        Ok(())
    }

    /// Gives each record a new radius, in the order of [`Cache::records`].
    ///
    /// # Errors
    /// If there is not one radius per record, or one is not positive and finite (1.2e-38 to 8.5e37). The cache is
    /// unchanged then.
    pub fn set_radii(&mut self, radii: &[f32]) -> Result<(), CacheError> {
        if radii.len() != self.records.len() {
            return Err(CacheError::RadiusCount {
                given: radii.len(),
                records: self.records.len(),
            });
        }
        for (index, &value) in radii.iter().enumerate() {
            if !is_radius(value) {
                return Err(CacheError::InvalidRadius { index, value });
            }
        }
        for (record, &radius) in self.records.iter_mut().zip(radii) {
            record.radius = radius;
        }
        self.build_index();
        Ok(())
    }

    fn balls(&self) -> Vec<Ball> {
        let ball = |record: &Record<N>| Ball {
            centre: record.position,
            radius: record.radius,
        };
        self.records.iter().map(ball).collect()
    }

    /// Index of the record in a slot.
    pub(crate) fn index_of(&self, slot: usize) -> usize {
        self.order[slot] as usize
    }

    /// Shapes and tag of the record in a slot.
    pub(crate) fn slot(&self, slot: usize) -> (&[Shape], &T) {
        (self.shapes_of(slot), &self.slot_tags[slot])
    }

    /// By group of channels.
    #[inline]
    fn shapes_of(&self, slot: usize) -> &[Shape] {
        let n_groups = const { Shape::groups(N) };
        &self.shapes[slot * n_groups..][..n_groups]
    }

    fn build_index(&mut self) {
        (self.octree, self.order) = Octree::build(&self.balls());
        let groups = || (0..N).step_by(shape::WIDTH);
        self.shapes = (self.order.iter())
            .map(|&index| &self.records[index as usize])
            .flat_map(|record| groups().map(|first| Shape::new(record, first)))
            .collect();
        self.slot_tags = (self.order.iter())
            .map(|&index| self.tags[index as usize].clone())
            .collect();
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Coordinates on a coarse lattice or anywhere, so that records share positions, faces of cells and rims.
    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![
            (-4..=4).prop_map(|i| i as f32 * 0.5),
            -2.0_f32..2.0,
            prop_oneof![Just(0.0), Just(-1e7), Just(3e38)],
        ]
    }

    fn point() -> impl Strategy<Value = Vec3> {
        (coordinate(), coordinate(), coordinate()).prop_map(|(x, y, z)| Vec3::new(x, y, z))
    }

    fn value() -> impl Strategy<Value = f32> {
        prop_oneof![Just(0.0), Just(1e-45), Just(f32::MAX), 1e-3_f32..1e3]
    }

    fn record() -> impl Strategy<Value = Record<2>> {
        let radius = (-3.0_f32..3.0).prop_map(|exponent| 10_f32.powf(exponent));
        let radius = prop_oneof![Just(0.5), Just(1.0), radius];
        (
            point(),
            radius,
            [value(), value()],
            [point(), point()],
            [value(), value()],
        )
            .prop_map(|(position, radius, value, gradient, variance)| Record {
                position,
                radius,
                value,
                gradient,
                variance,
            })
    }

    fn bits(value: Option<[f32; 2]>) -> Option<[u32; 2]> {
        value.map(|value| value.map(f32::to_bits))
    }

    /// To the 3 parts in 10⁵ that are documented; tiny numbers to the spacing of their like.
    fn assert_close(found: Option<[f32; 2]>, expected: Option<[f32; 2]>) {
        assert_eq!(found.is_some(), expected.is_some());
        for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
            let is_close = (found - expected).abs() <= 3e-5 * expected + 1e-44;
            assert!(is_close, "{found} instead of {expected}");
        }
    }

    fn cache_of(records: &[Record<2>]) -> Cache<2> {
        let mut cache = Cache::new();
        cache.insert(records.to_vec()).unwrap();
        cache
    }

    /// What `lookup` is to find: every slot tried, in their order.
    fn brute_force(cache: &Cache<2>, p: Vec3) -> Option<[f32; 2]> {
        let mut blend = Blend::EMPTY;
        for (slot, &index) in cache.order.iter().enumerate() {
            let record = &cache.records[index as usize];
            let offset = (p - record.position) * (1.0 / record.radius);
            if offset.length_squared() < 1.0 {
                let w = weight(1.0 - offset.length());
                blend.add(w, cache.shapes_of(slot), offset);
            }
        }
        blend.value()
    }

    proptest! {
        #[test]
        fn lookups_equal_trying_every_record_to_the_bit(
            records in prop::collection::vec(record(), 1..60),
            points in prop::collection::vec(point(), 20),
        ) {
            let cache = cache_of(&records);
            for p in points.into_iter().chain(records.iter().map(|record| record.position)) {
                let expected = brute_force(&cache, p);
                prop_assert_eq!(bits(cache.lookup(p)), bits(expected));
                prop_assert_eq!(cache.covers(p), expected.is_some());
                prop_assert_eq!(cache.coverage(p) > 0.0, expected.is_some());
                if let Some(value) = expected {
                    prop_assert!(value.iter().all(|x| x.is_finite() && *x >= 0.0));
                }
            }
        }

        #[test]
        fn a_march_agrees_with_lookups(
            records in prop::collection::vec(record(), 1..60),
            origin in point(),
            direction in point(),
            mut ts in prop::collection::vec(prop_oneof![-1.0_f32..3.0, (-2..=4).prop_map(|i| i as f32 * 0.5)], 1..100),
            range in prop_oneof![Just([-1.0_f32, 3.0]), Just([f32::NEG_INFINITY, f32::INFINITY])],
        ) {
            ts.retain(|t| range[0] <= *t && *t <= range[1]);
            ts.sort_by(f32::total_cmp);
            let cache = cache_of(&records);
            // Through a record, so that something is crossed.
            let aimed = Segment { origin, direction: records[0].position - origin, range };
            for segment in [Segment { origin, direction, range }, aimed] {
                let crossings = cache.crossings(&segment);
                crossings.march(&ts, |_, _, _| true, |t, value| {
                    assert_close(value, cache.lookup(segment.at(t)));
                });
                let above = |p: Vec3| p.x + p.y > 0.2;
                crossings.march(&ts, |_, offset, p| offset.z > 0.0 && above(p), |t, value| {
                    let p = segment.at(t);
                    let expected = cache.lookup_where(p, |_, offset| offset.z > 0.0 && above(p));
                    assert_close(value, expected);
                });
            }
        }

        #[test]
        fn near_records_are_those_within_the_distance(
            records in prop::collection::vec(record(), 1..60),
            p in point(),
            radius in prop_oneof![Just(0.0_f32), Just(0.5), 0.0_f32..10.0, Just(f32::INFINITY)],
        ) {
            let cache = cache_of(&records);
            let mut found = Vec::new();
            cache.for_each_near(p, radius, |index, record| {
                assert_eq!(record, &records[index]);
                found.push(index);
            });
            found.sort_unstable();
            let is_near = |record: &Record<2>| {
                record.position.as_dvec3().distance(p.as_dvec3()) <= f64::from(radius)
            };
            let expected: Vec<_> = (0..records.len()).filter(|&i| is_near(&records[i])).collect();
            prop_assert_eq!(found, expected);
        }

        #[test]
        fn bits_do_not_depend_on_batches(
            records in prop::collection::vec(record(), 2..40),
            cut in 0_usize..40,
            p in point(),
        ) {
            let cut = cut.min(records.len());
            let mut cache = Cache::new();
            cache.insert(records[..cut].to_vec()).unwrap();
            cache.insert(Vec::new()).unwrap();
            cache.insert(records[cut..].to_vec()).unwrap();
            let whole = cache_of(&records);
            prop_assert_eq!(cache.records(), &records[..]);
            for p in records.iter().map(|record| record.position).chain([p]) {
                prop_assert_eq!(bits(cache.lookup(p)), bits(whole.lookup(p)));
            }
        }
    }
}
