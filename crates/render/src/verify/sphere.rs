//! E3.6: homogeneous spheres of extinction 1, under a uniform sky or with a lamp of power 1 in the centre.
//!
//! The integral equation of the sphere, isotropic scattering, solved to 1e-9 (Nyström's method on graded panels).

use super::measure::{Channel, Light, Point, ROUNDING, World, estimate, pixel, point_rows};
use super::world::{Lamps, Solids, ball, fog, phase};
use super::{Budget, Row, Task};
use glam::Vec3;
use std::f32::consts::PI;
use tyndall_math::Ray;

const FAMILY: &str = "E3.6";
const SAMPLES: usize = 90_000;
const RAYS: usize = 384;

/// Under a sky of radiance 1.
struct SkySphere {
    radius: f32,
    albedo: f32,
    /// At 0.1, 0.5 and 0.9 of the radius.
    fluence: [f64; 3],
    slope: [f64; 3],
    /// At impact 0.05, 0.5 and 0.9 of the radius.
    pixels: [f64; 3],
}

/// With a lamp in the centre.
struct LampSphere {
    radius: f32,
    albedo: f32,
    /// At 0.25, 0.5 and 0.9 of the radius.
    fluence: [f64; 3],
    slope: [f64; 3],
    /// At impact 0.25, 0.5 and 0.9 of the radius.
    pixels: [f64; 3],
}

const SKY: [SkySphere; 10] = [
    SkySphere {
        radius: 0.5,
        albedo: 0.5,
        fluence: [9.592021392167375, 9.867377686305709, 10.708331575029169],
        slope: [0.4344735970294522, 2.432110032924669, 7.190161573605746],
        pixels: [0.6205109660165053, 0.6566961185390341, 0.7992868195913945],
    },
    SkySphere {
        radius: 0.5,
        albedo: 0.9,
        fluence: [11.856531587122651, 11.928393023144839, 12.137257144879092],
        slope: [0.11478282310893206, 0.62698406209865, 1.7188228682664153],
        pixels: [0.9097984904080738, 0.9194561582316696, 0.9546859914772459],
    },
    SkySphere {
        radius: 0.5,
        albedo: 0.99,
        fluence: [12.492206781786193, 12.499871995181845, 12.521893267989444],
        slope: [
            0.012278902119327029,
            0.06668398529865271,
            0.17958652503976916,
        ],
        pixels: [0.9905848851595641, 0.9916199513477251, 0.9953291787289774],
    },
    SkySphere {
        radius: 1.0,
        albedo: 0.5,
        fluence: [7.06803050201494, 7.590094826108794, 9.232611606401973],
        slope: [0.4084967778694626, 2.3239796305834233, 7.167050917309352],
        pixels: [0.4108492940100086, 0.45106470077927485, 0.6388877207379013],
    },
    SkySphere {
        radius: 1.0,
        albedo: 0.9,
        fluence: [11.000236730101626, 11.178830132674058, 11.68445341225196],
        slope: [0.14349369865843897, 0.7742706628459466, 2.036256952820567],
        pixels: [0.835257937322777, 0.8501972146914811, 0.9085316170273177],
    },
    SkySphere {
        radius: 1.0,
        albedo: 0.99,
        fluence: [12.393797308066873, 12.414354932334366, 12.471070428370584],
        slope: [
            0.01662584707064596,
            0.08853855118105258,
            0.22385450643087562,
        ],
        pixels: [0.9819330548587204, 0.983680466078918, 0.9902293840990649],
    },
    SkySphere {
        radius: 3.0,
        albedo: 0.5,
        fluence: [1.6947337930085025, 2.4857715620062795, 5.8301582794672],
        slope: [0.18845979642727012, 1.2747545165221148, 5.754621009503409],
        pixels: [
            0.17702483506541675,
            0.19650825884079828,
            0.32146267452437766,
        ],
    },
    SkySphere {
        radius: 3.0,
        albedo: 0.9,
        fluence: [6.986681860744905, 7.744188564647793, 9.89967790984534],
        slope: [0.20137512149813885, 1.1011666144011052, 2.852465128851034],
        pixels: [0.6410149644666694, 0.6640427329426309, 0.7573206821773791],
    },
    SkySphere {
        radius: 3.0,
        albedo: 0.99,
        fluence: [11.749306731605646, 11.880331973508142, 12.212579410728873],
        slope: [
            0.035949372515974666,
            0.1845823344177712,
            0.40379192156509613,
        ],
        pixels: [0.9504472436325843, 0.9544635436208901, 0.9689903638747756],
    },
    SkySphere {
        radius: 8.0,
        albedo: 0.5,
        fluence: [0.02893223082316854, 0.1728261457126084, 2.782180341274233],
        slope: [0.007141651817502265, 0.13020782576688944, 2.879834060532662],
        pixels: [0.13253116404390936, 0.143859797432386, 0.20208791653066216],
    },
];

const LAMP: [LampSphere; 9] = [
    LampSphere {
        radius: 0.5,
        albedo: 0.5,
        fluence: [5.1102839857659905, 1.2367697947668541, 0.33601553369421255],
        slope: [-82.43293957591331, -10.371412687040353, -1.8308095659847439],
        pixels: [
            0.04097097972844562,
            0.016459640787405038,
            0.004317480525568364,
        ],
    },
    LampSphere {
        radius: 0.5,
        albedo: 0.9,
        fluence: [5.7312510616157795, 1.5110529084748439, 0.43839598042992467],
        slope: [-87.8300465658077, -11.820956995944586, -2.386000832716892],
        pixels: [
            0.08648576685103423,
            0.03715674838229818,
            0.010122762543886117,
        ],
    },
    LampSphere {
        radius: 0.5,
        albedo: 1.0,
        fluence: [5.910686947864239, 1.5952568637506435, 0.47105854819950543],
        slope: [-89.27217786589803, -12.236395891286564, -2.562373799774377],
        pixels: [
            0.10035649702805494,
            0.04389755812678352,
            0.012080750975513328,
        ],
    },
    LampSphere {
        radius: 1.0,
        albedo: 0.5,
        fluence: [1.2594040545664573, 0.2888347377717432, 0.06823876810229426],
        slope: [-10.35759908832801, -1.287115585939744, -0.21929167683786513],
        pixels: [
            0.012550812641819438,
            0.0050647025143879965,
            0.0014161142817715026,
        ],
    },
    LampSphere {
        radius: 1.0,
        albedo: 0.9,
        fluence: [1.59072701370487, 0.4329682596657629, 0.11705125195419674],
        slope: [
            -11.791936008218059,
            -1.6860060231940546,
            -0.3730764942665161,
        ],
        pixels: [
            0.03131745154903696,
            0.014427172180025224,
            0.004360926240394706,
        ],
    },
    LampSphere {
        radius: 1.0,
        albedo: 1.0,
        fluence: [1.702657700493014, 0.48776885885897087, 0.13708355958730095],
        slope: [
            -12.204363060545333,
            -1.8189461441761725,
            -0.4355663875648076,
        ],
        pixels: [
            0.038360008563726906,
            0.018352198708981332,
            0.005671447100860666,
        ],
    },
    LampSphere {
        radius: 3.0,
        albedo: 0.5,
        fluence: [
            0.11810650978039959,
            0.019443844462620007,
            0.0024524695541218626,
        ],
        slope: [
            -0.36951797207551,
            -0.03819846616897356,
            -0.004141136876233467,
        ],
        pixels: [
            0.0005938818605020368,
            0.0002388010703126718,
            7.382456408949177e-05,
        ],
    },
    LampSphere {
        radius: 3.0,
        albedo: 0.9,
        fluence: [
            0.23425184151934736,
            0.062474040337203274,
            0.012327890433055922,
        ],
        slope: [
            -0.5567529851313572,
            -0.08851083142204598,
            -0.01950296206686525,
        ],
        pixels: [
            0.003019557195856351,
            0.001714667367893139,
            0.0006676780073816981,
        ],
    },
    LampSphere {
        radius: 3.0,
        albedo: 1.0,
        fluence: [
            0.3071346577821729,
            0.10001940237331493,
            0.023286845590818336,
        ],
        slope: [
            -0.6314819422012046,
            -0.12004171120026391,
            -0.035890591270189856,
        ],
        pixels: [
            0.005225468905998269,
            0.003330833894504085,
            0.0014027625844659026,
        ],
    },
];

pub(super) fn tasks() -> Vec<Task> {
    let sky = SKY.iter().map(|s| Sphere {
        name: "sky",
        radius: s.radius,
        albedo: s.albedo,
        light: Light::All,
        lights: Lamps::sky(),
        pixels: [0.05, 0.5, 0.9].into_iter().zip(s.pixels).collect(),
        point: (0.5, s.fluence[1], s.slope[1]),
    });
    let lamp = LAMP.iter().map(|s| Sphere {
        name: "lamp",
        radius: s.radius,
        albedo: s.albedo,
        light: Light::Multiple,
        lights: Lamps::at_origin(0.25 / PI),
        pixels: [0.25, 0.5, 0.9].into_iter().zip(s.pixels).collect(),
        point: without_direct(s.radius, (0.5, s.fluence[1], s.slope[1])),
    });
    sky.chain(lamp)
        .map(|sphere| -> Task { Box::new(move |budget| sphere.rows(budget)) })
        .collect()
}

/// Takes the light straight from the lamp, exp(−r)/(4π r²), off fluence and slope at a share of the radius.
fn without_direct(radius: f32, (share, fluence, slope): (f32, f64, f64)) -> (f32, f64, f64) {
    let r = f64::from(share * radius);
    let direct = (-r).exp() / (4.0 * std::f64::consts::PI * r * r);
    (share, fluence - direct, slope + direct * (1.0 + 2.0 / r))
}

/// One sphere and all that is measured at it.
struct Sphere {
    name: &'static str,
    radius: f32,
    albedo: f32,
    light: Light,
    lights: Lamps,
    /// Impact over radius, and radiance.
    pixels: Vec<(f32, f64)>,
    /// Distance from the centre over the radius, fluence of `light`, its derivative.
    point: (f32, f64, f64),
}

impl Sphere {
    fn rows(&self, budget: &Budget) -> Vec<Row> {
        let media = fog(1.0, self.albedo, ball(self.radius), phase(0.0));
        let world = World {
            geometry: &Solids::default(),
            lights: &self.lights,
            media: &media,
        };
        let name = format!(
            "sphere R {}, albedo {}, {}",
            self.radius, self.albedo, self.name
        );
        let mut rows: Vec<Row> = self
            .pixels
            .iter()
            .map(|&(impact, exact)| {
                let ray = Ray::new(
                    Vec3::new(-2.0 * self.radius, impact * self.radius, 0.0),
                    Vec3::X,
                );
                let value = pixel(&world, budget, SAMPLES, None, Channel::Mean, |_| ray);
                let name = format!("{name}: pixel b {impact} R");
                Row::random(FAMILY, name, estimate(&value), exact, ROUNDING * exact)
            })
            .collect();
        let (share, fluence, slope) = self.point;
        let per_sphere = 0.25 * std::f64::consts::FRAC_1_PI;
        let n = Vec3::new(0.6, -0.48, 0.64);
        let point = Point {
            x: n * (share * self.radius),
            towards: None,
            light: self.light,
            value: fluence * per_sphere,
            gradient: (n.as_dvec3() * (slope * per_sphere)).to_array(),
        };
        let name = format!("{name}: record r {share} R");
        rows.extend(point_rows(&world, budget, (FAMILY, &name), RAYS, &point));
        rows
    }
}
