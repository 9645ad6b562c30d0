//! Rules that settings break.

/// One broken rule.
pub struct Violation {
    /// Dotted keys that the rule is about, the most likely culprit first.
    pub keys: Vec<String>,
    /// Description of the error.
    pub what: String,
    /// Description of the allowed settings.
    pub allowed: String,
}

/// All broken rules found so far.
#[derive(Default)]
pub struct Found(pub Vec<Violation>);

impl Found {
    /// Adds a violation unless the rule `holds`.
    pub fn require(&mut self, holds: bool, keys: &[&str], what: String, allowed: &str) {
        if !holds {
            let keys = keys.iter().map(|key| (*key).to_string()).collect();
            self.0.push(Violation { keys, what, allowed: format!("allowed: {allowed}") });
        }
    }
}
