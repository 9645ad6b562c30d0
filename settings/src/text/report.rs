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
use std::path::Path;

use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};

use crate::text::file;
use crate::text::file::MAX_TEXT_BYTES;

/// Largest number of problems that one message lists.
pub const MAX_PROBLEMS: usize = 8;

/// Error in a scenario, as a complete message for people.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct ScenarioError(String);

impl ScenarioError {
    /// Joins the first [`MAX_PROBLEMS`] of `problems` into one message.
    pub(crate) fn new(problems: &[Problem]) -> Self {
        let more = problems.len().saturating_sub(MAX_PROBLEMS);
        let mut told: Vec<String> = problems.iter().take(MAX_PROBLEMS).map(Problem::render).collect();
        told.extend((more > 0).then(|| format!("there is more: these are the first {MAX_PROBLEMS} problems")));
        Self(told.join("\n\n"))
    }

    /// Returns the message in one line, to stand within another message.
    pub fn in_one_line(&self) -> String {
        let lines = self.0.lines().map(|line| line.trim_start_matches([' ', '|', '=']).trim_start_matches("error: "));
        lines.filter(|line| !line.is_empty()).collect::<Vec<_>>().join("; ")
    }

    /// Makes the message of one problem that has no place in a file: `title` says what is wrong, `help` what to do.
    pub fn of(title: String, help: String) -> Self {
        Self::new(&[Problem { title, place: None, help }])
    }
}

/// Text that settings come from: a file, or the argument of one `--set`.
pub struct SettingsText {
    /// Name of the file; `None` for `--set`, which is shown in full.
    pub path: Option<String>,
    /// Settings in TOML.
    pub text: String,
}

impl SettingsText {
    /// Reads the scenario file at `path`.
    pub fn read(path: &Path) -> Result<Self, ScenarioError> {
        let name = path.display().to_string();
        let bytes = file::read(path, MAX_TEXT_BYTES).map_err(|error| {
            let meant = format!("{name}.toml");
            let hint = if Path::new(&meant).is_file() { format!("did you mean `{meant}`? ") } else { String::new() };
            ScenarioError::new(&[Problem {
                title: format!("cannot read the scenario `{name}`: {error}"),
                place: None,
                help: hint
                    + "give the path of a scenario file, or the name of a shipped one: `trefoil scenarios` lists them",
            }])
        })?;
        String::from_utf8(bytes).map(|text| Self { path: Some(name.clone()), text }).map_err(|error| {
            let start = error.utf8_error().valid_up_to();
            let text = String::from_utf8_lossy(error.as_bytes()).into_owned();
            let place = Some((&Self { path: Some(name), text }, start..start + char::REPLACEMENT_CHARACTER.len_utf8()));
            let help = "save the file as UTF-8 text".into();
            ScenarioError::new(&[Problem { title: "not UTF-8".into(), place, help }])
        })
    }

    /// Folder of the file; for `--set` an empty path, the working directory.
    pub fn folder(&self) -> &Path {
        self.path.as_ref().and_then(|path| Path::new(path).parent()).unwrap_or(Path::new(""))
    }
}

/// One problem in the settings.
pub struct Problem<'a> {
    /// Description of the problem.
    pub title: String,
    /// Source of the problem, and the bytes of its text; `None` if the problem is in no source.
    pub place: Option<(&'a SettingsText, Range<usize>)>,
    /// Advice on the fix; may be empty.
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
