//! Where a cluster of lights is split in two.

use super::{Cone, LightBounds};
use tyndall_math::Aabb;

/// Neither part holds less than one in so many lights: the tree's depth is bounded by the logarithm of their number.
const LEAST_PART: usize = 8;
/// Share of the cost that does not shrink with the extent of a part: tells apart which way lights at one place shine.
const SIZELESS: f32 = 0.01;

/// What a part is judged by.
#[derive(Clone, Copy, Debug)]
struct Extent {
    bounds: Aabb,
    cone: Option<Cone>,
    intensity: f32,
}

impl Extent {
    const EMPTY: Self = Self {
        bounds: Aabb::EMPTY,
        cone: None,
        intensity: 0.0,
    };

    fn with(self, (_, light): &(u32, LightBounds)) -> Self {
        let cone = self.cone.map_or(light.cone, |cone| cone.union(light.cone));
        Self {
            bounds: self
                .bounds
                .grow(light.center - light.radius)
                .grow(light.center + light.radius),
            cone: Some(cone),
            intensity: self.intensity + light.intensity,
        }
    }

    /// How badly its lights are judged as one: intensity × solid angle × diagonal², the diagonal as a share of the whole's. It is
    /// the surface area orientation heuristic of Conty Estevez and Kulla 2018, but for their bound of the emission.
    fn cost(&self, whole: f32) -> f32 {
        let size = self.bounds.diagonal() / whole.max(f32::MIN_POSITIVE);
        let solid_angle = self.cone.map_or(0.0, Cone::solid_angle);
        self.intensity * solid_angle * (size * size + SIZELESS)
    }
}

/// Orders two or more lights such that two compact clusters follow each other; returns the length of the first.
///
/// Tried are all cuts across the coordinates of position and of direction.
pub(super) fn split(members: &mut [(u32, LightBounds)]) -> usize {
    let n = members.len();
    let whole = members.iter().fold(Extent::EMPTY, Extent::with);
    let diagonal = whole.bounds.diagonal();
    let least = n.div_ceil(LEAST_PART);
    let (mut best, mut least_cost) = ((0, n / 2), f32::INFINITY);
    for order in 0..6 {
        sort(members, order);
        let first = costs(members.iter(), diagonal);
        let second = costs(members.iter().rev(), diagonal);
        for length in least..=n - least {
            let cost = first[length - 1] + second[n - length - 1];
            if cost < least_cost {
                (best, least_cost) = ((order, length), cost);
            }
        }
    }
    let (order, length) = best;
    sort(members, order);
    length
}

/// The costs of the first, the first two, the first three … lights.
fn costs<'a>(lights: impl Iterator<Item = &'a (u32, LightBounds)>, whole: f32) -> Vec<f32> {
    lights
        .scan(Extent::EMPTY, |extent, light| {
            *extent = extent.with(light);
            Some(extent.cost(whole))
        })
        .collect()
}

/// Sorts by a coordinate of position (0 to 2) or of direction (3 to 5).
fn sort(members: &mut [(u32, LightBounds)], order: usize) {
    let key = |light: &LightBounds| match order {
        0..3 => light.center[order],
        _ => light.cone.axis[order - 3],
    };
    members.sort_unstable_by(|(i, a), (k, b)| key(a).total_cmp(&key(b)).then(i.cmp(k)));
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn lamp(light: u32, center: Vec3, axis: Vec3) -> (u32, LightBounds) {
        let cone = Cone {
            axis,
            half_angle: 0.3,
        };
        let bounds = LightBounds {
            center,
            radius: 0.1,
            cone,
            intensity: 1.0,
        };
        (light, bounds)
    }

    /// Splits lights and returns their indices in the first part, sorted.
    fn first_part(mut members: Vec<(u32, LightBounds)>) -> Vec<u32> {
        let length = split(&mut members);
        let mut first: Vec<u32> = members[..length].iter().map(|(light, _)| *light).collect();
        first.sort_unstable();
        first
    }

    #[test]
    fn lights_are_split_where_they_stand_apart() {
        let members = [9.0, 0.0, 8.0, 8.5, 0.5]
            .map(|y| Vec3::new(0.0, y, 0.0))
            .into_iter();
        let members = (0..).zip(members).map(|(i, p)| lamp(i, p, Vec3::Z));
        assert_eq!(first_part(members.collect()), [1, 4]);
    }

    #[test]
    fn lights_at_one_place_are_split_by_which_way_they_shine() {
        let axes = [Vec3::X, Vec3::NEG_X, Vec3::X, Vec3::NEG_X, Vec3::X];
        let members = (0..).zip(axes).map(|(i, axis)| lamp(i, Vec3::ONE, axis));
        assert_eq!(first_part(members.collect()), [1, 3]);
    }

    #[test]
    fn lights_that_are_all_alike_are_split_all_the_same() {
        for n in 2..40 {
            let members: Vec<_> = (0..n).map(|i| lamp(i, Vec3::ZERO, Vec3::Y)).collect();
            let length = first_part(members).len() as u32;
            assert!(8 * length >= n && 8 * (n - length) >= n, "{n}: {length}");
        }
    }
}
