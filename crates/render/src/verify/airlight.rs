//! E2a: airlight, single scattering of a lamp's light along a view ray.
//!
//! Isotropic closed form: Sun, Ramamoorthi, Narasimhan and Nayar 2005, "A Practical Analytic Single Scattering Model for Real
//! Time Rendering"; the other phase functions by quadrature to 20 digits. The lamp of 1 W/sr stands at the origin.

use super::measure::{Channel, ROUNDING, World, estimate, pixel};
use super::world::{Lamps, Shape, Solid, Solids, fog, phase};
use super::{Budget, Row, Task};
use glam::Vec3;
use tyndall_math::Ray;
use tyndall_media::{PhaseFunction, Region};

const FAMILY: &str = "E2a";
const SAMPLES: usize = 150_000;

/// Mean cosines of the Henyey–Greenstein functions in the table.
const G: [f32; 7] = [0.0, -0.5, 0.3, 0.5, 0.75, 0.9, 0.99];

/// A view ray that passes the lamp at distance `h` after `t0` and ends after `length` (metres).
struct Case {
    name: &'static str,
    sigma_s: f32,
    sigma_t: f32,
    t0: f32,
    h: f32,
    length: f32,
    exact: [f64; G.len()],
    rayleigh: f64,
}

const CASES: [Case; 8] = [
    Case {
        name: "base",
        sigma_s: 0.5,
        sigma_t: 1.0,
        t0: 2.0,
        h: 1.0,
        length: 6.0,
        exact: [
            0.004466541909321351,
            0.002171005847784087,
            0.005741855663690522,
            0.006069076004583669,
            0.004390861313401902,
            0.001848726179049489,
            0.00017518030558483815,
        ],
        rayleigh: 0.004440061913410513,
    },
    Case {
        name: "inf",
        sigma_s: 0.5,
        sigma_t: 1.0,
        t0: 2.0,
        h: 1.0,
        length: f32::INFINITY,
        exact: [
            0.004466580926602978,
            0.002171208651097891,
            0.005741872043827396,
            0.006069084822695599,
            0.004390864558329695,
            0.0018487272805392397,
            0.00017518040600116163,
        ],
        rayleigh: 0.0044401189851655375,
    },
    Case {
        name: "thin",
        sigma_s: 0.01,
        sigma_t: 0.01,
        t0: 5.0,
        h: 0.5,
        length: 20.0,
        exact: [
            0.004494942113285986,
            0.006171730774849474,
            0.004893043649782099,
            0.005815523184654665,
            0.008453257234011373,
            0.00959710432681371,
            0.0015401839952772114,
        ],
        rayleigh: 0.0049705297077293565,
    },
    Case {
        name: "thick",
        sigma_s: 4.0,
        sigma_t: 5.0,
        t0: 2.0,
        h: 0.5,
        length: 6.0,
        exact: [
            1.3412394791971602e-05,
            4.083303730403498e-06,
            2.403168335454173e-05,
            3.4326371669145963e-05,
            4.443992266562373e-05,
            2.7761732970323122e-05,
            2.913594730636278e-06,
        ],
        rayleigh: 1.567901281433641e-05,
    },
    Case {
        name: "graze",
        sigma_s: 0.5,
        sigma_t: 1.0,
        t0: 2.0,
        h: 0.001,
        length: 6.0,
        exact: [
            16.835262235377204,
            23.602578981517905,
            18.96585643244674,
            23.949725831720368,
            44.24359084660435,
            107.74900800993223,
            1023.5296263795419,
        ],
        rayleigh: 18.917119705420284,
    },
    Case {
        name: "graze6",
        sigma_s: 0.5,
        sigma_t: 1.0,
        t0: 2.0,
        h: 1e-6,
        length: 6.0,
        exact: [
            16916.75437080702,
            23988.34788136517,
            19010.61872352336,
            23989.12467254144,
            44331.09555160753,
            108267.78661135623,
            1076994.4093175628,
        ],
        rayleigh: 19031.29823171453,
    },
    Case {
        name: "lightbehind",
        sigma_s: 0.5,
        sigma_t: 1.0,
        t0: -1.0,
        h: 0.75,
        length: 6.0,
        exact: [
            0.0024305848798030624,
            0.007696717608304268,
            0.0010866767378208213,
            0.0005948031703542718,
            0.0002207580563498002,
            7.50617220389267e-05,
            6.844718181700185e-06,
        ],
        rayleigh: 0.003177440269959939,
    },
    Case {
        name: "albedo1",
        sigma_s: 1.0,
        sigma_t: 1.0,
        t0: 3.0,
        h: 2.0,
        length: f32::INFINITY,
        exact: [
            0.0007033791283389016,
            0.0002724808992274347,
            0.0009421564390904551,
            0.0009597241820884843,
            0.0006157863944432113,
            0.00024361682499740955,
            2.2795192687495985e-05,
        ],
        rayleigh: 0.000693416623762786,
    },
];

pub(super) fn tasks() -> Vec<Task> {
    let rows = CASES.iter().flat_map(|case| {
        let rayleigh = (
            PhaseFunction::Rayleigh,
            "Rayleigh".to_owned(),
            case.rayleigh,
        );
        G.iter()
            .zip(case.exact)
            .map(|(&g, exact)| (phase(g), format!("g {g}"), exact))
            .chain([rayleigh])
            .map(move |row| (case, row))
    });
    rows.map(|(case, (phase, name, exact))| -> Task {
        Box::new(move |budget| vec![row(budget, case, (phase, &name), exact)])
    })
    .collect()
}

fn row(budget: &Budget, case: &Case, (phase, name): (PhaseFunction, &str), exact: f64) -> Row {
    let ray = Ray::new(Vec3::new(-case.t0, case.h, 0.0), Vec3::X);
    // A black card ends the ray; it is too small to shade anything else.
    let card = case.length.is_finite().then(|| {
        Solid::black(Shape::Disk {
            center: ray.at(case.length),
            normal: Vec3::X,
            radius: 1e-4,
        })
    });
    let solids = Solids(card.into_iter().collect());
    let media = fog(
        case.sigma_t,
        case.sigma_s / case.sigma_t,
        Region::Everywhere,
        phase,
    );
    let world = World {
        geometry: &solids,
        lights: &Lamps::at_origin(1.0),
        media: &media,
    };
    let value = pixel(&world, budget, SAMPLES, Some(1), Channel::Mean, |_| ray);
    Row::random(
        FAMILY,
        format!("airlight {}, {name}", case.name),
        estimate(&value),
        exact,
        ROUNDING * exact,
    )
}
