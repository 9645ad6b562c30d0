//! `new`: writes a controller for the user to change; it flies as written.

mod model;
mod templates;

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::ValueEnum;
use contract::exit;
use runtime::console::print;
use settings::Scenario;

use model::HoverModel;
use templates::{Language, Template, TemplateNode};

/// Arguments of `new`.
#[derive(clap::Args)]
#[command(
    after_help = "The controller works with the linear model of the default vehicle at 100 Hz, which is written \
beside it. The last line is the command that builds and flies it."
)]
pub struct NewArgs {
    /// Folder of the controller; it must not exist, or be empty
    pub dir: PathBuf,
    /// Language, or tool that generates C
    #[arg(long)]
    lang: Language,
    /// Node that the controller flies as
    #[arg(long, default_value = "attitude-mpc")]
    node: TemplateNode,
}

/// Writes the controller, and prints its files and the command that flies it; returns the exit code.
pub fn new(args: &NewArgs) -> anyhow::Result<u8> {
    let (language, node) = (name(&args.lang), name(&args.node));
    let matches = |template: &&Template| (template.language, template.node) == (args.lang, args.node);
    let Some(template) = Template::all().iter().find(matches) else {
        bail!("there is no {node} in {language}; there are: {}", pairs());
    };
    let shown = args.dir.display();
    if args.dir.exists() && !args.dir.is_dir() {
        bail!("{shown} is a file, and a controller is written into a folder: name a new one");
    }
    if std::fs::read_dir(&args.dir).is_ok_and(|mut entries| entries.next().is_some()) {
        bail!("the folder {shown} is not empty: name a new one");
    }
    for (path, text) in template.files(&node, &HoverModel::of(&Scenario::default())) {
        write(&args.dir.join(&path), &text).with_context(|| format!("cannot write {shown}/{path}"))?;
        print(&format!("{shown}/{path}\n"));
    }
    let launcher = std::env::args_os().next().map_or_else(|| "trefoil".into(), PathBuf::from);
    let scenario = args.dir.join("scenario.toml");
    let [launcher, dir, scenario] = [&launcher, &args.dir, &scenario].map(|path| quoted(path));
    print(&format!("\nmake -C {dir} && {launcher} fly {scenario}\n"));
    Ok(exit::FLOWN)
}

/// Writes `text` to a new file, and creates its folder.
fn write(path: &Path, text: &str) -> std::io::Result<()> {
    path.parent().map_or(Ok(()), std::fs::create_dir_all)?;
    std::fs::write(path, text)
}

/// Returns the name of a value on the command line.
pub fn name(value: &impl ValueEnum) -> String {
    value.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
}

/// Lists the pairs of node and language that have a template.
fn pairs() -> String {
    let pair = |template: &Template| format!("{} in {}", name(&template.node), name(&template.language));
    Template::all().iter().map(pair).collect::<Vec<_>>().join(", ")
}

/// Quotes a path as one word of a shell, if it needs quotes.
fn quoted(path: &Path) -> String {
    let text = path.to_string_lossy();
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-+=:,@%".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) {
        text.into_owned()
    } else {
        format!("'{}'", text.replace('\'', r"'\''"))
    }
}
