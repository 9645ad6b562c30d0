//! Output for people: data on stdout, everything else on stderr. An error of a stream never ends the process.
//!
//! Stderr may be full, closed, a stopped terminal, or a pipe that is not read. A thread of its own writes to stderr, so
//! that no flight waits for the stream. Output on stdout was requested by the user: if it cannot be written, the exit
//! code shows the failure.
//!
//! Names of files, scenarios and nodes come from outside: characters that control a terminal are escaped ([`plain`]).

use std::borrow::Cow;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, ErrorKind, IsTerminal, Write, stderr, stdout};

use std::sync::OnceLock;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;

use crate::limits::{LAST_LINES, WAITING_LINES};
use contract::exit;
use rustix::io::fcntl_dupfd_cloexec;

/// Channel to the thread that writes to stderr; `None` if the thread could not be started.
static WRITER: OnceLock<Option<SyncSender<Word>>> = OnceLock::new();
/// Duplicate of stdout that is written to instead.
static KEPT_STDOUT: OnceLock<File> = OnceLock::new();
/// Lowest descriptor that [`keep_stdout`] takes: above those that code of users may close or replace.
const KEPT_FROM: i32 = 700;
/// First error of stdout.
static STDOUT_ERROR: OnceLock<io::Error> = OnceLock::new();

/// Escape sequence that moves to the top of a terminal and clears it.
const CLEAR: &str = "\x1b[H\x1b[J";

enum Word {
    Line(String),
    /// Request for an answer after all lines before it were written.
    Flush(SyncSender<()>),
}

/// Replaces characters that control a terminal, or change the direction of text, by their numbers, such as `\u{1b}`.
/// Ends of lines and tabs stay.
pub fn plain(text: &str) -> Cow<'_, str> {
    let turns = |c: char| matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    let controls = |c: char| c.is_control() && !matches!(c, '\n' | '\t') || turns(c);
    if !text.contains(controls) {
        return Cow::Borrowed(text);
    }
    let shown = |c: char| if controls(c) { c.escape_unicode().to_string() } else { c.to_string() };
    Cow::Owned(text.chars().map(shown).collect())
}

/// Styles of the beginnings of lines: escape sequences of bold red, cyan and green.
const STYLES: [(&str, &str); 3] = [("error:", "\x1b[1;31m"), ("note:", "\x1b[1;36m"), ("help:", "\x1b[1;32m")];
/// Escape sequence that ends a style.
const PLAIN: &str = "\x1b[0m";

/// Returns whether stderr takes colours: it is a terminal, and neither `NO_COLOR` nor `CLICOLOR=0` is set.
fn has_colours() -> bool {
    static CHOICE: OnceLock<bool> = OnceLock::new();
    *CHOICE.get_or_init(|| anstream::AutoStream::choice(&stderr()) != anstream::ColorChoice::Never)
}

/// Adds colours to a message: to the word that each line begins with, and to the marks below a quoted line.
fn coloured(text: &str) -> String {
    let mut result = String::new();
    for line in text.split_inclusive('\n') {
        let words = line.trim_start_matches([' ', '|', '=']);
        let (before, mark) = (&line[..line.len() - words.len()], words.trim_end());
        let style = STYLES.iter().find(|(word, _)| words.starts_with(word));
        let _ = match style {
            Some((word, style)) => write!(result, "{before}{style}{word}{PLAIN}{}", &words[word.len()..]),
            None if !mark.is_empty() && mark.bytes().all(|byte| byte == b'^') => {
                write!(result, "{before}{}{mark}{PLAIN}{}", STYLES[0].1, &words[mark.len()..])
            }
            None => write!(result, "{line}"),
        };
    }
    result
}

/// Duplicates stdout for all that is printed. Call it before a library is loaded that may close or replace stdout.
///
/// # Errors
/// Stdout is closed, or there are too many descriptors.
pub fn keep_stdout() -> io::Result<()> {
    // The second attempt is for a low `ulimit -n`.
    let kept = fcntl_dupfd_cloexec(stdout(), KEPT_FROM).or_else(|_| fcntl_dupfd_cloexec(stdout(), 3));
    let _ = KEPT_STDOUT.set(File::from(kept?)); // fails if stdout is kept already
    Ok(())
}

/// Prints `text` to stdout. [`finish`] reports an error.
pub fn print(text: &str) {
    print_after("", text);
}

/// Prints `text` to stdout, after clearing the screen if stdout is a terminal.
pub fn print_anew(text: &str) {
    print_after(if stdout().is_terminal() { CLEAR } else { "\n" }, text);
}

fn print_after(before: &str, text: &str) {
    let text = before.to_owned() + &plain(text);
    let mut stdout = stdout().lock();
    let written = match KEPT_STDOUT.get() {
        Some(mut kept) => kept.write_all(text.as_bytes()),
        None => stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()),
    };
    if let Err(error) = written {
        let _ = STDOUT_ERROR.set(error); // the first error is kept
    }
}

/// Returns whether everything could be printed to stdout so far.
pub fn is_read() -> bool {
    STDOUT_ERROR.get().is_none()
}

/// Prints a line to stderr without waiting; the line is dropped if too many are waiting.
pub fn eprint_line(line: &str) {
    let line = format!("{}\n", plain(line));
    let line = if has_colours() { coloured(&line) } else { line };
    match WRITER.get_or_init(start_writer) {
        Some(writer) => _ = writer.try_send(Word::Line(line)), // dropped if the queue is full
        None => write_line(&line),
    }
}

/// Waits at most [`LAST_LINES`] for stderr. Returns `code`, or at least [`exit::PROCESS_LOST`] if stdout failed.
///
/// A reader of stdout that has ended, as in `trefoil check FILE | head`, is no error.
pub fn finish(code: u8) -> u8 {
    let error = STDOUT_ERROR.get().filter(|error| error.kind() != ErrorKind::BrokenPipe);
    if let Some(error) = error {
        eprint_line(&format!("error: cannot write to stdout: {error}"));
    }
    if let Some(Some(writer)) = WRITER.get() {
        let (written, all) = sync_channel(1);
        if writer.try_send(Word::Flush(written)).is_ok() {
            let _ = all.recv_timeout(LAST_LINES); // give up if stderr is not read
        }
    }
    if error.is_some() { code.max(exit::PROCESS_LOST) } else { code }
}

fn start_writer() -> Option<SyncSender<Word>> {
    let (writer, words) = sync_channel(WAITING_LINES);
    let write = move || write_all(&words);
    thread::Builder::new().name("stderr".into()).spawn(write).ok().map(|_| writer)
}

fn write_all(words: &Receiver<Word>) {
    for word in words {
        match word {
            Word::Line(line) => write_line(&line),
            Word::Flush(written) => _ = written.send(()), // the process may have ended its wait
        }
    }
}

fn write_line(line: &str) {
    let _ = stderr().write_all(line.as_bytes()); // there is no other place to report an error
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_beginning_of_a_message_and_the_marks_are_coloured_and_nothing_else() {
        let message = "error: no `x`\n  |\n4 | error: x\n  | ^^\n  = help: did you mean `y`?\n";
        let told = coloured(message);
        assert_eq!(told.matches('\x1b').count(), 6, "{told:?}");
        for part in
            ["\x1b[1;31merror:\x1b[0m no", "| \x1b[1;31m^^\x1b[0m\n", "= \x1b[1;32mhelp:\x1b[0m did", "4 | error: x"]
        {
            assert!(told.contains(part), "{part:?}: {told:?}");
        }
    }

    #[test]
    fn characters_that_control_a_terminal_are_escaped() {
        assert_eq!(plain("a\tb\nä µ"), "a\tb\nä µ");
        assert_eq!(plain("\u{1b}]0;x\u{7}\r\u{9b}2J\u{202e}"), r"\u{1b}]0;x\u{7}\u{d}\u{9b}2J\u{202e}");
    }
}
