//! The map of a grid from index coordinates to space.

use crate::volume_file::error::VolumeError;
use crate::volume_file::source::Source;
use glam::{DAffine3, DMat3, DVec3};
use std::io::{Read, Seek};

const WHAT: &str = "the map of a grid";

/// Reads any linear map.
pub(super) fn read<R: Read + Seek>(
    source: &mut Source<R>,
    grid: &str,
) -> Result<DAffine3, VolumeError> {
    let kind = source.string("the kind of a map")?;
    match kind.as_str() {
        "UniformScaleMap" | "ScaleMap" => {
            let scale = vector(source)?;
            // What follows from the scale: voxel size, inverse, square and half of the inverse.
            source.skip(4 * 24, WHAT)?;
            Ok(DAffine3::from_scale(scale))
        }
        "UniformScaleTranslateMap" | "ScaleTranslateMap" => {
            let translation = vector(source)?;
            let scale = vector(source)?;
            source.skip(4 * 24, WHAT)?;
            Ok(DAffine3 {
                matrix3: DMat3::from_diagonal(scale),
                translation,
            })
        }
        "TranslationMap" => Ok(DAffine3::from_translation(vector(source)?)),
        "AffineMap" | "UnitaryMap" => {
            // Four rows of four: vectors are rows, and stand before the matrix.
            let mut rows = [DVec3::ZERO; 4];
            for row in &mut rows {
                *row = vector(source)?;
                // 0, and 1 in the last row.
                source.skip(8, WHAT)?;
            }
            let [x, y, z, translation] = rows;
            Ok(DAffine3 {
                matrix3: DMat3::from_cols(x, y, z),
                translation,
            })
        }
        "NonlinearFrustumMap" => Err(VolumeError::Unsupported {
            what: format!("grid \"{grid}\" lies in the frustum of a camera (NonlinearFrustumMap)"),
            mend: "resample it to voxels of one size".into(),
        }),
        _ => Err(VolumeError::Unsupported {
            what: format!("grid \"{grid}\" is placed by a map of the kind \"{kind}\""),
            mend: "linear maps are read: scales, translations, rotations and affine maps".into(),
        }),
    }
}

fn vector<R: Read + Seek>(source: &mut Source<R>) -> Result<DVec3, VolumeError> {
    Ok(DVec3::new(
        source.f64(WHAT)?,
        source.f64(WHAT)?,
        source.f64(WHAT)?,
    ))
}
