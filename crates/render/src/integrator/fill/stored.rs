//! A filled cache as it is kept in a file: its records and tags; the index is built anew.

use super::{Filled, Light};
use serde::{Deserialize, Serialize, Serializer};
use std::borrow::Cow;
use tyndall_cache::{Cache, Record};

/// What is kept of a [`Filled`] cache.
#[derive(Deserialize, Serialize)]
#[serde(bound(deserialize = "T: Clone + Deserialize<'de>"))]
pub(super) struct Stored<'f, T: Clone> {
    records: Cow<'f, [Record<3>]>,
    tags: Cow<'f, [T]>,
    asked: usize,
}

impl<T: Clone + Serialize> Serialize for Filled<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let stored = Stored {
            records: Cow::Borrowed(self.cache.records()),
            tags: Cow::Borrowed(self.cache.tags()),
            asked: self.asked,
        };
        stored.serialize(serializer)
    }
}

impl<T: Clone> TryFrom<Stored<'_, T>> for Filled<T> {
    type Error = String;

    fn try_from(stored: Stored<'_, T>) -> Result<Self, String> {
        let (n_records, n_tags) = (stored.records.len(), stored.tags.len());
        if n_records != n_tags {
            return Err(format!("there are {n_records} records with {n_tags} tags"));
        }
        if stored.asked < n_records || stored.asked >= Light::MOST_RECORDS {
            let asked = stored.asked;
            return Err(format!(
                "{asked} places cannot have asked for {n_records} records"
            ));
        }
        let records = stored.records.iter().copied();
        let mut cache = Cache::tagged();
        cache
            .insert_tagged(records.zip(stored.tags.iter().cloned()).collect())
            .map_err(|error| error.to_string())?;
        Ok(Self {
            cache,
            rays: 0,
            asked: stored.asked,
            cut_short: false,
        })
    }
}
