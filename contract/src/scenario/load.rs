//! load
#[derive(Debug)] pub struct ScenarioError;
pub fn load() {} pub fn from_merged() {} pub fn to_toml() {}
