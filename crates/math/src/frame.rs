//! Orthonormal frames around a direction.
//!
//! Sampling happens around the z axis; a frame turns the result towards a normal or a ray.

use glam::Vec3;

/// A right-handed orthonormal basis whose third axis is a given direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// First tangent, local x.
    pub tangent: Vec3,
    /// Second tangent, local y.
    pub bitangent: Vec3,
    /// The direction the frame was built around, local z.
    pub normal: Vec3,
}

impl Frame {
    /// The frame around the unit vector `normal`, without a branch on its direction.
    ///
    /// Duff, Burgess, Christensen, Hery, Kensler, Liani and Villemin 2017, "Building an Orthonormal Basis, Revisited", listing 3.
    pub fn from_normal(normal: Vec3) -> Self {
        let n = normal;
        let sign = 1.0_f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Self {
            tangent: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            bitangent: Vec3::new(b, sign + n.y * n.y * a, -n.y),
            normal,
        }
    }

    /// Local components to world.
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.tangent * v.x + self.bitangent * v.y + self.normal * v.z
    }

    /// World vector to local components.
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(
            v.dot(self.tangent),
            v.dot(self.bitangent),
            v.dot(self.normal),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn frames_are_orthonormal_and_right_handed(z in -1.0f32..=1.0, phi in 0.0f32..6.3) {
            let r = (1.0 - z * z).max(0.0).sqrt();
            let f = Frame::from_normal(Vec3::new(r * phi.cos(), r * phi.sin(), z).normalize());
            prop_assert!(f.tangent.dot(f.bitangent).abs() < 1e-5);
            prop_assert!(f.tangent.dot(f.normal).abs() < 1e-5);
            prop_assert!((f.tangent.length() - 1.0).abs() < 1e-5);
            prop_assert!((f.tangent.cross(f.bitangent) - f.normal).length() < 1e-5);
        }
    }
}
