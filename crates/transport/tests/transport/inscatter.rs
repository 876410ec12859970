//! Single scattering at a point against closed forms and quadrature: value, gradient and Hessian, and shadows that move.
//!
//! Numbers: `exact-benchmarks.md` E2b, computed to ten digits and more outside this project.

use crate::rig::fog;
use crate::stage::{Card, Lamp, Stage};
use glam::{DMat3, DVec3, Vec3};
use proptest::prelude::*;
use std::f64::consts::PI;
use tyndall_math::spherical::solid_angle_gradient;
use tyndall_math::stats::Welford;
use tyndall_math::{Key, Purpose};
use tyndall_media::{Media, PhaseFunction, Region};
use tyndall_transport::World;
use tyndall_transport::gather::Derivatives;
use tyndall_transport::inscatter::{self, Inscattered, Order};

const X: Vec3 = Vec3::new(0.3, 0.2, 0.1);
const TOWARDS: Vec3 = Vec3::new(0.2, 0.3, -0.9);

/// Radiance 1 at z = 2, |x| < 1, |y| < ½.
const CARD: Card = Card {
    corner: Vec3::new(-1.0, -0.5, 2.0),
    edges: [Vec3::new(2.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0)],
};
const RECTANGLE: Lamp = Lamp::Card {
    card: CARD,
    radiance: 1.0,
};

/// Extinction and mean cosine; value, gradient, and the Hessian's xx, yy, zz, xy, xz, yz where it is known.
type Row = (f32, f32, f64, [f64; 3], Option<[f64; 6]>);

/// A lamp of 2.5 W/sr at (1.1, −0.4, 1.6).
const POINT: [Row; 4] = [
    (
        0.8,
        0.0,
        0.014470994365050189,
        [
            0.012261502426130694,
            -0.00919612681959802,
            0.02299031704899505,
        ],
        Some([
            -0.0001656523331424594,
            -0.006798688576682857,
            0.03797430606721482,
            -0.011370919274640682,
            0.028427298186601703,
            -0.021320473639951276,
        ]),
    ),
    (
        0.8,
        0.5,
        0.03409774815960881,
        [
            0.06261379008927302,
            -0.018713630366640734,
            0.03736850518316383,
        ],
        Some([
            0.10769333570745783,
            -0.043968871089868924,
            0.026235841597043327,
            -0.05025465971046406,
            0.09982121367060852,
            -0.04015262284599376,
        ]),
    ),
    (
        0.8,
        0.9,
        0.010903925816867588,
        [
            0.031911035711437954,
            -0.0049425828682479805,
            0.0060262258655097885,
        ],
        Some([
            0.11373874071216832,
            -0.02359718007750491,
            -0.0036764126265842367,
            -0.020731507989832004,
            0.02296998519188622,
            -0.011083938633284957,
        ]),
    ),
    (
        0.8,
        -0.7,
        0.0017733201980903723,
        [
            0.0010601700483935418,
            -0.0011656880178197541,
            0.0030377402050575848,
        ],
        Some([
            -0.0005250775857964712,
            -0.00045946234121692895,
            0.0057098652848107554,
            -0.0010056245025939175,
            0.002597768947278716,
            -0.0027848424762435676,
        ]),
    ),
];

/// A ball of radiance 3 and radius 0.6 at (0.5, 0.4, 2).
const BALL: [Row; 4] = [
    (
        0.0,
        0.0,
        0.07504813945240635,
        [
            0.008349531153871492,
            0.008349531153871492,
            0.07932054596177918,
        ],
        Some([
            -0.039888535084689675,
            -0.039888535084689675,
            0.1260379860219106,
            0.00185912068466779,
            0.017661646504344007,
            0.017661646504344007,
        ]),
    ),
    (
        0.25,
        0.0,
        0.05192510359512541,
        [
            0.007160493303003613,
            0.007160493303003613,
            0.06802468637853432,
        ],
        Some([
            -0.03409287934891928,
            -0.03409287934891928,
            0.11848777522539697,
            0.0017095871660987815,
            0.016241078077938426,
            0.016241078077938426,
        ]),
    ),
    (
        0.8,
        0.0,
        0.02315694313556554,
        [
            0.004549078954397253,
            0.004549078954397253,
            0.043216250066773904,
        ],
        Some([
            -0.021452875129285367,
            -0.021452875129285367,
            0.09390450298176956,
            0.0012925196427008955,
            0.012278936605658507,
            0.012278936605658507,
        ]),
    ),
    (
        3.0,
        0.0,
        0.0009490023356168448,
        [
            0.0004078038884107386,
            0.0004078038884107386,
            0.003874136939902017,
        ],
        Some([
            -0.0018349748458939227,
            -0.0018349748458939227,
            0.016376005361365586,
            0.00020404459615977043,
            0.001938423663517819,
            0.001938423663517819,
        ]),
    ),
];

/// [`RECTANGLE`]; in vacuum its solid angle over 4π.
const CARDS: [Row; 4] = [
    (
        0.0,
        0.0,
        0.03647843269281897,
        [
            -0.0054683964573024445,
            -0.004883799192046311,
            0.03222955675021365,
        ],
        Some([
            -0.017332335691164723,
            -0.023414475126804817,
            0.04074681082543765,
            0.0010232558902722837,
            -0.008120924274348481,
            -0.008526212666565875,
        ]),
    ),
    (
        0.8,
        0.0,
        0.007282578897521665,
        [
            -0.0015154915499154572,
            -0.0014667065310150279,
            0.012032924991757551,
        ],
        None,
    ),
    (
        0.8,
        0.7,
        0.05654529165605473,
        [
            0.00022233097788167081,
            0.043784676897880785,
            0.08656327411339593,
        ],
        None,
    ),
    (
        3.0,
        -0.4,
        2.8680199155361154e-05,
        [
            -9.11824829189335e-06,
            -1.2264052316653234e-05,
            0.00010902240424545539,
        ],
        None,
    ),
];

fn key(index: u64) -> Key {
    Key {
        seed: 3,
        purpose: Purpose::Probe,
        index,
    }
}

fn medium(sigma_t: f32, g: f32) -> Media {
    let phase = PhaseFunction::henyey_greenstein(g).unwrap();
    fog(sigma_t, 0.5, Region::Everywhere, phase)
}

fn single(
    stage: &Stage,
    media: &Media,
    x: Vec3,
    samples: usize,
    derivatives: Derivatives,
    index: u64,
) -> Inscattered {
    let world = World {
        geometry: stage,
        lights: stage,
        media,
    };
    let towards = Some(TOWARDS.normalize());
    let asked = (Order::Hessian, derivatives);
    inscatter::single(&world, x, towards, samples, asked, key(index))
}

fn symmetric([xx, yy, zz, xy, xz, yz]: [f64; 6]) -> DMat3 {
    DMat3::from_cols_array_2d(&[[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
}

fn norm(m: DMat3) -> f64 {
    m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Asserts that value, gradient and Hessian are within `tolerance` of their sizes; `missing` is known to be left out of the
/// Hessian.
fn check(name: &str, lamp: Lamp, row: &Row, samples: usize, tolerance: f64, missing: DMat3) {
    let &(sigma_t, g, value, gradient, hessian) = row;
    let (stage, media) = (Stage::lamp(lamp), medium(sigma_t, g));
    let found = single(&stage, &media, X, samples, Derivatives::Aware, 0);
    let exact = DVec3::from(gradient);
    let mut errors = vec![
        f64::from(found.value.x) / value - 1.0,
        found.gradient[0].as_dvec3().distance(exact) / exact.length(),
    ];
    let h = found.hessian.unwrap()[0];
    assert_eq!(h, h.transpose());
    if let Some(exact) = hessian.map(symmetric) {
        errors.push(norm(h + missing - exact) / norm(exact));
    }
    let shown: Vec<String> = errors.iter().map(|e| format!("{e:.1e}")).collect();
    println!("{name} σt {sigma_t} g {g}: relative errors {shown:?}");
    assert!(errors.iter().all(|e| e.abs() < tolerance), "{name}");
}

#[test]
fn a_lamp_without_extent_has_the_closed_forms_derivatives() {
    let lamp = Lamp::Point {
        position: Vec3::new(1.1, -0.4, 1.6),
        intensity: 2.5,
    };
    for row in &POINT {
        // A dozen f32 roundings, magnified by the peak of g = 0.9.
        check("point", lamp, row, 1, 5e-6, DMat3::ZERO);
    }
}

#[test]
fn a_rectangle_has_the_exact_derivatives() {
    for row in &CARDS {
        check("rectangle", RECTANGLE, row, 1 << 16, 1e-3, DMat3::ZERO);
    }
}

/// The emitter's points stay, so the Hessian of a ball misses that its limb moves over them: with H = max(n′·v, 0)/r³ the missing
/// term is ∫ p T L δ(n′·v) n′ n′ᵀ/r³ dA′, on the limb ∮ n′ n′ᵀ dφ p T L R²/(d r³), d = |x − c|, r² = d² − R².
#[test]
fn a_ball_has_the_exact_derivatives_but_for_the_hessian_of_its_limb() {
    let (center, radius, radiance) = (Vec3::new(0.5, 0.4, 2.0), 0.6f32, 3.0f32);
    let lamp = Lamp::Ball {
        center,
        radius,
        radiance,
    };
    let (axis, big_r) = ((X - center).as_dvec3(), f64::from(radius));
    let (d, axis) = (axis.length(), axis.normalize());
    let r = (d * d - big_r * big_r).sqrt();
    // n′ = cosα axis + sinα (across), cosα = R/d: the mean over φ of n′ n′ᵀ.
    let along = DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
    let cos2 = (big_r / d).powi(2);
    let mean = along * cos2 + (DMat3::IDENTITY - along) * (0.5 * (1.0 - cos2));
    for row in &BALL {
        let transmittance = (-f64::from(row.0) * r).exp();
        let limb = 2.0 * PI * f64::from(radiance) / (4.0 * PI) * transmittance * big_r.powi(2)
            / (d * r.powi(3));
        check("ball", lamp, row, 1 << 18, 1e-3, mean * limb);
    }
}

/// Hides what is beyond x = 0.4 at z = 1.
fn half_hidden(lamps: Vec<Lamp>) -> Stage {
    Stage {
        lamps,
        cards: vec![Card {
            corner: Vec3::new(0.4, -50.0, 1.0),
            edges: [Vec3::new(100.0, 0.0, 0.0), Vec3::new(0.0, 100.0, 0.0)],
        }],
    }
}

/// Gradient of the solid angle of what is left of [`RECTANGLE`], over 4π; its silhouette is an edge nearer than the light.
fn half_hidden_gradient() -> DVec3 {
    let x = X.as_dvec3();
    // From z = 1 to the light's plane, seen from x.
    let beyond = 1.9 / 0.9;
    let cut = x.x + (0.4 - x.x) * beyond;
    let on_edge = |y: f64| DVec3::new(0.4, x.y + (y - x.y) / beyond, 1.0);
    let corners = [
        DVec3::new(-1.0, -0.5, 2.0),
        DVec3::new(cut, -0.5, 2.0),
        on_edge(-0.5),
        on_edge(0.5),
        DVec3::new(cut, 0.5, 2.0),
        DVec3::new(-1.0, 0.5, 2.0),
    ];
    solid_angle_gradient(x, &corners) / (4.0 * PI)
}

#[test]
fn gradients_know_of_a_shadow_that_moves() {
    let stage = half_hidden(vec![RECTANGLE]);
    let exact = half_hidden_gradient();
    let vacuum = Media::default();
    let [aware, blind] = [Derivatives::Aware, Derivatives::Blind].map(|derivatives| {
        let found = single(&stage, &vacuum, X, 1 << 14, derivatives, 0).gradient[0];
        found.as_dvec3().distance(exact) / exact.length()
    });
    println!("relative error of the gradient: aware {aware:.4}, blind {blind:.4}");
    // The silhouette is as wide as a cell of 512 directions, over 32 batches: 0.4 % of the gradient.
    assert!(aware < 0.02 && blind > 0.4, "{aware} {blind}");
    // The same from differences of the value with the same random numbers.
    let h = 0.02;
    let slope = DVec3::from_array(Vec3::AXES.map(|axis| {
        let [a, b] = [h, -h].map(|h| {
            single(
                &stage,
                &vacuum,
                X + h * axis,
                1 << 16,
                Derivatives::Blind,
                0,
            )
            .value
            .x
        });
        f64::from(a - b) / f64::from(2.0 * h)
    }));
    let error = slope.distance(exact) / exact.length();
    println!("relative error of differences {error:.4}");
    assert!(error < 0.02, "{slope} {exact}");
}

#[test]
fn gradients_know_of_shadows_in_fog_that_scatters_forward() {
    let stage = half_hidden(vec![RECTANGLE]);
    let media = medium(0.8, 0.7);
    let h = 0.02;
    let slope = DVec3::from_array(Vec3::AXES.map(|axis| {
        let [a, b] = [h, -h].map(|h| {
            single(&stage, &media, X + h * axis, 1 << 16, Derivatives::Blind, 0)
                .value
                .x
        });
        f64::from(a - b) / f64::from(2.0 * h)
    }));
    let [aware, blind] = [Derivatives::Aware, Derivatives::Blind].map(|derivatives| {
        let found = single(&stage, &media, X, 1 << 14, derivatives, 0).gradient[0];
        found.as_dvec3().distance(slope) / slope.length()
    });
    println!("relative distance from differences: aware {aware:.4}, blind {blind:.4}");
    assert!(aware < 0.03 && blind > 0.2, "{aware} {blind}");
}

/// One rectangle, cut into tiles that are lights of their own, which few samples draw rarely and many often.
#[test]
fn shadows_before_many_lights_move_as_before_one() {
    let [columns, rows] = [5, 2];
    let lamps = (0..columns * rows).map(|i| {
        let edges = [CARD.edges[0] / columns as f32, CARD.edges[1] / rows as f32];
        let [column, row] = [i % columns, i / columns];
        Lamp::Card {
            card: Card {
                corner: CARD.corner + column as f32 * edges[0] + row as f32 * edges[1],
                edges,
            },
            radiance: 1.0,
        }
    });
    let stage = half_hidden(lamps.collect());
    let exact = half_hidden_gradient();
    for samples in [32 * 8, 32 * 40 * columns * rows] {
        let mut spread = [Welford::new(); 3];
        for index in 0..64 {
            let media = Media::default();
            let found = single(&stage, &media, X, samples, Derivatives::Aware, index);
            for (spread, slope) in spread.iter_mut().zip(found.gradient[0].to_array()) {
                spread.push(slope.into());
            }
        }
        let mean = DVec3::from_array(spread.map(|s| s.mean()));
        let error = DVec3::from_array(spread.map(|s| s.standard_error()));
        println!("{samples} samples: {mean} ± {error}, exact {exact}");
        // False alarm 1e-6 a number; 3 % for the width of cells of 40 directions.
        let most = 5.0 * error + 0.03 * exact.length();
        assert!((mean - exact).abs().cmple(most).all(), "{samples}");
    }
}

#[test]
fn the_standard_errors_told_are_those_of_independent_runs() {
    let (stage, media) = (Stage::lamp(RECTANGLE), medium(0.8, 0.7));
    let runs = 400;
    let mut found = [Welford::new(); 13];
    let mut told = [Welford::new(); 13];
    for index in 0..runs {
        let run = single(&stage, &media, X, 1 << 10, Derivatives::Blind, index);
        let numbers = |value: Vec3, gradient: [Vec3; 3], hessian: Option<[DMat3; 3]>| {
            let value = [value.x.into()].into_iter();
            let gradient = gradient[0].as_dvec3().to_array();
            value
                .chain(gradient)
                .chain(hessian.unwrap()[0].to_cols_array())
        };
        for (found, x) in found
            .iter_mut()
            .zip(numbers(run.value, run.gradient, run.hessian))
        {
            found.push(x);
        }
        let errors = numbers(run.value_error, run.gradient_error, run.hessian_error);
        for (told, error) in told.iter_mut().zip(errors) {
            told.push(error * error);
        }
    }
    for (i, (found, told)) in found.iter().zip(&told).enumerate() {
        let ratio = (told.mean() / found.variance()).sqrt();
        println!("number {i}: told over found {ratio:.3}");
        // The standard deviation of 400 runs is good to 3.6 %, of told ones to a tenth of that: 5 of these, 13 false alarms in 1e7.
        assert!((ratio - 1.0).abs() < 0.18, "number {i}: {ratio}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    #[test]
    fn values_and_derivatives_are_finite(
        kind in 0..5, log_distance in -6.0f32..6.0, log_sigma in -7.0f32..6.0, g in -0.999f32..0.999,
        direction in prop::array::uniform3(-1.0f32..1.0), grazing in prop::bool::ANY, coincides in prop::bool::ANY,
        forward in prop::bool::ANY, covered in prop::bool::ANY, boxed in prop::bool::ANY, index in 0u64..1000
    ) {
        let distance = 10f32.powf(log_distance);
        let sigma_t = if log_sigma < -6.5 { 0.0 } else { 10f32.powf(log_sigma) };
        let w = Vec3::from(direction).try_normalize().unwrap_or(Vec3::Z);
        let p = if coincides { Vec3::ZERO } else { w * distance };
        let (u, v) = w.any_orthonormal_pair();
        // A card across the way, or along it: seen from its own plane or just beside.
        let edges = if grazing { [w * distance, u * distance] } else { [u * distance, v * distance] };
        let lamps = match kind {
            0 => vec![Lamp::Point { position: p, intensity: 1.0 }],
            1 => vec![Lamp::Card { card: Card { corner: p, edges }, radiance: 1.0 }],
            2 => vec![Lamp::Ball { center: w * distance, radius: 0.9 * distance, radiance: 1.0 }],
            3 => vec![Lamp::Sky { radiance: 1.0 }],
            _ => Vec::new(),
        };
        // Around the point, or with a corner there.
        let corner = if coincides { Vec3::ZERO } else { w * (0.4 * distance) };
        let region = Region::Box { min: corner - 0.5 * distance, max: corner };
        let region = if boxed { region } else { Region::Everywhere };
        let phase = PhaseFunction::henyey_greenstein(g).unwrap();
        let media = fog(sigma_t, 0.5, region, phase);
        let cards = vec![Card { corner: p * 0.5 + 0.1 * edges[0], edges }];
        let stage = Stage { lamps, cards: if covered { cards } else { Vec::new() } };
        let world = World { geometry: &stage, lights: &stage, media: &media };
        let towards = if forward { -w } else { v };
        for towards in [None, Some(towards)] {
            let asked = (Order::Hessian, Derivatives::Aware);
            let found = inscatter::single(&world, Vec3::ZERO, towards, 64, asked, key(index));
            prop_assert!(found.value.is_finite() && found.value_error.is_finite(), "{found:?}");
            prop_assert!(found.gradient.iter().chain(&found.gradient_error).all(|v| v.is_finite()), "{found:?}");
            let hessians = [found.hessian, found.hessian_error].map(Option::unwrap);
            prop_assert!(hessians.as_flattened().iter().all(|h| h.is_finite()), "{found:?}");
        }
    }
}
