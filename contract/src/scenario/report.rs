//! Scenario errors: what is wrong, where it was written, what to do.
//!
//! ```text
//! error: unknown key `plant.rotor_lag`
//!  --> gusty.toml:4:1
//!   |
//! 4 | rotor_lag = 0.05
//!   | ^^^^^^^^^
//!   = help: did you mean `rotor_lag_s`? ...
//! ```

use std::ops::Range;

use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};

/// Problems that one message lists.
pub const MAX_PROBLEMS: usize = 8;

/// Why a scenario cannot be flown: what is wrong with it, as a complete message for people.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct ScenarioError(String);

impl ScenarioError {
    /// One message of the first `problems`.
    pub(super) fn new(problems: &[Problem]) -> Self {
        let more = problems.len().saturating_sub(MAX_PROBLEMS);
        let mut told: Vec<String> = problems.iter().take(MAX_PROBLEMS).map(Problem::render).collect();
        told.extend((more > 0).then(|| format!("there is more: these are the first {MAX_PROBLEMS} problems")));
        Self(told.join("\n\n"))
    }

    /// The message in one line, to stand within another.
    pub fn in_one_line(&self) -> String {
        let lines = self.0.lines().map(|line| line.trim_start_matches([' ', '|', '=']).trim_start_matches("error: "));
        lines.filter(|line| !line.is_empty()).collect::<Vec<_>>().join("; ")
    }

    /// The message of one reason that was written in no file: what is wrong with which key, and what to do.
    pub fn of(title: String, help: String) -> Self {
        Self::new(&[Problem { title, place: None, help }])
    }
}

/// A text that settings come from: a file, or the argument of one `--set`.
pub struct Source {
    /// What the text is called; none for `--set`, which is shown in full.
    pub path: Option<String>,
    /// TOML.
    pub text: String,
}

/// One thing wrong.
pub struct Problem<'a> {
    /// What.
    pub title: String,
    /// Where: a source, and bytes of its text.
    pub place: Option<(&'a Source, Range<usize>)>,
    /// What to do.
    pub help: String,
}

impl Problem<'_> {
    fn render(&self) -> String {
        let snippet = self.place.as_ref().map(|(source, span)| {
            let option = if source.path.is_some() { "" } else { "--set " };
            let span = span.start + option.len()..span.end + option.len();
            Snippet::source(format!("{option}{}", source.text))
                .path(source.path.as_deref())
                .annotation(AnnotationKind::Primary.span(span))
        });
        let title = Level::ERROR.primary_title(&self.title);
        let help = Some(Level::HELP.message(&self.help)).filter(|_| !self.help.is_empty());
        Renderer::plain().render(&[title.elements(snippet).elements(help)])
    }
}
