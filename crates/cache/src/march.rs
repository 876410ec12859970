//! The blend at many points of a segment at once: four neighbouring points side by side, all channels of a record in turn.
//! It holds for what is common; points where a rule for rare cases may apply are told apart, and looked up one by one.

use crate::blend::{MAX_EXTRAPOLATION, clamp, dot, weights};
use crate::exp::exp;
use crate::segment::Segment;
use crate::shape::{Channel, Shape, WIDTH};
use glam::{BVec4A, Vec3, Vec4};
use std::f32::consts::LN_2;
use std::ops::Range;

/// Packets of four points in a window.
const PACKETS: usize = 16;

/// Points in a window.
pub(crate) const STEPS: usize = PACKETS * WIDTH;

/// Records farther from a window's middle than this many radii have too few digits left in its sums: gradients are at most 1.4/R,
/// so that each term of a logarithm is below 23 and rounded to 10⁻⁶.
const MAX_DISTANCE: f32 = 32.0;

/// Below that no point of a ball is extrapolated too far.
const MAX_SLOPE: f32 = 2.0 * MAX_EXTRAPOLATION;

/// What a window knows of the field at a point.
#[derive(Debug)]
pub(crate) enum Answer<const N: usize> {
    /// No record is valid there.
    Nothing,
    Value([f32; N]),
    /// A rule for rare cases may apply: a lookup knows.
    Unknown,
}

/// Neighbouring points of a segment, with the sums of their blends.
#[derive(Debug)]
pub(crate) struct Window<const N: usize> {
    n_packets: usize,
    /// First and last t by packet; infinite after the last packet.
    first: [f32; PACKETS],
    last: [f32; PACKETS],
    /// Where sums measure from: a point in the middle.
    origin: Vec3,
    packets: [Packet<N>; PACKETS],
}

/// The running sums of a [`Blend`](crate::blend::Blend) at four points, in another order.
///
/// With positions P = p − o and Xₖ = xₖ − o from the window's origin o, gₖ·dₖ = gₖ·P − gₖ·Xₖ, of which the second part is the record's own:
///
/// ln L = Σ w (ln Lₖ + nₖ − ½ gₖ·Xₖ) + ½ ḡ·P + ½ ḡ·(P − Σ w Xₖ) − Σ w² nₖ,  ḡ = Σ w gₖ
///
/// That leaves twelve operations for each channel of a record.
#[derive(Clone, Copy, Debug)]
struct Packet<const N: usize> {
    /// By axis; NaN where there are fewer than four points.
    p: [Vec4; 3],
    /// Points that have to be looked up by themselves.
    alone: BVec4A,
    /// Σw
    weight: Vec4,
    /// Σ w X by axis
    position: [Vec4; 3],
    channels: [Sums; N],
}

#[derive(Clone, Copy, Debug)]
struct Sums {
    /// Σ w ln Lₖ
    ln_value: Vec4,
    /// Σ w (nₖ − ½ gₖ·Xₖ)
    extra: Vec4,
    /// Σ w g by axis
    gradient: [Vec4; 3],
    /// Σ w² nₖ
    noise: Vec4,
}

/// What a channel of a record adds.
#[derive(Clone, Copy, Debug)]
struct Terms {
    ln_value: Vec4,
    extra: Vec4,
    gradient: [Vec4; 3],
    lowered: Vec4,
}

impl Terms {
    const ZERO: Self = Self {
        ln_value: Vec4::ZERO,
        extra: Vec4::ZERO,
        gradient: [Vec4::ZERO; 3],
        lowered: Vec4::ZERO,
    };

    /// From a record of this radius that stands at `x`, seen from the window's origin.
    #[inline]
    fn new(channel: &Channel, x: Vec3, inv_radius: f32) -> Self {
        let gradient = channel.slope * inv_radius;
        Self {
            ln_value: Vec4::splat(channel.ln_value),
            extra: Vec4::splat(channel.lowered - 0.5 * gradient.dot(x)),
            gradient: gradient.to_array().map(Vec4::splat),
            lowered: Vec4::splat(channel.lowered),
        }
    }
}

impl<const N: usize> Window<N> {
    pub(crate) const EMPTY: Self = Self {
        n_packets: 0,
        first: [f32::INFINITY; PACKETS],
        last: [f32::INFINITY; PACKETS],
        origin: Vec3::ZERO,
        packets: [Packet::EMPTY; PACKETS],
    };

    /// Begins anew with up to [`STEPS`] ascending points.
    pub(crate) fn begin(&mut self, segment: &Segment, ts: &[f32]) {
        self.n_packets = ts.len().div_ceil(WIDTH);
        self.first = Self::EMPTY.first;
        self.last = Self::EMPTY.last;
        self.origin = segment.at(ts[ts.len() / 2]);
        for (i, ts) in ts.chunks(WIDTH).enumerate() {
            self.first[i] = ts[0];
            self.last[i] = ts[ts.len() - 1];
            let mut lanes = [f32::NAN; WIDTH];
            lanes[..ts.len()].copy_from_slice(ts);
            self.packets[i] = Packet {
                p: segment.at_four(lanes.into()),
                ..Packet::EMPTY
            };
        }
    }

    /// First and last t of all points.
    pub(crate) fn range(&self) -> [f32; 2] {
        [self.first[0], self.last[self.n_packets - 1]]
    }

    /// The packets with points between two t.
    #[inline]
    pub(crate) fn between(&self, enter: f32, exit: f32) -> Range<usize> {
        // Ascending t: those below a bound are a row of ones, counted without a branch.
        let mut before = 0;
        let mut begun = 0;
        let fours = self
            .first
            .chunks_exact(WIDTH)
            .zip(self.last.chunks_exact(WIDTH));
        for (i, (first, last)) in fours.enumerate() {
            let (first, last) = (Vec4::from_slice(first), Vec4::from_slice(last));
            before |= last.cmplt(Vec4::splat(enter)).bitmask() << (i * WIDTH);
            begun |= first.cmple(Vec4::splat(exit)).bitmask() << (i * WIDTH);
        }
        before.trailing_ones() as usize..begun.trailing_ones() as usize
    }

    /// Adds the record at `centre` to packets, where it is `valid` by (p − x)/R and p.
    #[inline]
    pub(crate) fn add(
        &mut self,
        packets: Range<usize>,
        centre: Vec3,
        shapes: &[Shape],
        valid: impl Fn(Vec3, Vec3) -> bool,
    ) {
        let Some(inv_radius) = shapes.first().map(|shape| 1.0 / shape.radius) else {
            return;
        };
        let x = centre - self.origin;
        let mut is_common = (x * inv_radius).length_squared() < MAX_DISTANCE * MAX_DISTANCE;
        let mut terms = [Terms::ZERO; N];
        for (c, terms) in terms.iter_mut().enumerate() {
            let channel = shapes[c / WIDTH].channel(c % WIDTH);
            is_common &= channel.ln_value > f32::NEG_INFINITY;
            is_common &= channel.slope.length_squared() < MAX_SLOPE * MAX_SLOPE;
            *terms = Terms::new(&channel, x, inv_radius);
        }
        let packets = self.packets.get_mut(packets).unwrap_or_default();
        // First all weights, then all sums: roots take their time, and no sum waits for its own.
        let mut weights = [Vec4::ZERO; PACKETS];
        for (w, packet) in weights.iter_mut().zip(&*packets) {
            *w = packet.weights(centre, inv_radius, &valid);
        }
        for (packet, w) in packets.iter_mut().zip(weights) {
            packet.weight += w;
            if is_common {
                packet.add(w, x, &terms);
            } else {
                packet.alone |= w.cmpgt(Vec4::ZERO);
            }
        }
    }

    /// Calls `visit` with what is known at each point, and at those that the last packet lacks.
    #[inline]
    pub(crate) fn for_each_answer(&self, mut visit: impl FnMut(Answer<N>)) {
        for packet in &self.packets[..self.n_packets] {
            let (values, is_known) = packet.values(self.origin);
            let is_covered = packet.weight.cmpgt(Vec4::ZERO).bitmask();
            let is_known = is_known.bitmask();
            for (lane, value) in values.into_iter().enumerate() {
                visit(match (is_covered >> lane & 1, is_known >> lane & 1) {
                    (0, _) => Answer::Nothing,
                    (_, 0) => Answer::Unknown,
                    _ => Answer::Value(value),
                });
            }
        }
    }
}

impl<const N: usize> Packet<N> {
    const EMPTY: Self = Self {
        p: [Vec4::NAN; 3],
        alone: BVec4A::FALSE,
        weight: Vec4::ZERO,
        position: [Vec4::ZERO; 3],
        channels: [Sums {
            ln_value: Vec4::ZERO,
            extra: Vec4::ZERO,
            gradient: [Vec4::ZERO; 3],
            noise: Vec4::ZERO,
        }; N],
    };

    /// Weights of a record; 0 where it is not valid.
    #[inline]
    fn weights(&self, centre: Vec3, inv_radius: f32, valid: impl Fn(Vec3, Vec3) -> bool) -> Vec4 {
        let offset = [0, 1, 2].map(|axis| (self.p[axis] - centre[axis]) * inv_radius);
        let squared = dot(offset, offset);
        let w = Vec4::select(squared.cmplt(Vec4::ONE), weights(squared), Vec4::ZERO);
        let (mut w, offset, p) = (
            w.to_array(),
            offset.map(|axis| axis.to_array()),
            self.p.map(|axis| axis.to_array()),
        );
        for lane in 0..WIDTH {
            let at = |v: &[[f32; WIDTH]; 3]| Vec3::from(v.map(|axis| axis[lane]));
            if w[lane] > 0.0 && !valid(at(&offset), at(&p)) {
                w[lane] = 0.0;
            }
        }
        w.into()
    }

    #[inline]
    fn add(&mut self, w: Vec4, x: Vec3, terms: &[Terms; N]) {
        for (sum, x) in self.position.iter_mut().zip(x.to_array()) {
            *sum += w * x;
        }
        let squared = w * w;
        for (sums, terms) in self.channels.iter_mut().zip(terms) {
            sums.ln_value += w * terms.ln_value;
            sums.extra += w * terms.extra;
            for axis in 0..3 {
                sums.gradient[axis] += w * terms.gradient[axis];
            }
            sums.noise += squared * terms.lowered;
        }
    }

    /// The blended values, and where they are known.
    #[inline]
    fn values(&self, origin: Vec3) -> ([[f32; N]; WIDTH], BVec4A) {
        let inverse = 1.0 / self.weight;
        let mut is_known = !self.alone;
        let mut logarithms = [Vec4::ZERO; N];
        let p = [0, 1, 2].map(|axis| self.p[axis] - origin[axis]);
        let offset = [0, 1, 2].map(|axis| p[axis] - self.position[axis] * inverse);
        for (ln, sums) in logarithms.iter_mut().zip(&self.channels) {
            let gradient = sums.gradient.map(|axis| 0.5 * inverse * axis);
            let carried = clamp(dot(gradient, offset));
            let extra =
                sums.extra * inverse + dot(gradient, p) + carried - sums.noise * inverse * inverse;
            // Less than that is within all bounds of a blend.
            is_known &= extra.abs().cmplt(Vec4::splat(0.999 * LN_2));
            *ln = Vec4::select(is_known, sums.ln_value * inverse + extra, Vec4::ZERO);
        }
        let mut values = [[0.0; N]; WIDTH];
        for (c, ln) in logarithms.iter().enumerate() {
            let channel = exp(*ln).min(Vec4::splat(f32::MAX)).to_array();
            for (value, channel) in values.iter_mut().zip(channel) {
                value[c] = channel;
            }
        }
        (values, is_known)
    }
}
