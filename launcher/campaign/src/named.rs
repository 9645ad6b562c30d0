//! Named tables of a campaign file, in the order of the file.

use std::collections::BTreeMap;

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use toml::de::{DeTable, DeValue};
use toml::{Spanned, Table};

/// Tables `[controller.NAME]` or `[case.NAME]`, in the order of the file.
#[derive(Debug, Clone, Default)]
pub struct Named(pub Vec<(String, Table)>);

impl Named {
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Sorts the tables of `key` by their place in `text`, because a TOML table has no order.
    pub fn put_in_order(&mut self, text: &str, key: &str) {
        let Ok(file) = DeTable::parse(text) else { return };
        let places: BTreeMap<&str, usize> = match file.get_ref().get(key).map(Spanned::get_ref) {
            Some(DeValue::Table(all)) => all.keys().map(|key| (key.get_ref().as_ref(), key.span().start)).collect(),
            _ => return,
        };
        self.0.sort_by_key(|(name, _)| places.get(name.as_str()).copied());
    }
}

impl Serialize for Named {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_map(self.0.iter().map(|(name, settings)| (name, settings)))
    }
}

impl<'de> Deserialize<'de> for Named {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        Ok(Self(BTreeMap::deserialize(from)?.into_iter().collect()))
    }
}
