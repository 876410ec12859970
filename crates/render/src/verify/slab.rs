//! E3.3 and E3.4: slabs under a white sky.
//!
//! By reciprocity a pixel that looks at a slab at cosine μ, lit by radiance 1 from one half of the sky, shows the slab's
//! reflectance or transmittance for a beam at μ; over all view directions it shows those for diffuse light. Discrete ordinates
//! checked by an integral-equation solver; van de Hulst 1980, *Multiple Light Scattering*, for his value.

use super::measure::{Channel, Light, Point, ROUNDING, World, estimate, pixel, point_rows};
use super::world::{Lamp, Lamps, Solids, fog, phase};
use super::{Budget, Row, Task};
use glam::Vec3;
use std::f32::consts::TAU;
use tyndall_math::Ray;
use tyndall_math::stats::Welford;
use tyndall_media::{Media, Region};

const FAMILY: &str = "E3.4";
const SAMPLES: usize = 80_000;
const RAYS: usize = 512;

/// Mean cosine, albedo, optical thickness, reflectance and transmittance for diffuse light.
const WHITE: [(f32, f32, f32, [f64; 2]); 25] = [
    (-0.5, 0.9, 4.0, [0.5445885852255353, 0.054661645656094916]),
    (-0.5, 1.0, 0.5, [0.37926094107567915, 0.6207390589243206]),
    (-0.5, 1.0, 4.0, [0.8204971204369425, 0.17950287956305688]),
    (0.0, 0.9, 4.0, [0.4731858376081718, 0.0905643374695706]),
    (0.0, 1.0, 0.5, [0.29583089589681955, 0.7041691041031799]),
    (0.0, 1.0, 4.0, [0.7540293594717171, 0.245970640528283]),
    (0.5, 0.9, 4.0, [0.3482390078204024, 0.1773756340446552]),
    (0.5, 1.0, 0.5, [0.18757616864127644, 0.8124238313587209]),
    (0.5, 1.0, 4.0, [0.6105336222989132, 0.3894663777010867]),
    (0.75, 0.9, 4.0, [0.2316093557563116, 0.27617764026888614]),
    (0.75, 1.0, 0.5, [0.11519111195924077, 0.8848088880407562]),
    (0.75, 1.0, 4.0, [0.4500564480962528, 0.5499435519036783]),
    (0.9, 0.9, 4.0, [0.11754845234453204, 0.3849418825851213]),
    (0.9, 1.0, 0.5, [0.058365317688411904, 0.9416346823116031]),
    (0.9, 1.0, 4.0, [0.26576655601473215, 0.7342334439850875]),
    (0.0, 1.0, 16.0, [0.923463544826683, 0.07653645517331648]),
    (0.75, 1.0, 16.0, [0.7543024498018417, 0.24569755019815842]),
    (-0.5, 0.5, 1.0, [0.18683024514963564, 0.26748963164406714]),
    (-0.5, 0.99, 2.0, [0.6754089517488915, 0.2861657014519729]),
    (0.5, 0.5, 1.0, [0.07428480172429418, 0.3611877046083984]),
    (0.5, 0.99, 2.0, [0.43026343436850734, 0.5309325176333421]),
    (0.75, 0.5, 1.0, [0.03954935501521671, 0.3967651306918964]),
    (0.75, 0.99, 2.0, [0.28917692224291563, 0.6719907415491765]),
    (0.9, 0.5, 1.0, [0.01649394980262485, 0.42259877525403206]),
    (0.9, 0.99, 2.0, [0.15625141086430733, 0.8049666800581916]),
];

/// Mean cosine, albedo, optical thickness, cosine of the view, reflectance and transmittance there.
const PIXELS: [(f32, f32, f32, f32, [f64; 2]); 29] = [
    // Van de Hulst's slab.
    (
        0.75,
        0.9,
        2.0,
        1.0,
        [0.09739463868469737, 0.6609577001704448],
    ),
    (0.0, 0.9, 1.0, 0.2, [0.5194020595637687, 0.2675980095632915]),
    (0.0, 0.9, 1.0, 0.8, [0.3078331615961491, 0.5332715234416998]),
    (0.0, 0.9, 4.0, 0.2, [0.5889949693066265, 0.0489572919902282]),
    (
        0.0,
        0.9,
        4.0,
        0.8,
        [0.4419247759080978, 0.10271155978638442],
    ),
    (0.0, 1.0, 1.0, 0.2, [0.6459674939635843, 0.3540325060364156]),
    (0.0, 1.0, 1.0, 0.8, [0.3920844302692204, 0.6079155697307794]),
    (
        0.0,
        1.0,
        4.0,
        0.2,
        [0.8455005600358564, 0.15449943996414398],
    ),
    (0.0, 1.0, 4.0, 0.8, [0.728006928391935, 0.2719930716080651]),
    (
        0.75,
        0.9,
        1.0,
        0.2,
        [0.3573126956845269, 0.3768276779528723],
    ),
    (
        0.75,
        0.9,
        1.0,
        0.8,
        [0.08487852927293836, 0.7709149862233954],
    ),
    (
        0.75,
        0.9,
        4.0,
        0.2,
        [0.4190808386300205, 0.13001192992534882],
    ),
    (
        0.75,
        0.9,
        4.0,
        0.8,
        [0.18318127967261733, 0.3199501287079266],
    ),
    (
        0.75,
        1.0,
        1.0,
        0.2,
        [0.47893661951962824, 0.5210633804803939],
    ),
    (
        0.75,
        1.0,
        1.0,
        0.8,
        [0.11997122184931173, 0.8800287781506986],
    ),
    (
        0.75,
        1.0,
        4.0,
        0.2,
        [0.6714058291168263, 0.32859417088290616],
    ),
    (
        0.75,
        1.0,
        4.0,
        0.8,
        [0.3875968447760406, 0.6124031552239333],
    ),
    (
        0.9,
        0.9,
        1.0,
        0.2,
        [0.24260341277758757, 0.42560064659534663],
    ),
    (
        0.9,
        0.9,
        1.0,
        0.8,
        [0.029794294453128468, 0.8394965395661387],
    ),
    (
        0.9,
        0.9,
        4.0,
        0.2,
        [0.29143344981290703, 0.15438769842715322],
    ),
    (
        0.9,
        0.9,
        4.0,
        0.8,
        [0.07521399546384247, 0.4571543633108639],
    ),
    (0.9, 1.0, 1.0, 0.2, [0.3674621084099097, 0.6325378915903321]),
    (
        0.9,
        1.0,
        1.0,
        0.8,
        [0.04372724158423594, 0.9562727584157931],
    ),
    (
        0.9,
        1.0,
        4.0,
        0.2,
        [0.5563210337626779, 0.44367896623676045],
    ),
    (
        0.9,
        1.0,
        4.0,
        0.8,
        [0.18525968182428354, 0.8147403181756262],
    ),
    (
        -0.5,
        0.9,
        1.0,
        0.2,
        [0.5752755673948012, 0.2034549608492829],
    ),
    (
        -0.5,
        0.9,
        1.0,
        0.8,
        [0.40248141466798876, 0.4445702887624302],
    ),
    (
        0.5,
        0.9,
        1.0,
        0.2,
        [0.43833043731597127, 0.3325770108650638],
    ),
    (
        0.5,
        0.9,
        1.0,
        0.8,
        [0.17262890381527674, 0.6724494665936425],
    ),
];

/// Inside a slab of optical thickness 4 with the sky above: mean cosine, albedo, depth, fluence and its derivative with depth.
const INSIDE: [(f32, f32, f32, [f64; 2]); 4] = [
    (0.0, 0.9, 1.0, [4.996171233718889, -2.8666315643415925]),
    (0.0, 1.0, 1.0, [8.627528410737623, -2.36722670841035]),
    (0.75, 0.9, 1.0, [5.078352958448178, -1.8982433501462805]),
    (0.75, 1.0, 1.0, [7.719284751037956, -1.4926815199716597]),
];

pub(super) fn tasks() -> Vec<Task> {
    let white = WHITE
        .iter()
        .map(|&row| -> Task { Box::new(move |budget| white_rows(budget, row)) });
    let pixels = PIXELS
        .iter()
        .map(|&row| -> Task { Box::new(move |budget| pixel_rows(budget, row)) });
    let inside = INSIDE
        .iter()
        .map(|&row| -> Task { Box::new(move |budget| inside_rows(budget, row)) });
    white.chain(pixels).chain(inside).collect()
}

/// A slab below y = 0, so wide that its sides let in less than 1e-10.
fn slab(g: f32, albedo: f32, thickness: f32) -> Media {
    let half_width = (8.0 * (thickness + 1.42)).max(25.0);
    let region = Region::Box {
        min: Vec3::new(-half_width, -thickness, -half_width),
        max: Vec3::new(half_width, 0.0, half_width),
    };
    fog(1.0, albedo, region, phase(g))
}

/// White on one side.
fn half_sky(side: Vec3) -> Lamps {
    Lamps::one(Lamp::Sky {
        radiance: 1.0,
        side: Some(side),
    })
}

/// A ray from above that enters the slab at the origin at cosine `mu`.
fn view(mu: f32, azimuth: f32) -> Ray {
    let sine = (1.0 - mu * mu).sqrt();
    let direction = Vec3::new(sine * azimuth.cos(), -mu, sine * azimuth.sin()).normalize();
    Ray::new(-direction, direction)
}

/// What is seen with the sky on the eye's side, and on the other.
fn both_sides(media: &Media, budget: &Budget, ray: impl Fn([f32; 2]) -> Ray) -> [Welford; 2] {
    [Vec3::Y, Vec3::NEG_Y].map(|side| {
        let world = World {
            geometry: &Solids::default(),
            lights: &half_sky(side),
            media,
        };
        // Different numbers on the two sides: their sum is then as uncertain as it looks.
        let budget = Budget {
            task: budget.task | u64::from(side.y < 0.0) << 31,
            ..*budget
        };
        pixel(&world, &budget, SAMPLES, None, Channel::Mean, &ray)
    })
}

fn rows(name: &str, found: [Welford; 2], exact: [f64; 2]) -> Vec<Row> {
    ["reflectance", "transmittance"]
        .into_iter()
        .zip(found.iter().zip(exact))
        .map(|(what, (found, exact))| {
            Row::random(
                FAMILY,
                format!("{name}: {what}"),
                estimate(found),
                exact,
                ROUNDING * exact,
            )
        })
        .collect()
}

fn white_rows(
    budget: &Budget,
    (g, albedo, thickness, exact): (f32, f32, f32, [f64; 2]),
) -> Vec<Row> {
    let media = slab(g, albedo, thickness);
    // Lambert's cosine: the squared cosine is uniform.
    let found = both_sides(&media, budget, |[u, v]| view((1.0 - u).sqrt(), TAU * v));
    let name = format!("slab {thickness}, albedo {albedo} g {g}, white");
    let [r, t] = found;
    let mut rows = rows(&name, found, exact);
    if albedo == 1.0 {
        let stderr = r.standard_error().hypot(t.standard_error());
        let sum = (r.mean() + t.mean(), stderr);
        rows.push(Row::random(
            FAMILY,
            format!("{name}: R + T"),
            sum,
            1.0,
            ROUNDING,
        ));
    }
    rows
}

fn pixel_rows(
    budget: &Budget,
    (g, albedo, thickness, mu, exact): (f32, f32, f32, f32, [f64; 2]),
) -> Vec<Row> {
    let media = slab(g, albedo, thickness);
    let found = both_sides(&media, budget, |_| view(mu, 0.0));
    let name = format!("slab {thickness}, albedo {albedo} g {g}, μ {mu}");
    rows(&name, found, exact)
}

fn inside_rows(
    budget: &Budget,
    (g, albedo, depth, [fluence, slope]): (f32, f32, f32, [f64; 2]),
) -> Vec<Row> {
    let media = slab(g, albedo, 4.0);
    let world = World {
        geometry: &Solids::default(),
        lights: &half_sky(Vec3::Y),
        media: &media,
    };
    let per_sphere = 0.25 * std::f64::consts::FRAC_1_PI;
    let point = Point {
        x: Vec3::new(0.0, -depth, 0.0),
        towards: None,
        light: Light::All,
        value: fluence * per_sphere,
        gradient: [0.0, -slope * per_sphere, 0.0],
    };
    let name = format!("slab 4, albedo {albedo} g {g}: record at depth {depth}");
    point_rows(&world, budget, (FAMILY, &name), RAYS, &point)
}
