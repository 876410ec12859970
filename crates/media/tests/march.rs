//! Marched optical depth against exact values, closed forms and differences.

#![allow(clippy::unwrap_used, reason = "tests")]

mod trilinear_benchmark;

use glam::{DMat3, DVec3, Vec3};
use proptest::prelude::*;
use trilinear_benchmark::{ROWS, SPACING, sample};
use tyndall_math::Jet;
use tyndall_media::march::even_steps;
use tyndall_media::{
    Density, ExtinctionField, Media, Medium, MediumParams, MovingSegment, SmoothExtinctionField,
};

/// The two ends of the benchmark's segment; the second is the one that moves. Here z is up.
const A: DVec3 = DVec3::new(0.25, -0.5, 0.125);
const B: DVec3 = DVec3::new(1.75, 0.75, 1.5);

/// A field given by value, gradient and Hessian.
struct Field<F>(F);

impl<F: Fn(DVec3) -> Jet> ExtinctionField for Field<F> {
    fn value(&self, p: DVec3) -> f64 {
        (self.0)(p).value
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        (self.0)(p).gradient
    }
}

impl<F: Fn(DVec3) -> Jet> SmoothExtinctionField for Field<F> {
    fn hessian(&self, p: DVec3) -> DMat3 {
        (self.0)(p).hessian
    }
}

fn constant(sigma: f64) -> Field<impl Fn(DVec3) -> Jet> {
    Field(move |_| sigma.into())
}

const SLOPE: DVec3 = DVec3::new(0.1, 0.25, -0.05);

fn linear() -> Field<impl Fn(DVec3) -> Jet> {
    Field(|p| Jet::linear(0.4 + SLOPE.dot(p), SLOPE))
}

/// sigma e^(−k · p).
fn exponential(sigma: f64, k: DVec3) -> Field<impl Fn(DVec3) -> Jet> {
    Field(move |p| (-Jet::point(p).dot_fixed(k)).exp() * sigma)
}

/// sigma exp(−|p − c|²/(2 w²)).
fn gaussian(sigma: f64, c: DVec3, w: f64) -> Field<impl Fn(DVec3) -> Jet> {
    Field(move |p| {
        let v = Jet::point(p) - c;
        (v.dot(v) * (-0.5 / (w * w))).exp() * sigma
    })
}

fn blob() -> Field<impl Fn(DVec3) -> Jet> {
    gaussian(2.5, DVec3::new(0.9, 0.3, 0.6), 0.45)
}

/// Cells of the benchmark's trilinear grid.
const CELLS: DVec3 = DVec3::new(4.0, 3.0, 2.0);

fn trilinear() -> Field<impl Fn(DVec3) -> Jet> {
    Field(|p: DVec3| {
        let cell = (p / SPACING).floor().clamp(DVec3::ZERO, CELLS - 1.0);
        let in_cell = Jet::point(p) - cell * SPACING;
        let fractions = [
            in_cell.x / SPACING.x,
            in_cell.y / SPACING.y,
            in_cell.z / SPACING.z,
        ];
        let mut sum = Jet::ZERO;
        for corner in 0..8 {
            let mut weight = Jet::from(1.0);
            for (axis, fraction) in fractions.into_iter().enumerate() {
                let high = corner >> axis & 1 == 1;
                weight = weight * if high { fraction } else { -fraction + 1.0 };
            }
            let [i, j, k] = [0, 1, 2].map(|axis| cell[axis] as i32 + (corner >> axis & 1));
            sum += weight * sample(i, j, k);
        }
        sum
    })
}

/// Where the way from `a` to `b` crosses the faces of the grid's cells, as fractions of it.
fn faces(a: DVec3, b: DVec3) -> Vec<f64> {
    let mut breaks = Vec::new();
    for axis in 0..3 {
        for face in 1..CELLS[axis] as i32 {
            let s = (f64::from(face) * SPACING[axis] - a[axis]) / (b[axis] - a[axis]);
            if 0.0 < s && s < 1.0 {
                breaks.push(s);
            }
        }
    }
    breaks.sort_by(f64::total_cmp);
    breaks
}

fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

fn norm(m: DMat3) -> f64 {
    m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Compares τ and ∇τ with the benchmark's, which have 18 digits; both ways of marching give the same.
fn check(
    field: &impl SmoothExtinctionField,
    ends: [DVec3; 2],
    breaks: &[f64],
    tau: f64,
    gradient: [f64; 3],
) {
    let segment = MovingSegment::to(ends[0], ends[1]);
    let (found, found_gradient) = segment.optical_depth_gradient(field, breaks.iter().copied());
    let gradient = DVec3::from(gradient);
    assert!(
        (found / tau - 1.0).abs() < 1e-13,
        "{found} instead of {tau}"
    );
    assert!(
        (found_gradient - gradient).length() < 1e-13 * gradient.length(),
        "{found_gradient} instead of {gradient}"
    );
    let jet = segment.optical_depth_jet(field, breaks.iter().copied());
    assert_eq!((jet.value, jet.gradient), (found, found_gradient));
}

#[test]
fn polynomial_fields_have_the_exact_depth_and_gradient_in_one_step() {
    check(
        &constant(0.7),
        [A, B],
        &[],
        1.671685152772495,
        [0.43967609497577953, 0.36639674581314957, 0.4030364203944646],
    );
    check(
        &linear(),
        [A, B],
        &[],
        1.1716721829700076,
        [0.4275719167658808, 0.5553200678730549, 0.22278230705245972],
    );
}

#[test]
fn smooth_fields_have_the_exact_depth_and_gradient_in_small_steps() {
    let breaks: Vec<f64> = even_steps(2000).collect();
    check(
        &exponential(0.9, 1.3 * DVec3::Z),
        [A, B],
        &breaks,
        0.8509967169603773,
        [
            0.22382379404985264,
            0.18651982837487718,
            -0.19134142939663748,
        ],
    );
    check(
        &exponential(0.9, 1.3 * DVec3::Z),
        [A, B.with_z(A.z)],
        &breaks,
        1.4937385259696303,
        [0.5877004036601825, 0.48975033638348536, -0.9709300418802598],
    );
    check(
        &blob(),
        [A, B],
        &breaks,
        2.309765671223462,
        [
            -0.19627814791833031,
            1.2018106967775206,
            -0.8185651643214976,
        ],
    );
}

#[test]
fn trilinear_cells_are_exact_with_one_step_each() {
    for (a, b, tau, gradient) in ROWS {
        check(&trilinear(), [a, b], &faces(a, b), tau, gradient);
    }
}

#[test]
fn a_linear_field_has_its_exact_hessian_in_one_step() {
    let tau = MovingSegment::to(A, B).optical_depth_jet(&linear(), []);
    let r = A.distance(B);
    let n = (B - A) / r;
    // τ = r (σ(a) + σ(b))/2.
    let mean = 0.5 * (linear().value(A) + linear().value(B));
    let exact =
        (DMat3::IDENTITY - outer(n, n)) * (mean / r) + 0.5 * (outer(n, SLOPE) + outer(SLOPE, n));
    assert!(norm(tau.hessian - exact) < 1e-14);
}

#[test]
fn marching_a_height_fog_tends_to_its_closed_form() {
    let (base, scale_height, sigma_t) = (-1.0_f32, 0.8_f32, 0.6_f32);
    let fog = Medium::new(MediumParams {
        density: Density::Height { base, scale_height },
        ..MediumParams::new(Vec3::splat(sigma_t), Vec3::ONE)
    });
    let media = Media::new(vec![fog.unwrap()]);
    let k = 1.0 / f64::from(scale_height);
    let field = exponential(
        f64::from(sigma_t) * (k * f64::from(base)).exp(),
        k * DVec3::Y,
    );
    let direction = DVec3::new(0.48, 0.6, -0.64);
    for (exact, segment) in [
        (media.optical_depth_jet(A, B)[0], MovingSegment::to(A, B)),
        (
            media.optical_depth_jet_rigid(A, direction, 3.0)[0],
            MovingSegment::rigid(A, direction, 3.0),
        ),
    ] {
        let tau = segment.optical_depth_jet(&field, even_steps(1000));
        assert!((tau.value - exact.value).abs() < 1e-13 * exact.value);
        assert!((tau.gradient - exact.gradient).length() < 1e-12 * exact.gradient.length());
        assert!(norm(tau.hessian - exact.hessian) < 1e-12 * norm(exact.hessian));
    }
}

#[test]
fn errors_fall_with_the_fourth_power_of_the_step() {
    let steep = exponential(0.9, DVec3::new(0.7, -1.1, 1.3));
    let field = Field(|p| (blob().0)(p) + (steep.0)(p));
    let direction = (B - A).normalize();
    for segment in [
        MovingSegment::to(A, B),
        MovingSegment::rigid(A, direction, 2.0),
        MovingSegment::onto_plane(A, direction, 2.0, DVec3::new(0.6, 0.8, 0.0)),
    ] {
        let march = |n| segment.optical_depth_jet(&field, even_steps(n));
        let exact = march(1000);
        let error = |n| {
            let tau = march(n);
            [
                (tau.value - exact.value).abs(),
                (tau.gradient - exact.gradient).length(),
                norm(tau.hessian - exact.hessian),
            ]
        };
        for (coarse, fine) in error(24).into_iter().zip(error(48)) {
            // 16 in the limit of small steps.
            let ratio = coarse / fine;
            assert!((14.0..18.0).contains(&ratio), "{ratio}");
        }
    }
}

#[test]
fn moving_along_the_line_adds_the_extinction_at_the_end_at_the_order_of_the_rule() {
    let n = (B - A).normalize();
    for field in [
        gaussian(2.5, DVec3::new(0.9, 0.3, 0.6), 0.45),
        gaussian(1.0, DVec3::new(1.9, 0.9, 1.2), 0.7),
    ] {
        let error = |steps| {
            let (_, gradient) =
                MovingSegment::to(A, B).optical_depth_gradient(&field, even_steps(steps));
            (n.dot(gradient) - field.value(B)).abs()
        };
        let ratio = error(24) / error(48);
        assert!((14.0..18.0).contains(&ratio), "{ratio}");
        assert!(error(1000) < 1e-11);
    }
}

#[test]
fn a_far_end_on_a_plane_adds_the_extinction_there() {
    let (direction, normal) = (DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.0, 0.6, -0.8));
    let field = blob();
    let plane = MovingSegment::onto_plane(A, direction, 1.5, normal);
    let rigid = MovingSegment::rigid(A, direction, 1.5);
    let (tau, gradient) = plane.optical_depth_gradient(&field, even_steps(1000));
    let (tau_rigid, gradient_rigid) = rigid.optical_depth_gradient(&field, even_steps(1000));
    assert_eq!(tau, tau_rigid);
    // ∇τ = ∫ ∇σt dt + σt(end) ∇s with ∇s = −N/(N · d).
    let exact =
        gradient_rigid - normal * (field.value(A + 1.5 * direction) / normal.dot(direction));
    assert!((gradient - exact).length() < 1e-11);
    // A grazing plane slides its end away at a thousand metres per metre, not more.
    let grazing = MovingSegment::onto_plane(A, direction, 1.5, DVec3::Y);
    let (_, gradient) = grazing.optical_depth_gradient(&constant(2.0), []);
    assert!((gradient + 2e3 * DVec3::Y).length() < 1e-9);
}

/// Gradient and Hessian of what is marched in a few steps are differences of its value and gradient.
fn check_differences(f: impl Fn(DVec3) -> Jet) -> Result<(), TestCaseError> {
    let h = 1e-5;
    let jet = f(DVec3::ZERO);
    for (i, axis) in DVec3::AXES.into_iter().enumerate() {
        let (after, before) = (f(h * axis), f(-h * axis));
        let slope = (after.value - before.value) / (2.0 * h);
        let column = (after.gradient - before.gradient) / (2.0 * h);
        // h² times third and fourth derivatives; rounding over h.
        let tolerance = 1e-7 * (1.0 + jet.gradient.length() + norm(jet.hessian));
        prop_assert!(
            (jet.gradient[i] - slope).abs() < tolerance,
            "{jet:?} {slope}"
        );
        let found = jet.hessian.col(i);
        prop_assert!((found - column).length() < tolerance, "{found} {column}");
    }
    let asymmetry = norm(jet.hessian - jet.hessian.transpose());
    prop_assert!(asymmetry <= 1e-15 * norm(jet.hessian));
    Ok(())
}

fn any_point(size: f64) -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(0.0..size).prop_map(DVec3::from)
}

fn any_direction() -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-1.0f64..1.0)
        .prop_map(DVec3::from)
        .prop_filter_map("too short for a direction", |v| {
            (v.length() > 0.1).then(|| v.normalize())
        })
}

proptest! {
    #[test]
    fn derivatives_are_those_of_the_marched_sum(
        a in any_point(2.0), b in any_point(2.0), direction in any_direction(), normal in any_direction(), n in 0usize..6
    ) {
        prop_assume!(a.distance(b) > 0.2 && normal.dot(direction).abs() > 0.2);
        let field = blob();
        check_differences(|h| MovingSegment::to(a, b + h).optical_depth_jet(&field, even_steps(n)))?;
        let length = 1.5;
        check_differences(|h| {
            MovingSegment::rigid(a + h, direction, length).optical_depth_jet(&field, even_steps(n))
        })?;
        check_differences(|h| {
            let length = length - normal.dot(h) / normal.dot(direction);
            MovingSegment::onto_plane(a + h, direction, length, normal).optical_depth_jet(&field, even_steps(n))
        })?;
    }

    #[test]
    fn inside_a_trilinear_cell_the_hessian_is_exact_too(a in any_point(1.0), b in any_point(1.0)) {
        // Not up to the faces, which the differences must not cross.
        let [a, b] = [a, b].map(|p| (0.01 + 0.98 * p + DVec3::ONE) * SPACING);
        prop_assume!(a.distance(b) > 0.05);
        let tau = |b, n| MovingSegment::to(a, b).optical_depth_jet(&trilinear(), even_steps(n));
        let (one, many) = (tau(b, 1), tau(b, 7));
        prop_assert!(norm(one.hessian - many.hessian) < 1e-12 * (1.0 + norm(one.hessian)));
        check_differences(|h| tau(b + h, 1))?;
    }

    #[test]
    fn moving_along_the_line_adds_the_extinction_of_the_cell_at_the_end(a in any_point(1.0), b in any_point(1.0)) {
        let [a, b] = [a, b].map(|p| p * CELLS * SPACING);
        prop_assume!(a.distance(b) > 1e-3);
        let field = trilinear();
        let segment = MovingSegment::to(a, b);
        let (_, gradient) = segment.optical_depth_gradient(&field, faces(a, b));
        let n = (b - a).normalize();
        // The largest sample is 17/8.
        prop_assert!((n.dot(gradient) - field.value(b)).abs() < 1e-12 * 17.0 / 8.0);
    }

    #[test]
    fn derivatives_are_finite_at_any_scale(
        a in any_point(2.0), direction in any_direction(), log_length in -6.0f64..6.0, log_sigma in -6.0f64..6.0,
        zero in prop::bool::ANY, log_tilt in -320.0f64..0.0, steps in 0usize..5
    ) {
        let sigma = if zero { 0.0 } else { 10f64.powf(log_sigma) };
        let length = 10f64.powf(log_length);
        let across = direction.any_orthonormal_vector();
        let normal = (across + direction * 10f64.powf(log_tilt)).normalize();
        let fields = [gaussian(sigma, DVec3::ONE, 0.3), gaussian(sigma, DVec3::ZERO, 1e6)];
        for field in &fields {
            for segment in [
                MovingSegment::to(a, a + direction * length),
                MovingSegment::to(a, a),
                MovingSegment::rigid(a, direction, length),
                MovingSegment::rigid(a, direction, 0.0),
                MovingSegment::onto_plane(a, direction, length, normal),
                MovingSegment::onto_plane(a, direction, 0.0, across),
            ] {
                let tau = segment.optical_depth_jet(field, even_steps(steps));
                prop_assert!(tau.is_finite() && tau.value >= 0.0, "{tau:?}");
                prop_assert!((-tau).exp().is_finite(), "{tau:?}");
            }
        }
    }
}

#[test]
fn breaks_that_are_not_on_the_segment_are_passed_over() {
    let march =
        |breaks: &[f64]| MovingSegment::to(A, B).optical_depth_jet(&blob(), breaks.iter().copied());
    let strange = [
        f64::NEG_INFINITY,
        -1.0,
        0.25,
        f64::NAN,
        0.5,
        1.0,
        7.0,
        f64::INFINITY,
    ];
    assert_eq!(march(&strange), march(&[0.25, 0.5]));
}

#[test]
fn coinciding_points_have_no_depth_and_no_derivatives() {
    let segment = MovingSegment::to(A, A);
    assert_eq!(segment.optical_depth_jet(&blob(), []), Jet::ZERO);
    assert_eq!(
        segment.optical_depth_gradient(&blob(), []),
        (0.0, DVec3::ZERO)
    );
}
