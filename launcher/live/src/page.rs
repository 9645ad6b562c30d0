//! The page's HTML: one document with its style and scripts, which requests only the websocket and the commands.

use view::draw::{SCRIPTS, STYLE, UPLOT_STYLE};
use view::report::FIGURE_SCRIPT;

const TEMPLATE: &str = include_str!("../assets/live.html");
const LIVE_STYLE: &str = include_str!("../assets/live.css");
/// Script of the page with three.js, which `web/` builds from its lock file.
const SCRIPT: &str = include_str!("../assets/live.js");

/// Kind of flight that a page shows; its mark in the template encloses the parts for this kind alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PageSubject {
    Live,
    Recorded,
}

impl PageSubject {
    fn mark(self) -> &'static str {
        match self {
            Self::Live => "live",
            Self::Recorded => "recorded",
        }
    }
}

/// Makes the page. Its scripts run because they carry `nonce`, which the header of the answer names too.
pub fn page(shown: PageSubject, nonce: &str) -> String {
    let style = [UPLOT_STYLE, STYLE, LIVE_STYLE].concat();
    let scripts = SCRIPTS.into_iter().chain([FIGURE_SCRIPT, SCRIPT]);
    let scripts = scripts.map(|script| format!("<script nonce=\"{nonce}\">{script}</script>"));
    let scripts: String = scripts.collect::<Vec<_>>().join("\n");
    let other = if shown == PageSubject::Live { PageSubject::Recorded } else { PageSubject::Live };
    without(TEMPLATE, other).replacen("{{style}}", &style, 1).replacen("{{scripts}}", &scripts, 1)
}

/// Returns the template without the parts for `other` flights alone, for instance those between `{{live}}` and
/// `{{end live}}`, and without the marks of the parts that stay.
fn without(template: &str, other: PageSubject) -> String {
    let [begin, end] = ["", "end "].map(|which| format!("{{{{{which}{}}}}}", other.mark()));
    let mut parts = template.split(&begin);
    let first = parts.next().unwrap_or_default().to_owned();
    let rest = parts.map(|part| part.split_once(&end).map_or("", |(_, after)| after));
    let kept: String = [first.as_str()].into_iter().chain(rest).collect();
    [PageSubject::Live, PageSubject::Recorded].iter().fold(kept, |kept, shown| {
        let mark = shown.mark();
        kept.replace(&format!("{{{{{mark}}}}}"), "").replace(&format!("{{{{end {mark}}}}}"), "")
    })
}

/// Returns the content security policy of the page: no source but this server, no frame around the page.
pub fn policy(nonce: &str) -> String {
    format!(
        "default-src 'none'; script-src 'nonce-{nonce}'; style-src 'unsafe-inline'; img-src data:; connect-src 'self'; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_is_whole_and_no_script_ends_early() {
        for shown in [PageSubject::Live, PageSubject::Recorded] {
            let page = page(shown, "abc");
            let marks = ["{{style}}", "{{scripts}}", "{{live}}", "{{end live}}", "{{recorded}}", "{{end recorded}}"];
            assert!(marks.iter().all(|mark| !page.contains(mark)));
            assert_eq!(page.matches("<script nonce=\"abc\">").count(), SCRIPTS.len() + 2);
            assert_eq!(page.matches("</script>").count(), SCRIPTS.len() + 2);
            for source in ["src=\"http", "href=\"http", "@import", "url(http"] {
                assert!(!page.contains(source), "{source}");
            }
        }
        assert!(policy("abc").contains("script-src 'nonce-abc';"));
    }

    #[test]
    fn a_page_has_no_button_that_cannot_act() {
        let (live, recorded) = (page(PageSubject::Live, "abc"), page(PageSubject::Recorded, "abc"));
        for form in ["id=\"inject\"", "id=\"clear\"", "id=\"swap\"", "id=\"stop\""] {
            assert!(live.contains(form) && !recorded.contains(form), "{form}");
        }
        assert!(recorded.contains("id=\"player\"") && !live.contains("id=\"player\""));
        for section in ["id=\"ring\"", "id=\"events\"", "id=\"fig12\""] {
            assert!(live.contains(section) && recorded.contains(section), "{section}");
        }
    }
}
