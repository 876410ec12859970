//! Many lights as a tree of clusters, so that a choice among them need not look at each.
//!
//! What is far away or weak is judged as one (Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree
//! Splitting").

mod cluster;
mod cone;
mod split;

pub(crate) use cluster::Cluster;
pub use cone::Cone;

use glam::Vec3;
use split::split;
use std::ops::Range;

/// Where a light is, which way it shines and how brightly.
#[derive(Clone, Copy, Debug)]
pub struct LightBounds {
    /// The light lies within `radius` of this point, metres.
    pub center: Vec3,
    /// Metres; 0 for a lamp without extent.
    pub radius: f32,
    /// Directions in which it shines.
    pub cone: Cone,
    /// Power over the cone's solid angle, W/sr: one number for all channels.
    pub intensity: f32,
}

/// All lights of a scene, those with bounds in clusters.
///
/// Lights stand in the tree's own order, at places 0, 1, 2 …: first those without bounds, then the others, so that the lights of a
/// cluster are neighbours.
#[derive(Clone, Debug)]
pub struct LightTree {
    /// The first holds all lights with bounds.
    clusters: Vec<Cluster>,
    /// The light at each place.
    lights: Vec<u32>,
    /// The place of each light.
    places: Vec<u32>,
    /// Intensities of the lights before each place, summed. f64, because a lamp's share is a difference of sums that a far brighter one
    /// may be part of.
    intensity_before: Vec<f64>,
    /// Number of lights without bounds.
    n_far: u32,
}

impl LightTree {
    /// The tree of all lights, given in the order of their indices; those without bounds, infinitely far away, belong to no cluster.
    pub fn new(bounds: &[Option<LightBounds>]) -> Self {
        let all = || (0_u32..).zip(bounds);
        let far = all().filter(|(_, bounds)| bounds.is_none());
        let mut lights: Vec<u32> = far.map(|(light, _)| light).collect();
        let n_far = lights.len() as u32;
        let mut bounded: Vec<(u32, LightBounds)> = all()
            .filter_map(|(light, bounds)| Some((light, (*bounds)?)))
            .collect();
        let mut clusters = Vec::new();
        if !bounded.is_empty() {
            grow(&mut clusters, &mut bounded, n_far);
        }
        let mut intensity_before = vec![0.0; lights.len() + 1];
        let mut sum = 0.0;
        for (light, bounds) in bounded {
            lights.push(light);
            sum += f64::from(bounds.intensity);
            intensity_before.push(sum);
        }
        let mut places = vec![0; lights.len()];
        for (place, &light) in (0..).zip(&lights) {
            places[light as usize] = place;
        }
        Self {
            clusters,
            lights,
            places,
            intensity_before,
            n_far,
        }
    }

    /// Index of the cluster of all lights with bounds, where there are any.
    pub(crate) fn root(&self) -> Option<u32> {
        (!self.clusters.is_empty()).then_some(0)
    }

    /// The cluster of that index.
    pub(crate) fn cluster(&self, index: u32) -> &Cluster {
        &self.clusters[index as usize]
    }

    /// The places of lights without bounds.
    pub(crate) fn far(&self) -> Range<u32> {
        0..self.n_far
    }

    /// The light at a place.
    pub(crate) fn light(&self, place: u32) -> usize {
        self.lights[place as usize] as usize
    }

    /// The place of a light.
    pub(crate) fn place(&self, light: usize) -> u32 {
        self.places[light]
    }

    /// Picks one of the neighbours `places` in proportion to intensity, or evenly where they have none; `u` in [0, 1).
    pub(crate) fn pick(&self, places: &Range<u32>, u: f32) -> u32 {
        let [start, end] = [places.start, places.end].map(|place| place as usize);
        let sums = &self.intensity_before[start..=end];
        let total = sums[end - start] - sums[0];
        let above = if total > 0.0 {
            let target = sums[0] + f64::from(u) * total;
            sums[1..].partition_point(|&sum| sum <= target) as u32
        } else {
            (u * (end - start) as f32) as u32
        };
        (places.start + above).min(places.end - 1)
    }

    /// The chance with which [`LightTree::pick`] takes `place` out of `places`.
    pub(crate) fn share(&self, place: u32, places: &Range<u32>) -> f32 {
        let intensity = |start: u32, end: u32| {
            self.intensity_before[end as usize] - self.intensity_before[start as usize]
        };
        let total = intensity(places.start, places.end);
        if total > 0.0 {
            (intensity(place, place + 1) / total) as f32
        } else {
            1.0 / places.len() as f32
        }
    }
}

/// Adds the cluster of `members`, whose places begin at `first`, and all that it is made of; returns its index.
fn grow(clusters: &mut Vec<Cluster>, members: &mut [(u32, LightBounds)], first: u32) -> u32 {
    let index = clusters.len() as u32;
    clusters.push(Cluster::new(members, first));
    if members.len() > 1 {
        let length = split(members);
        let (a, b) = members.split_at_mut(length);
        let halves = [
            grow(clusters, a, first),
            grow(clusters, b, first + length as u32),
        ];
        clusters[index as usize].halves = Some(halves);
    }
    index
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `n` lamps on a spiral, every fifth of them infinitely far away.
    fn spiral(n: usize) -> LightTree {
        let bounds: Vec<_> = (0..n)
            .map(|i| {
                let (sin, cos) = (i as f32).sin_cos();
                (i % 5 != 2).then_some(LightBounds {
                    center: Vec3::new(sin, cos, 0.1) * i as f32,
                    radius: 0.1,
                    cone: Cone::SPHERE,
                    intensity: (i % 3) as f32,
                })
            })
            .collect();
        LightTree::new(&bounds)
    }

    #[test]
    fn every_light_has_one_place_and_every_place_is_in_one_leaf() {
        for n in [0, 1, 2, 3, 50, 1000] {
            let tree = spiral(n);
            assert!((0..n).all(|light| tree.light(tree.place(light)) == light));
            let leaves = tree.clusters.iter().filter(|c| c.halves.is_none());
            let mut places: Vec<u32> = leaves.flat_map(|leaf| leaf.places.clone()).collect();
            places.extend(tree.far());
            places.sort_unstable();
            assert_eq!(places, (0..n as u32).collect::<Vec<_>>());
        }
    }

    #[test]
    fn halves_are_the_two_parts_of_their_cluster() {
        let tree = spiral(300);
        for cluster in &tree.clusters {
            let Some([a, b]) = cluster.halves.map(|h| h.map(|i| &tree.cluster(i).places)) else {
                assert_eq!(cluster.places.len(), 1);
                continue;
            };
            assert_eq!(
                (a.start, a.end, b.end),
                (cluster.places.start, b.start, cluster.places.end)
            );
        }
    }

    #[test]
    fn a_light_is_picked_out_of_its_neighbours_with_the_chance_that_is_told() {
        let dim = |i: usize| {
            if i == 0 {
                1e9
            } else {
                1e-3 * (1 + i % 3) as f32
            }
        };
        let beside_a_bright_lamp: Vec<_> = (0..60)
            .map(|i| {
                Some(LightBounds {
                    center: Vec3::X * i as f32,
                    radius: 0.0,
                    cone: Cone::SPHERE,
                    intensity: dim(i),
                })
            })
            .collect();
        let trees = [spiral(60), LightTree::new(&beside_a_bright_lamp)];
        let groups = [20..21, 12..15, 13..60];
        for (tree, places) in trees
            .iter()
            .flat_map(|t| groups.iter().map(move |p| (t, p.clone())))
        {
            let n = 30_000;
            let mut counts = vec![0; places.len()];
            for i in 0..n {
                let place = tree.pick(&places, i as f32 / n as f32);
                counts[(place - places.start) as usize] += 1;
            }
            for (place, count) in places.clone().zip(counts) {
                // A lattice of n points: one more or less at each end of a stretch.
                let expected = n as f32 * tree.share(place, &places);
                assert!((expected - count as f32).abs() < 2.0, "{count} {expected}");
            }
        }
    }
}
