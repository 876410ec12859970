//! One light of many, chosen by what it could bring.
//!
//! Every light's unoccluded, unattenuated contribution is estimated, damped by the fog on the way, and one is picked in
//! proportion. The estimate steers the choice only; it never enters a result, and a small even share keeps every light in
//! reach of the choice where the estimate is wrong.

use crate::world::Lights;
use glam::Vec3;
use smallvec::SmallVec;
use tyndall_math::Ray;

/// The chances of all lights at one place.
#[derive(Clone, Debug, Default)]
pub struct LightChoice {
    /// Running sum of the lights' importance.
    cumulative: SmallVec<[f32; 8]>,
}

/// Optical depth beyond which a light's damping is no longer told apart: the extinction at one place says little about a
/// long way.
const DEEPEST: f32 = 6.0;
/// Share of choices spread evenly over all lights.
const EVEN_SHARE: f32 = 0.02;

/// About e^−τ for the optical depth τ of a way through fog: the inverse of the exponential's series up to τ³, which steers a
/// choice as well and costs no `exp`. It falls to 1/61 at [`DEEPEST`] and no further.
pub(crate) fn damping(tau: f32) -> f32 {
    let tau = tau.min(DEEPEST);
    1.0 / (1.0 + tau * (1.0 + tau * (1.0 / 2.0 + tau * (1.0 / 6.0))))
}

impl LightChoice {
    /// Chances at the point `p`, on a surface with `normal` or in a medium.
    /// `sigma` is the extinction there per metre.
    pub fn at<L: Lights>(lights: &L, p: Vec3, normal: Option<Vec3>, sigma: f32) -> Self {
        if lights.count() == 1 {
            return Self::sum(1, |_| 1.0);
        }
        Self::sum(lights.count(), |l| {
            let damping = lights
                .pivot(l)
                .map_or(1.0, |pivot| damping(sigma * pivot.distance(p)));
            lights.importance(l, p, normal) * damping
        })
    }

    /// Chances for scattering on `ray` between 0 and the finite `t_max`, where the mean extinction is `sigma` per metre.
    pub fn along<L: Lights>(lights: &L, ray: &Ray, t_max: f32, sigma: f32) -> Self {
        if lights.count() == 1 {
            return Self::sum(1, |_| 1.0);
        }
        Self::sum(lights.count(), |l| {
            let damping = lights.pivot(l).map_or(1.0, |pivot| {
                let t = (pivot - ray.origin).dot(ray.direction).clamp(0.0, t_max);
                let detour = pivot.distance(ray.at(t));
                damping(sigma * (t + detour))
            });
            lights.importance_along(l, ray, t_max) * damping
        })
    }

    fn sum(count: usize, importance: impl Fn(usize) -> f32) -> Self {
        let mut total = 0.0;
        let mut cumulative = SmallVec::with_capacity(count);
        for light in 0..count {
            let weight = importance(light);
            if weight.is_finite() {
                total += weight.max(0.0);
            }
            cumulative.push(total);
        }
        Self { cumulative }
    }

    /// The choice among the same lights in the same proportions, but for those `taken` by other means: their importance is
    /// zero, and only the even share still picks them.
    pub fn without(&self, taken: &[usize]) -> Self {
        Self::sum(self.cumulative.len(), |light| {
            if taken.contains(&light) {
                0.0
            } else {
                self.importance(light)
            }
        })
    }

    fn importance(&self, light: usize) -> f32 {
        let below = light.checked_sub(1).map_or(0.0, |l| self.cumulative[l]);
        self.cumulative[light] - below
    }

    fn total(&self) -> f32 {
        self.cumulative.last().copied().unwrap_or(0.0)
    }

    /// Picks a light; returns it with its chance. `None` where there are no lights.
    pub fn sample(&self, u: f32) -> Option<(usize, f32)> {
        let count = self.cumulative.len();
        let last = count.checked_sub(1)?;
        let share = self.even_share();
        let light = if u < share {
            (u / share * count as f32) as usize
        } else {
            let target = (u - share) / (1.0 - share) * self.total();
            self.cumulative.partition_point(|&c| c <= target)
        }
        .min(last);
        Some((light, self.pdf(light)))
    }

    /// Chance of picking `light`.
    pub fn pdf(&self, light: usize) -> f32 {
        let share = self.even_share();
        let even = share / self.cumulative.len() as f32;
        if share >= 1.0 {
            return even;
        }
        even + (1.0 - share) * self.importance(light) / self.total()
    }

    /// All of the choices where no light seems to arrive, none where there is one light alone.
    fn even_share(&self) -> f32 {
        match self.cumulative.len() {
            _ if self.total() <= 0.0 => 1.0,
            1 => 0.0,
            _ => EVEN_SHARE,
        }
    }
}
