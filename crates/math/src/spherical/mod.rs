//! Lamps as seen from a point: triangles and rectangles sampled evenly over the solid angle they fill.
//!
//! Sampling a lamp's area instead leaves cosθ/r² in the estimate, which has no bound for a point of fog close to the lamp.

mod rectangle;
mod triangle;

pub use rectangle::{RectangleSample, SphericalRectangle};
pub use triangle::{SphericalTriangle, TriangleSample};
