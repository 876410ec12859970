//! A field as it is kept in a file: its cells and what surrounds them; all else follows from these.

use super::bands::Bands;
use super::cells::{CellWidths, Cells, NO_LINK, Side};
use super::{Field, Surroundings};
use serde::{Deserialize, Serialize, Serializer};
use std::borrow::Cow;

/// What is kept of a [`Field`].
#[derive(Serialize, Deserialize)]
pub(super) struct Stored<'f> {
    widths: Cow<'f, CellWidths>,
    sides: Cow<'f, [Side]>,
    surroundings: Cow<'f, [Surroundings]>,
    bands: Cow<'f, [Bands]>,
    has_bands: bool,
    unheld: f32,
}

/// Why numbers make no field.
const NO_FIELD: &str = "the cells of the light field do not fit together";

impl Serialize for Field {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let stored = Stored {
            widths: Cow::Borrowed(&self.widths),
            sides: Cow::Borrowed(&self.cells.sides),
            surroundings: Cow::Borrowed(&self.surroundings),
            bands: Cow::Borrowed(&self.cells.bands),
            has_bands: self.cells.has_bands(),
            unheld: self.unheld,
        };
        stored.serialize(serializer)
    }
}

impl TryFrom<Stored<'_>> for Field {
    type Error = &'static str;

    fn try_from(stored: Stored<'_>) -> Result<Self, &'static str> {
        let n = stored.sides.len();
        let is_cell = |link: &u32| *link == NO_LINK || (*link as usize) < n;
        let has_links = |s: &Surroundings| s.links.iter().all(is_cell);
        if stored.surroundings.len() != n || !stored.surroundings.iter().all(has_links) {
            return Err(NO_FIELD);
        }
        let (sides, bands) = (stored.sides.into_owned(), stored.bands.into_owned());
        let cells = Cells::from_sides(sides, bands, stored.has_bands).ok_or(NO_FIELD)?;
        if !stored.unheld.is_finite() {
            return Err(NO_FIELD);
        }
        Ok(Self {
            widths: stored.widths.into_owned(),
            light: cells.means(),
            surroundings: stored.surroundings.into_owned(),
            unheld: stored.unheld,
            cells,
        })
    }
}
