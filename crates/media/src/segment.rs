//! A ray through the media: optical depth as a function of distance, and back.
//!
//! The media met are found once; what is asked of the ray afterwards costs a closed form for each of them, or a few cells of a grid.

use crate::Medium;
use crate::density::Profile;
use crate::line::Line;
use crate::newton;
use glam::Vec3;
use smallvec::SmallVec;

/// A ray from 0 to a largest distance, cut into its stretches inside each medium.
#[derive(Clone, Debug)]
pub struct Segment<'a> {
    pieces: SmallVec<[Piece<'a>; 4]>,
}

/// The stretch of a ray inside one medium.
#[derive(Clone, Debug)]
struct Piece<'a> {
    medium: &'a Medium,
    profile: Profile<'a>,
    // f64: a short stretch far along the ray is the small difference of its ends.
    t0: f64,
    t1: f64,
}

impl<'a> Piece<'a> {
    /// The stretch of `line` up to `t_max` inside `medium`, where there is one that matters to light; or up to a place behind that where its
    /// optical depth is `enough` in all channels.
    #[inline]
    fn new(medium: &'a Medium, line: &Line, t_max: f64, enough: f32) -> Option<Self> {
        if medium.is_vacuum() {
            return None;
        }
        let (t0, t1) = medium.clip(line, t_max)?;
        let mut profile = medium.density().along(line);
        let t1 = profile.prepare(t0, t1, medium.column_of_depth(enough));
        Some(Self {
            medium,
            profile,
            t0,
            t1,
        })
    }

    /// Optical depth from the start of the ray to distance `t`.
    #[inline]
    fn optical_depth(&self, t: f64) -> Vec3 {
        if t <= self.t0 {
            return Vec3::ZERO;
        }
        depth(
            self.medium.sigma_t(),
            self.profile.column(self.t0, t.min(self.t1)),
        )
    }

    #[inline]
    fn total(&self) -> Vec3 {
        depth(self.medium.sigma_t(), self.profile.column(self.t0, self.t1))
    }

    /// Whether the optical depth is `depth` in all channels, or more.
    fn reaches(&self, depth: f32) -> bool {
        self.total().min_element() >= depth
    }

    /// Whether the piece covers the stretch from `a` to `b`.
    fn spans(&self, a: f64, b: f64) -> bool {
        self.t0 <= a && b <= self.t1
    }

    fn sigma_t(&self, channel: usize) -> f64 {
        self.medium.sigma_t()[channel].into()
    }
}

/// Optical depth: extinction times a column that may be infinite; 0 where there is no extinction, never NaN.
#[inline]
pub(crate) fn depth(sigma_t: Vec3, column: f64) -> Vec3 {
    let column = column as f32;
    if column.is_finite() {
        sigma_t * column
    } else {
        Vec3::select(sigma_t.cmpgt(Vec3::ZERO), Vec3::INFINITY, Vec3::ZERO)
    }
}

/// exp(−τ) for each channel.
#[inline]
pub fn transmittance(tau: Vec3) -> Vec3 {
    each_channel(tau, |tau| (-tau).exp())
}

/// 1 − exp(−τ) for each channel, with its digits in thin media too.
#[inline]
pub fn absorptance(tau: Vec3) -> Vec3 {
    each_channel(tau, |tau| -(-tau).exp_m1())
}

/// `f` of each channel, computed once where the channels are alike, as in grey fog.
#[inline]
fn each_channel(tau: Vec3, f: impl Fn(f32) -> f32) -> Vec3 {
    if tau.x == tau.y && tau.y == tau.z {
        Vec3::splat(f(tau.x))
    } else {
        tau.map(f)
    }
}

/// How much more than the total may be asked of [`Segment::distance_at`]: rounding of sums of few f32.
const TOTAL_ROUNDING: f64 = 1e-6;

impl<'a> Segment<'a> {
    pub(crate) fn new(media: &'a [Medium], line: &Line, t_max: f32, enough: f32) -> Self {
        let t_max = f64::from(t_max);
        let mut end = t_max;
        // A loop: `collect` into a `SmallVec` costs some hundred instructions even for one medium.
        let mut pieces: SmallVec<[Piece<'a>; 4]> = SmallVec::new();
        for medium in media {
            if let Some(piece) = Piece::new(medium, line, end, enough) {
                if piece.t1 < end && enough < f32::INFINITY && piece.reaches(enough) {
                    end = piece.t1;
                }
                pieces.push(piece);
            }
        }
        if end < t_max {
            pieces.retain(|piece| {
                piece.t1 = piece.t1.min(end);
                piece.t0 < end
            });
        }
        Self { pieces }
    }

    /// Whether no medium is met.
    pub fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }

    /// Whether every medium met attenuates all channels alike.
    pub fn is_grey(&self) -> bool {
        self.pieces.iter().all(|piece| {
            let sigma_t = piece.medium.sigma_t();
            sigma_t == Vec3::splat(sigma_t.x)
        })
    }

    /// First and last distance with medium; (0, 0) where there is none. The last may be infinite.
    pub fn range(&self) -> (f32, f32) {
        if self.is_empty() {
            return (0.0, 0.0);
        }
        let first = self.pieces.iter().fold(f64::INFINITY, |t, p| t.min(p.t0));
        let last = self.pieces.iter().fold(0.0_f64, |t, p| t.max(p.t1));
        (first as f32, last as f32)
    }

    /// Optical depth from 0 to distance `t` (at most the segment's end), for each channel; may be infinite, never NaN.
    pub fn optical_depth(&self, t: f32) -> Vec3 {
        self.pieces.iter().map(|p| p.optical_depth(t.into())).sum()
    }

    /// Optical depth of the whole segment.
    pub fn total(&self) -> Vec3 {
        self.pieces.iter().map(Piece::total).sum()
    }

    /// Extinction at distance `t`, per metre.
    pub fn sigma_t(&self, t: f32) -> Vec3 {
        // Compared in f32, so that a distance from `distance_at` never falls out of its medium by rounding.
        self.pieces
            .iter()
            .filter(|p| p.t0 as f32 <= t && t <= p.t1 as f32)
            .map(|p| p.medium.sigma_t() * p.profile.value(t.into()) as f32)
            .sum()
    }

    /// The distance at which the optical depth of `channel` (0, 1, 2) reaches `tau`: the inverse of
    /// [`Segment::optical_depth`]. `None` where the whole segment holds less.
    ///
    /// Never inside a gap or before the first medium of that channel: depth 0 is reached where the medium begins.
    /// Closed form for one medium and for constant densities, Newton's method otherwise and in the cell of a grid.
    pub fn distance_at(&self, channel: usize, tau: f32) -> Option<f32> {
        let tau = f64::from(tau);
        let t = if let [piece] = self.pieces.as_slice() {
            let sigma_t = piece.sigma_t(channel);
            if sigma_t == 0.0 {
                return None;
            }
            let t = piece.profile.invert(piece.t0, tau / sigma_t);
            if t > piece.t1 {
                let total = sigma_t * piece.profile.column(piece.t0, piece.t1);
                if tau > total * (1.0 + TOTAL_ROUNDING) {
                    return None;
                }
            }
            t.min(piece.t1)
        } else {
            self.distance_in_mixture(channel, tau)?
        };
        // Only an unbounded medium whose whole column is just `tau` gets here with an infinite distance.
        (t <= f64::from(f32::MAX)).then_some(t as f32)
    }

    /// [`Segment::distance_at`] for media that overlap, follow each other or leave gaps.
    fn distance_in_mixture(&self, channel: usize, tau: f64) -> Option<f64> {
        let pieces: SmallVec<[&Piece<'a>; 4]> = self
            .pieces
            .iter()
            .filter(|p| p.sigma_t(channel) > 0.0)
            .collect();
        let mut breaks: SmallVec<[f64; 8]> = pieces.iter().flat_map(|p| [p.t0, p.t1]).collect();
        breaks.sort_by(f64::total_cmp);
        breaks.dedup();
        let mut rest = tau;
        let mut end = None;
        for (&a, &b) in breaks.iter().zip(breaks.iter().skip(1)) {
            let stretch = Stretch {
                pieces: pieces.iter().copied().filter(|p| p.spans(a, b)).collect(),
                channel,
                a,
                b,
            };
            let gain = stretch.depth(b);
            if gain > 0.0 {
                if rest <= gain {
                    return Some(stretch.invert(rest));
                }
                rest -= gain;
                end = Some(b);
            }
        }
        end.filter(|_| rest <= tau * TOTAL_ROUNDING)
    }
}

/// The part of a segment between two distances where no medium begins or ends.
struct Stretch<'s, 'a> {
    pieces: SmallVec<[&'s Piece<'a>; 4]>,
    channel: usize,
    a: f64,
    b: f64,
}

impl Stretch<'_, '_> {
    /// Optical depth from the start of the stretch to `t`.
    fn depth(&self, t: f64) -> f64 {
        self.pieces
            .iter()
            .map(|p| p.sigma_t(self.channel) * p.profile.column(self.a, t))
            .sum()
    }

    /// Extinction at `t`.
    fn slope(&self, t: f64) -> f64 {
        self.pieces
            .iter()
            .map(|p| p.sigma_t(self.channel) * p.profile.value(t))
            .sum()
    }

    /// The distance at which the depth is `tau`, in (0, depth of the stretch].
    fn invert(&self, tau: f64) -> f64 {
        let constant = |p: &&Piece<'_>| matches!(p.profile, Profile::Constant(_));
        let t = if let [piece] = self.pieces.as_slice() {
            piece
                .profile
                .invert(self.a, tau / piece.sigma_t(self.channel))
        } else if self.pieces.iter().all(constant) {
            self.a + tau / self.slope(self.a)
        } else {
            self.solve(tau)
        };
        t.min(self.b)
    }

    /// Newton's method, kept in a shrinking bracket; the depth grows with distance and its slope is the extinction.
    fn solve(&self, tau: f64) -> f64 {
        let mut low = self.a;
        // One medium alone takes at least as long as all together.
        let mut high = self
            .pieces
            .iter()
            .map(|p| p.profile.invert(self.a, tau / p.sigma_t(self.channel)))
            .fold(self.b, f64::min);
        if high == f64::INFINITY {
            let mut step = 1.0;
            while step < f64::from(f32::MAX) && self.depth(self.a + step) < tau {
                low = self.a + step;
                step *= 2.0;
            }
            high = self.a + step;
        }
        // Exact while the extinction stays as at the start; where it only falls or only grows, Newton comes from one side.
        let guess = self.a + tau / self.slope(self.a);
        let excess = |t| [self.depth(t) - tau, self.slope(t)];
        // Newton needs about six steps, and after one of 1e-9 its square is left; 200 halvings are enough for any bracket.
        newton::root(
            [low, high],
            newton::within(low, high, guess),
            200,
            |t| 1e-9 * t,
            excess,
        )
    }
}
