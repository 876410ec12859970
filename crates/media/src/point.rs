//! All media at one point: coefficients, phase function, sampling.
//!
//! Overlapping media add: coefficients sum, phase functions mix in proportion to scattering, channel by channel.

use crate::{Medium, PhaseFunction};
use glam::Vec3;
use smallvec::SmallVec;
use tyndall_math::Jet;

/// The media at a point.
#[derive(Clone, Debug)]
pub struct MediumPoint<'a> {
    /// Extinction, per metre.
    pub sigma_t: Vec3,
    /// Scattering, per metre.
    pub sigma_s: Vec3,
    /// Emitted radiance per metre, W/(m³ sr).
    pub emission: Vec3,
    position: Vec3,
    lobes: SmallVec<[Lobe<'a>; 4]>,
}

/// The media's common phase function for one pair of directions; see [`MediumPoint::phase`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseValue {
    /// Σ σs p / Σ σs over the media, per steradian.
    pub value: Vec3,
    /// Its derivative with respect to the cosine of scattering μ = −`w_i` · `w_o`.
    pub slope: Vec3,
    /// Its gradient per metre and channel when the point moves and the directions stay: media of different phase
    /// functions change their shares.
    pub gradient: [Vec3; 3],
}

/// One medium's share of the scattering.
#[derive(Clone, Copy, Debug)]
struct Lobe<'a> {
    medium: &'a Medium,
    density: f32,
}

impl Lobe<'_> {
    /// Weight in the choice among media.
    fn weight(&self) -> f32 {
        self.density * self.medium.mean_sigma_s()
    }
}

impl<'a> MediumPoint<'a> {
    /// The point `position`, without media yet.
    pub(crate) fn empty(position: Vec3) -> Self {
        Self {
            sigma_t: Vec3::ZERO,
            sigma_s: Vec3::ZERO,
            emission: Vec3::ZERO,
            position,
            lobes: SmallVec::new(),
        }
    }

    /// Adds a medium whose region holds the point.
    pub(crate) fn add(&mut self, medium: &'a Medium) {
        let density = medium.density().value(self.position);
        self.sigma_t += medium.sigma_t() * density;
        self.sigma_s += medium.sigma_s() * density;
        self.emission += medium.emission() * density;
        let lobe = Lobe { medium, density };
        if lobe.weight() > 0.0 {
            self.lobes.push(lobe);
        }
    }

    /// `Σ σs p(w_o, w_i)` over the media, per metre and steradian: what turns radiance from `w_i` into radiance along `w_o`.
    pub fn scattering(&self, w_o: Vec3, w_i: Vec3) -> Vec3 {
        self.lobes
            .iter()
            .map(|lobe| lobe.medium.sigma_s() * (lobe.density * lobe.medium.phase().eval(w_o, w_i)))
            .sum()
    }

    /// The phase functions mixed by scattering, channel by channel, and how the mixture changes.
    ///
    /// A channel that does not scatter is taken to scatter equally in all directions.
    pub fn phase(&self, w_o: Vec3, w_i: Vec3) -> PhaseValue {
        let (mut sum, mut slope) = (Vec3::ZERO, Vec3::ZERO);
        let mut moved = [Vec3::ZERO; 3];
        for lobe in &self.lobes {
            let medium = lobe.medium;
            let [value, d_value, _] = medium.phase().derivatives(w_o, w_i);
            let sigma_s = medium.sigma_s() * lobe.density;
            sum += sigma_s * value;
            slope += sigma_s * d_value;
            let gradient = medium.density().gradient(self.position) * value;
            for (channel, moved) in moved.iter_mut().enumerate() {
                *moved += medium.sigma_s()[channel] * gradient;
            }
        }
        let scatters = self.sigma_s.cmpgt(Vec3::ZERO);
        let isotropic = Vec3::splat(PhaseFunction::Isotropic.eval(w_o, w_i));
        let value = Vec3::select(scatters, sum / self.sigma_s, isotropic);
        // The quotient rule.
        let mixes = self.mixes();
        let density = self.grad_ln_sigma_s();
        PhaseValue {
            value,
            slope: Vec3::select(scatters, slope / self.sigma_s, Vec3::ZERO),
            gradient: std::array::from_fn(|c| {
                if mixes && scatters.test(c) {
                    moved[c] / self.sigma_s[c] - density[c] * value[c]
                } else {
                    Vec3::ZERO
                }
            }),
        }
    }

    /// The Legendre moment `χ_l` of the phase functions mixed by scattering, channel by channel: the factor by which scattering scales
    /// band l of spherical harmonics. 0 where a channel does not scatter and l > 0.
    pub fn moments(&self, l: usize) -> Vec3 {
        if l == 0 {
            return Vec3::ONE;
        }
        let scattered = |lobe: &Lobe<'_>| {
            let medium = lobe.medium;
            medium.sigma_s() * (lobe.density * medium.phase().moments(l))
        };
        let sum: Vec3 = self.lobes.iter().map(scattered).sum();
        let scatters = self.sigma_s.cmpgt(Vec3::ZERO);
        Vec3::select(scatters, sum / self.sigma_s, Vec3::ZERO)
    }

    /// Whether media of different phase functions meet: with one alone the derivatives of shares cancel, but not to the last digit.
    fn mixes(&self) -> bool {
        self.lobes
            .windows(2)
            .any(|l| l[0].medium.phase() != l[1].medium.phase())
    }

    /// [`MediumPoint::phase`] for each channel with first and second derivatives, when the point moves and with it `mu`, the cosine of
    /// scattering, whose value is that of the directions given.
    ///
    /// p = Σ σs ρ(x) p(μ(x))/Σ σs ρ(x). Tested against central differences.
    pub fn phase_jet(&self, w_o: Vec3, w_i: Vec3, mu: Jet) -> [Jet; 3] {
        let mixes = self.mixes();
        let (mut sum, mut total) = ([Jet::ZERO; 3], [Jet::ZERO; 3]);
        for lobe in &self.lobes {
            let [p, d_p, d2_p] = lobe.medium.phase().derivatives(w_o, w_i).map(f64::from);
            let density = if mixes {
                lobe.medium.density().jet(self.position.as_dvec3())
            } else {
                Jet::from(f64::from(lobe.density))
            };
            let scattered = density * mu.map(p, d_p, d2_p);
            for (c, sigma_s) in lobe.medium.sigma_s().to_array().into_iter().enumerate() {
                sum[c] += scattered * f64::from(sigma_s);
                total[c] += density * f64::from(sigma_s);
            }
        }
        std::array::from_fn(|c| {
            if total[c].value > 0.0 {
                sum[c] / total[c]
            } else {
                f64::from(PhaseFunction::Isotropic.eval(w_o, w_i)).into()
            }
        })
    }

    /// Density per steradian with which [`MediumPoint::sample_phase`] picks `w_i`; 0 where nothing scatters.
    pub fn phase_pdf(&self, w_o: Vec3, w_i: Vec3) -> f32 {
        if let [lobe] = self.lobes.as_slice() {
            return lobe.medium.phase().pdf(w_o, w_i);
        }
        let (mut sum, mut total) = (0.0, 0.0);
        for lobe in &self.lobes {
            let weight = lobe.weight();
            sum += weight * lobe.medium.phase().pdf(w_o, w_i);
            total += weight;
        }
        if total > 0.0 { sum / total } else { 0.0 }
    }

    /// A direction drawn from the phase functions mixed by their mean scattering, and its density per steradian.
    ///
    /// `u` holds two numbers in [0, 1). Where nothing scatters the direction goes straight on, with density 0.
    pub fn sample_phase(&self, w_o: Vec3, u: [f32; 2]) -> (Vec3, f32) {
        if let [lobe] = self.lobes.as_slice() {
            return lobe.medium.phase().sample(w_o, u);
        }
        let total: f32 = self.lobes.iter().map(Lobe::weight).sum();
        // The first number chooses the medium; what is left of it is uniform again and chooses the angle.
        let mut rest = u[0] * total;
        let mut chosen = None;
        for lobe in &self.lobes {
            let weight = lobe.weight();
            chosen = Some((lobe, (rest / weight).min(BELOW_ONE)));
            if rest < weight {
                break;
            }
            rest -= weight;
        }
        let Some((lobe, u0)) = chosen else {
            return (-w_o, 0.0);
        };
        let (w_i, _) = lobe.medium.phase().sample(w_o, [u0, u[1]]);
        (w_i, self.phase_pdf(w_o, w_i))
    }

    /// ∇σs/σs, per metre, for each colour channel; zero where a channel does not scatter.
    ///
    /// The density's own gradient: the step at a region's boundary is not in it.
    pub fn grad_ln_sigma_s(&self) -> [Vec3; 3] {
        let mut gradient = [Vec3::ZERO; 3];
        for lobe in &self.lobes {
            let grad_density = lobe.medium.density().gradient(self.position);
            for (channel, sum) in gradient.iter_mut().enumerate() {
                *sum += lobe.medium.sigma_s()[channel] * grad_density;
            }
        }
        for (channel, sum) in gradient.iter_mut().enumerate() {
            let sigma_s = self.sigma_s[channel];
            *sum = if sigma_s > 0.0 {
                *sum / sigma_s
            } else {
                Vec3::ZERO
            };
        }
        gradient
    }
}

/// The largest f32 below 1.
pub(crate) const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use crate::{Density, Media, Medium, MediumParams, PhaseFunction, Region};
    use glam::{DVec3, Vec3};
    use tyndall_math::Jet;
    use tyndall_math::testing::{Directions, assert_conforms};

    /// Coloured forward haze everywhere, isotropic height fog, backward dust in a ball around the origin.
    fn media() -> Media {
        let haze = MediumParams {
            phase: PhaseFunction::henyey_greenstein(0.6).unwrap(),
            emission: Vec3::X,
            ..MediumParams::new(Vec3::new(0.3, 0.2, 0.1), Vec3::new(1.0, 0.5, 0.0))
        };
        let fog = MediumParams {
            density: Density::Height {
                base: -2.0,
                scale_height: 3.0,
            },
            ..MediumParams::new(Vec3::splat(0.4), Vec3::splat(0.9))
        };
        let dust = MediumParams {
            phase: PhaseFunction::henyey_greenstein(-0.3).unwrap(),
            region: Region::Sphere {
                center: Vec3::ZERO,
                radius: 1.0,
            },
            ..MediumParams::new(Vec3::splat(2.0), Vec3::splat(0.1))
        };
        Media::new([haze, fog, dust].map(|p| Medium::new(p).unwrap()).into())
    }

    const INSIDE: Vec3 = Vec3::new(0.2, 0.4, 0.1);
    const ABOVE: Vec3 = Vec3::new(0.0, 2.0, 0.0);

    #[test]
    fn coefficients_of_overlapping_media_add() {
        let media = media();
        let fog = (-2.4_f32 / 3.0).exp();
        let point = media.at(INSIDE);
        let near = |a: Vec3, b: Vec3| a.abs_diff_eq(b, 1e-6);
        assert!(near(point.sigma_t, Vec3::new(2.3, 2.2, 2.1) + 0.4 * fog));
        assert!(near(point.sigma_s, Vec3::new(0.5, 0.3, 0.2) + 0.36 * fog));
        assert_eq!(point.emission, Vec3::X);
        let (w_o, w_i) = (Vec3::X, Vec3::new(0.0, 0.6, -0.8));
        let lobe = |g: f32| PhaseFunction::henyey_greenstein(g).unwrap().eval(w_o, w_i);
        let expected =
            Vec3::new(0.3, 0.1, 0.0) * lobe(0.6) + 0.36 * fog * lobe(0.0) + 0.2 * lobe(-0.3);
        assert!(near(point.scattering(w_o, w_i), expected));
    }

    #[test]
    fn mixed_phase_functions_are_sampled_as_stated() {
        let media = media();
        for p in [INSIDE, ABOVE, Vec3::new(0.0, 40.0, 0.0)] {
            let point = media.at(p);
            let w_o = Vec3::new(0.6, 0.0, 0.8);
            assert_conforms(
                &Directions::sphere(),
                7,
                |u| Some(point.sample_phase(w_o, u)),
                |w_i| point.phase_pdf(w_o, w_i),
            );
        }
    }

    #[test]
    fn every_random_number_chooses_a_direction() {
        let media = media();
        let point = media.at(INSIDE);
        for u in [0.0, 0.25, 0.5, 0.75, 1.0 - f32::EPSILON / 2.0] {
            let (w_i, pdf) = point.sample_phase(Vec3::Y, [u, 0.5]);
            assert!(w_i.is_normalized() && pdf > 0.0);
        }
    }

    #[test]
    fn where_nothing_scatters_nothing_is_sampled() {
        let soot = MediumParams::new(Vec3::ONE, Vec3::ZERO);
        for media in [
            Media::default(),
            Media::new(vec![Medium::new(soot).unwrap()]),
        ] {
            let point = media.at(Vec3::ZERO);
            assert_eq!(point.sample_phase(Vec3::Z, [0.3, 0.6]), (Vec3::NEG_Z, 0.0));
            assert_eq!(point.phase_pdf(Vec3::Z, Vec3::X), 0.0);
            assert_eq!(point.scattering(Vec3::Z, Vec3::X), Vec3::ZERO);
            assert_eq!(point.grad_ln_sigma_s(), [Vec3::ZERO; 3]);
        }
    }

    #[test]
    fn the_mixed_phase_function_and_its_gradient_agree_with_scattering() {
        let media = media();
        let (w_o, w_i) = (Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.0, -0.8, 0.6));
        let h = 1e-2;
        for p in [ABOVE, Vec3::new(3.0, -1.0, 0.0)] {
            let share = |p: Vec3| media.at(p).scattering(w_o, w_i) / media.at(p).sigma_s;
            let phase = media.at(p).phase(w_o, w_i);
            assert!((phase.value - share(p)).abs().max_element() < 1e-6);
            let slope = (share(p + h * Vec3::Y) - share(p - h * Vec3::Y)) / (2.0 * h);
            for channel in 0..3 {
                // f32 rounding over the step.
                assert!((phase.gradient[channel] - slope[channel] * Vec3::Y).length() < 3e-5);
            }
        }
    }

    #[test]
    fn the_jet_of_the_phase_function_has_its_differences() {
        let media = media();
        let w_o = Vec3::new(0.6, 0.0, 0.8);
        let lamp = DVec3::new(1.0, 1.5, 2.0);
        let at = |p: Vec3| {
            let way = Jet::point(p.as_dvec3()) - lamp;
            let mu = (way / way.length()).dot_fixed(w_o.as_dvec3());
            let w_i = (lamp - p.as_dvec3()).normalize().as_vec3();
            (
                media.at(p).phase(w_o, w_i).value,
                media.at(p).phase_jet(w_o, w_i, mu),
            )
        };
        let h = 0.015_625;
        // Haze and fog above and below its base; these and dust.
        for p in [
            ABOVE,
            Vec3::new(3.0, -1.0, 0.0),
            Vec3::new(0.5, -3.0, 0.0),
            INSIDE,
        ] {
            let (value, jet) = at(p);
            for (i, axis) in Vec3::AXES.into_iter().enumerate() {
                let ([_, after], [_, before]) = (
                    [at(p), at(p + h * axis)].map(|f| f.1),
                    [at(p), at(p - h * axis)].map(|f| f.1),
                );
                for c in 0..3 {
                    let (after, before) = (after[c], before[c]);
                    let slope = (after.value - before.value) / f64::from(2.0 * h);
                    let column = (after.gradient - before.gradient) / f64::from(2.0 * h);
                    assert!((jet[c].value - f64::from(value[c])).abs() < 1e-7);
                    // h²/6 of third derivatives, up to 0.3 m⁻³.
                    assert!(
                        (jet[c].gradient[i] - slope).abs() < 3e-5,
                        "{p} {i}: {} {slope}",
                        jet[c].gradient
                    );
                    assert!(
                        (jet[c].hessian.col(i) - column).length() < 3e-5,
                        "{p} {i}: {} {column}",
                        jet[c].hessian
                    );
                }
            }
        }
    }

    #[test]
    fn the_logarithmic_gradient_of_scattering_is_its_slope() {
        let media = media();
        let h = 1e-2;
        for p in [ABOVE, Vec3::new(3.0, -1.0, 0.0), Vec3::new(3.0, -3.0, 0.0)] {
            let [up, down] = [h, -h].map(|h| media.at(p + h * Vec3::Y).sigma_s);
            let slope = (up - down) / (2.0 * h * media.at(p).sigma_s);
            let gradient = media.at(p).grad_ln_sigma_s();
            for channel in 0..3 {
                // f32 rounding over the step; the error of the difference, h²/54, is smaller.
                assert!((gradient[channel] - slope[channel] * Vec3::Y).length() < 3e-5);
            }
        }
    }
}
