//! One light of many, chosen by what it could bring.
//!
//! Every light's unoccluded, unattenuated contribution is estimated, damped by the fog on the way, and one is picked in
//! proportion; where lights are many, those that are far away or weak are judged together. The estimate steers the choice only; it
//! never enters a result, and a small even share keeps every light in reach of the choice where the estimate is wrong.

use crate::light_tree::{Cluster, LightTree};
use crate::world::Lights;
use glam::Vec3;
use smallvec::SmallVec;
use std::ops::Range;
use tyndall_math::Ray;

/// The chances of all lights at one place.
#[derive(Clone, Debug)]
pub struct LightChoice<'l> {
    /// Tells lights from places; without it they are the same.
    tree: Option<&'l LightTree>,
    /// Single lights and clusters, in the order of their places; together they hold every light.
    groups: SmallVec<[Group; 32]>,
}

/// What is known of a light, or of neighbours that are judged as one.
#[derive(Clone, Copy, Debug)]
struct Group {
    /// The place behind its last light; it begins where the group before ends.
    end: u32,
    /// Running sum of the groups' importance.
    cumulative: f32,
}

/// Indices of clusters and their importance.
type Clusters = SmallVec<[(u32, f32); 32]>;

/// Optical depth beyond which a light's damping is no longer told apart: the extinction at one place says little about a
/// long way.
const DEEPEST: f32 = 6.0;
/// Share of choices spread evenly over all lights.
const EVEN_SHARE: f32 = 0.02;
/// A cluster that seems to bring more than this share of all light is looked at in halves: lights that are worth probes of
/// their own ([`Shafts`](crate::shafts::Shafts)) then stand alone.
const LARGEST_CLUSTER: f32 = 0.1;

/// About e^−τ for the optical depth τ of a way through fog: the inverse of the exponential's series up to τ³, which steers a
/// choice as well and costs no `exp`. It falls to 1/61 at [`DEEPEST`] and no further.
pub(crate) fn damping(tau: f32) -> f32 {
    let tau = tau.min(DEEPEST);
    1.0 / (1.0 + tau * (1.0 + tau * (1.0 / 2.0 + tau * (1.0 / 6.0))))
}

impl<'l> LightChoice<'l> {
    /// Chances at the point `p`, on a surface with `normal` or in a medium.
    /// `sigma` is the extinction there per metre.
    pub fn at<L: Lights>(lights: &'l L, p: Vec3, normal: Option<Vec3>, sigma: f32) -> Self {
        let arrives = |pivot: Vec3| damping(sigma * pivot.distance(p));
        Self::new(
            lights,
            |l| lights.importance(l, p, normal) * lights.pivot(l).map_or(1.0, arrives),
            |cluster| Some(cluster.importance(p, normal)? * arrives(cluster.center)),
        )
    }

    /// Chances for scattering on `ray` between 0 and the finite `t_max`, where the mean extinction is `sigma` per metre.
    pub fn along<L: Lights>(lights: &'l L, ray: &Ray, t_max: f32, sigma: f32) -> Self {
        let arrives = |pivot: Vec3| {
            let t = (pivot - ray.origin).dot(ray.direction).clamp(0.0, t_max);
            let detour = pivot.distance(ray.at(t));
            damping(sigma * (t + detour))
        };
        Self::new(
            lights,
            |l| lights.importance_along(l, ray, t_max) * lights.pivot(l).map_or(1.0, arrives),
            |cluster| Some(cluster.importance_along(ray, t_max)? * arrives(cluster.center)),
        )
    }

    fn new<L: Lights>(
        lights: &'l L,
        of_light: impl Fn(usize) -> f32,
        of_cluster: impl Fn(&Cluster) -> Option<f32>,
    ) -> Self {
        let mut choice = Self {
            tree: lights.tree(),
            groups: SmallVec::new(),
        };
        let Some(tree) = choice.tree else {
            match lights.count() {
                1 => choice.push(1, 1.0),
                n => (0..n).for_each(|light| choice.push(light as u32 + 1, of_light(light))),
            }
            return choice;
        };
        for place in tree.far() {
            choice.push(place + 1, of_light(tree.light(place)));
        }
        let estimate = |index: u32| {
            let cluster = tree.cluster(index);
            let importance = match cluster.halves {
                Some(_) => of_cluster(cluster).unwrap_or(f32::INFINITY),
                None => weight(of_light(tree.light(cluster.places.start))),
            };
            (index, importance)
        };
        let (mut waiting, mut apart) = (Clusters::new(), Clusters::new());
        waiting.extend(tree.root().map(estimate));
        halve(tree, &mut waiting, f32::MAX, estimate, |cluster| {
            apart.push(cluster);
        });
        let total = choice.total() + apart.iter().map(|(_, importance)| importance).sum::<f32>();
        apart.reverse();
        let largest = LARGEST_CLUSTER * total;
        halve(
            tree,
            &mut apart,
            largest,
            estimate,
            |(index, importance)| {
                choice.push(tree.cluster(index).places.end, importance);
            },
        );
        choice
    }

    /// Adds a group of lights that ends before the place `end`.
    fn push(&mut self, end: u32, importance: f32) {
        let cumulative = self.total() + weight(importance);
        self.groups.push(Group { end, cumulative });
    }

    /// The choice among the same lights in the same proportions, but for those single ones `taken` by other means: their importance is
    /// zero, and only the even share still picks them.
    pub fn without(&self, taken: &[usize]) -> Self {
        let mut rest = Self {
            tree: self.tree,
            groups: SmallVec::new(),
        };
        for (i, group) in self.groups.iter().enumerate() {
            let is_taken = self.single(i).is_some_and(|light| taken.contains(&light));
            let importance = if is_taken { 0.0 } else { self.importance(i) };
            rest.push(group.end, importance);
        }
        rest
    }

    /// The lights that are not judged together with others, and their chances. Those with a chance of more than about a tenth
    /// are among them.
    pub fn singles(&self) -> impl Iterator<Item = (usize, f32)> {
        (0..self.groups.len()).filter_map(|i| Some((self.single(i)?, self.chance(i, 1.0))))
    }

    /// The one light of a group, where it is one.
    fn single(&self, group: usize) -> Option<usize> {
        let places = self.places(group);
        (places.len() == 1).then(|| self.light(places.start))
    }

    fn places(&self, group: usize) -> Range<u32> {
        let start = group.checked_sub(1).map_or(0, |g| self.groups[g].end);
        start..self.groups[group].end
    }

    fn light(&self, place: u32) -> usize {
        self.tree.map_or(place as usize, |tree| tree.light(place))
    }

    fn importance(&self, group: usize) -> f32 {
        self.groups[group].cumulative - self.before(group)
    }

    /// Importance of all groups before.
    fn before(&self, group: usize) -> f32 {
        group
            .checked_sub(1)
            .map_or(0.0, |g| self.groups[g].cumulative)
    }

    fn total(&self) -> f32 {
        self.before(self.groups.len())
    }

    fn n_lights(&self) -> usize {
        self.groups.last().map_or(0, |last| last.end as usize)
    }

    /// Picks a light; returns it with its chance. `None` where there are no lights.
    pub fn sample(&self, u: f32) -> Option<(usize, f32)> {
        let last = self.n_lights().checked_sub(1)?;
        let share = self.even_share();
        if u < share {
            let light = ((u / share * self.n_lights() as f32) as usize).min(last);
            return Some((light, self.pdf(light)));
        }
        let target = (u - share) / (1.0 - share) * self.total();
        let above = self
            .groups
            .partition_point(|group| group.cumulative <= target);
        let group = above.min(self.groups.len() - 1);
        let places = self.places(group);
        let (place, within) = match self.tree {
            Some(tree) if places.len() > 1 => {
                let u = (target - self.before(group)) / self.importance(group);
                let place = tree.pick(&places, u);
                (place, tree.share(place, &places))
            }
            _ => (places.start, 1.0),
        };
        Some((self.light(place), self.chance(group, within)))
    }

    /// Chance of picking `light`.
    pub fn pdf(&self, light: usize) -> f32 {
        let Some(tree) = self.tree else {
            return self.chance(light, 1.0);
        };
        let place = tree.place(light);
        let group = self.groups.partition_point(|group| group.end <= place);
        let places = self.places(group);
        let within = if places.len() > 1 {
            tree.share(place, &places)
        } else {
            1.0
        };
        self.chance(group, within)
    }

    /// Chance of a light that is picked out of its group with chance `within`.
    fn chance(&self, group: usize, within: f32) -> f32 {
        let share = self.even_share();
        let even = share / self.n_lights() as f32;
        if share >= 1.0 {
            return even;
        }
        even + (1.0 - share) * self.importance(group) / self.total() * within
    }

    /// All of the choices where no light seems to arrive, none where there is one light alone.
    fn even_share(&self) -> f32 {
        match self.n_lights() {
            _ if self.total() <= 0.0 => 1.0,
            1 => 0.0,
            _ => EVEN_SHARE,
        }
    }
}

/// What an importance counts in a sum.
fn weight(importance: f32) -> f32 {
    if importance.is_finite() {
        importance.max(0.0)
    } else {
        0.0
    }
}

/// Halves clusters until none but single lights has more than the importance `largest`, and tells `done` of each. Given from the
/// last place to the first, they are told from the first to the last.
fn halve(
    tree: &LightTree,
    waiting: &mut Clusters,
    largest: f32,
    estimate: impl Fn(u32) -> (u32, f32),
    mut done: impl FnMut((u32, f32)),
) {
    while let Some((index, importance)) = waiting.pop() {
        match tree.cluster(index).halves {
            Some([a, b]) if importance > largest => waiting.extend([b, a].map(&estimate)),
            _ => done((index, importance)),
        }
    }
}
