//! What every phase function must satisfy: one call tests a new one.
//!
//! Integrals run over panels that shrink geometrically towards both poles, so that a lobe of any width is resolved.

use super::PhaseFunction;
use glam::{DVec3, Vec3};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use tyndall_math::quadrature::gauss_legendre;
use tyndall_math::stats::chi_square_test;
use tyndall_math::{Frame, Key, Purpose, Sampler};

/// f32 evaluation errs by about 5e-7 where it errs most; sums of it by less than four times that.
const ROUNDING: f64 = 2e-6;
/// Chance that a correct sampler fails a χ² test, were its seed not fixed.
const FALSE_ALARM: f64 = 1e-6;
const N_SAMPLES: u64 = 200_000;
/// Panels on either side of the equator: the last reaches 1 − |μ| = 2⁻⁴⁴, 10⁻⁶ rad.
const PANELS: i32 = 44;

/// Checks normalisation, moments, derivatives, sampled = evaluated, reciprocity, and the χ² of samples, around several directions.
pub(super) fn check(phase: &PhaseFunction) {
    let oblique = Vec3::new(0.36, -0.48, 0.8).normalize();
    // Around an axis, where f32 directions are fine enough for the narrowest peak.
    moments_are_integrals(phase, Vec3::Z);
    derivatives_integrate_to_differences(phase, Vec3::Z);
    for w_o in [Vec3::Z, Vec3::NEG_Y, oblique] {
        is_reciprocal(phase, w_o);
        samples_follow_the_density(phase, w_o);
    }
}

/// A position on the sphere by its distance from the nearer pole: 1 − |μ|, and on which side.
#[derive(Clone, Copy)]
struct Height {
    to_pole: f64,
    forward: bool,
}

impl Height {
    fn mu(self) -> f64 {
        let mu = 1.0 - self.to_pole;
        if self.forward { mu } else { -mu }
    }

    /// The `w_i` at this height and azimuth `phi`.
    fn direction(self, w_o: Vec3, phi: f64) -> Vec3 {
        let sin = (self.to_pole * (2.0 - self.to_pole)).sqrt();
        let local = DVec3::new(sin * phi.cos(), sin * phi.sin(), self.mu());
        Frame::from_normal(-w_o).to_world(local.as_vec3())
    }

    fn of(w_o: Vec3, w_i: Vec3) -> Self {
        // From differences of vectors: a cosine in f32 knows nothing of angles below 3e-4.
        let [forward, backward] =
            [w_i + w_o, w_i - w_o].map(|v| 0.5 * v.as_dvec3().length_squared());
        Self {
            to_pole: forward.min(backward),
            forward: forward < backward,
        }
    }

    /// Number of the panel, of 2 × (PANELS + 1).
    fn panel(self) -> usize {
        let n = (-self.to_pole.log2()).clamp(0.0, f64::from(PANELS)) as usize;
        2 * n + usize::from(self.forward)
    }
}

/// The heights between which panel `n` of either side lies.
fn ends(n: i32) -> [f64; 2] {
    let high = 0.5_f64.powi(n);
    [high, if n == PANELS { 0.0 } else { 0.5 * high }]
}

/// Heights and weights (in μ) of a quadrature over each panel, in the order of [`Height::panel`].
fn panels() -> Vec<Vec<(Height, f64)>> {
    let rule = gauss_legendre(16);
    (0..=PANELS)
        .flat_map(|n| [(n, false), (n, true)])
        .map(|(n, forward)| {
            let [high, low] = ends(n);
            rule.iter()
                .map(|(x, weight)| {
                    let half = 0.5 * (high - low);
                    let to_pole = low + half * (1.0 + x);
                    (Height { to_pole, forward }, weight * half)
                })
                .collect()
        })
        .collect()
}

fn legendre(l: usize, x: f64) -> f64 {
    let (mut previous, mut p) = (1.0, x);
    if l == 0 {
        return 1.0;
    }
    for l in 2..=l {
        let l = l as f64;
        (previous, p) = (p, ((2.0 * l - 1.0) * x * p - (l - 1.0) * previous) / l);
    }
    p
}

fn moments_are_integrals(phase: &PhaseFunction, w_o: Vec3) {
    for l in 0..=8 {
        let integral: f64 = panels()
            .iter()
            .flatten()
            .map(|&(height, weight)| {
                let w_i = height.direction(w_o, 1.0);
                TAU * weight * f64::from(phase.eval(w_o, w_i)) * legendre(l, height.mu())
            })
            .sum();
        let stated = f64::from(phase.moments(l));
        assert!(
            (integral - stated).abs() < ROUNDING,
            "{phase:?}: moment {l} is {integral}, not {stated}"
        );
    }
    assert_eq!(phase.moments(0), 1.0);
    assert_eq!(phase.mean_cosine(), phase.moments(1));
}

/// ∫ p′ dμ over a panel is the difference of p between its ends, and so on: that asks for no small differences of f32 values.
fn derivatives_integrate_to_differences(phase: &PhaseFunction, w_o: Vec3) {
    let at = |height: Height| {
        let w_i = height.direction(w_o, 1.0);
        let derivatives = phase.derivatives(w_o, w_i);
        assert_eq!(derivatives[0], phase.eval(w_o, w_i));
        derivatives.map(f64::from)
    };
    for panel in panels() {
        let forward = panel[0].0.forward;
        let [outer, inner] =
            ends(panel[0].0.panel() as i32 / 2).map(|to_pole| at(Height { to_pole, forward }));
        for k in [0, 1] {
            let integral: f64 = panel
                .iter()
                .map(|&(height, weight)| weight * at(height)[k + 1])
                .sum();
            let difference = if forward {
                inner[k] - outer[k]
            } else {
                outer[k] - inner[k]
            };
            let largest = inner[k].abs().max(outer[k].abs());
            assert!(
                (integral - difference).abs() <= ROUNDING * largest,
                "{phase:?}, derivative {}: {integral}, not {difference} from {outer:?} to {inner:?}",
                k + 1
            );
        }
    }
}

fn is_reciprocal(phase: &PhaseFunction, w_o: Vec3) {
    for height in panels().iter().flatten().map(|p| p.0) {
        let w_i = height.direction(w_o, 2.0);
        let (there, back) = (phase.eval(w_o, w_i), phase.eval(w_i, w_o));
        assert!(there > 0.0 && there.is_finite());
        assert!(
            (there - back).abs() <= 1e-6 * there,
            "reciprocity of {phase:?}"
        );
    }
}

fn samples_follow_the_density(phase: &PhaseFunction, w_o: Vec3) {
    const SECTORS: usize = 4;
    let panels = panels();
    let expected: Vec<f64> = panels
        .iter()
        .flat_map(|panel| {
            let mass: f64 = panel
                .iter()
                .map(|&(height, weight)| {
                    weight * f64::from(phase.pdf(w_o, height.direction(w_o, 0.5)))
                })
                .sum();
            [mass * TAU / SECTORS as f64 * N_SAMPLES as f64; SECTORS]
        })
        .collect();
    let mut observed = vec![0; expected.len()];
    let mut sampler = Sampler::new(
        Key {
            seed: 20_240_501,
            purpose: Purpose::Probe,
            index: 0,
        },
        0,
    );
    // Independent numbers: stratified ones would make χ² too small.
    sampler.start_set(1000);
    let frame = Frame::from_normal(-w_o);
    for _ in 0..N_SAMPLES {
        let (w_i, density) = phase.sample(w_o, sampler.next_2d());
        assert!((w_i.length() - 1.0).abs() < 1e-6);
        assert_eq!(density, phase.pdf(w_o, w_i));
        assert_eq!(density, phase.eval(w_o, w_i));
        let local = frame.to_local(w_i).as_dvec3();
        let sector = ((local.y.atan2(local.x) + PI) / FRAC_PI_2) as usize % SECTORS;
        observed[Height::of(w_o, w_i).panel() * SECTORS + sector] += 1;
    }
    let result = chi_square_test(&observed, &expected);
    assert!(
        result.p_value > FALSE_ALARM,
        "{phase:?} around {w_o}: {result:?}"
    );
}
