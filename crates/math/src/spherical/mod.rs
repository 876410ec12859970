//! The world as seen from a point: lamps sampled evenly over the solid angle they fill, edges and how they move when the point
//! does, and the cells of a set of directions.
//!
//! Sampling a lamp's area instead leaves cosθ/r² in the estimate, which has no bound for a point of fog close to the lamp.

mod edge;
mod rectangle;
mod triangle;
mod voronoi;

pub use edge::{edge, edge_jacobian, solid_angle, solid_angle_gradient, solid_angle_hessian};
pub use rectangle::{RectangleSample, SphericalRectangle};
pub use triangle::{SphericalTriangle, TriangleSample};
pub use voronoi::{Border, SphericalVoronoi};
