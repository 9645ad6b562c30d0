//! The rules that settings break.

/// One rule broken.
pub struct Violation {
    /// Dotted keys that take part, the most likely culprit first.
    pub keys: Vec<String>,
    /// What is wrong.
    pub what: String,
    /// What would be right.
    pub allowed: String,
}

/// All that were found.
#[derive(Default)]
pub struct Found(pub Vec<Violation>);

impl Found {
    /// Finds a rule broken unless it `holds`.
    pub fn require(&mut self, holds: bool, keys: &[&str], what: String, allowed: &str) {
        if !holds {
            let keys = keys.iter().map(|key| (*key).to_string()).collect();
            self.0.push(Violation { keys, what, allowed: format!("allowed: {allowed}") });
        }
    }
}
