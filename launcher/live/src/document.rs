//! A page that is made anew while it is served: browsers learn of each version, and keep their place in it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use serde_json::json;

use crate::hub::{FrameKind, Hub};

/// Script that fetches each new version and shows it in place of the old one.
const SCRIPT: &str = include_str!("../assets/document.js");

/// Newest version of a page.
pub struct Document {
    html: Mutex<String>,
    /// `true` from a new version on until a browser has fetched it.
    is_new: AtomicBool,
    pub(crate) hub: Arc<Hub>,
}

impl Document {
    /// Makes a document whose first version is `html`, a whole page without scripts.
    pub fn new(html: String) -> Self {
        Self { html: Mutex::new(html), is_new: AtomicBool::new(false), hub: Arc::new(Hub::new()) }
    }

    /// Makes `html` the newest version.
    pub fn replace(&self, html: String) {
        let mut newest = self.html.lock().unwrap_or_else(PoisonError::into_inner);
        *newest = html;
        self.is_new.store(true, Ordering::Relaxed); // under the lock, as in `page`
        drop(newest);
        self.hub.send(FrameKind::Phase, json!({ "phase": "changed" }));
    }

    /// Tells the browsers that no version follows, and ends the server.
    pub fn close(&self) {
        self.hub.send(FrameKind::Phase, json!({ "phase": "ended" }));
        self.hub.close();
    }

    /// Returns whether a browser is there and none has fetched the newest version yet.
    pub(crate) fn is_unread(&self) -> bool {
        self.is_new.load(Ordering::Relaxed) && self.hub.has_viewers()
    }

    /// Returns the newest version with the script, which runs because it carries `nonce`.
    pub fn page(&self, nonce: &str) -> String {
        let html = self.html.lock().unwrap_or_else(PoisonError::into_inner);
        self.is_new.store(false, Ordering::Relaxed);
        html.replacen("</body>", &format!("<script nonce=\"{nonce}\">{SCRIPT}</script></body>"), 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_version_is_served_and_each_is_told() {
        let document = Document::new(String::new());
        let (_, mut frames) = document.hub.join();
        for version in ["one", "two"] {
            document.replace(format!("<body><main>{version}</main></body>"));
            assert!(frames.try_recv().unwrap().contains("changed"));
            assert!(document.is_unread());
        }
        let page = document.page("abc");
        assert!(page.contains("<main>two</main><script nonce=\"abc\">") && page.ends_with("</script></body>"));
        assert!(!document.is_unread());
        document.close();
        assert!(frames.try_recv().unwrap().contains("ended") && document.hub.is_closed());
    }
}
