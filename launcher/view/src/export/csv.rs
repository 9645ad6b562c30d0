//! Tables as CSV (RFC 4180, lines end in LF). A number is the shortest text that reads back to the same bits; a missing
//! value is empty.

use std::fmt::Write as _;
use std::io::{BufWriter, IntoInnerError, Write};

use folder::dir::{Dir, NewFile};

use super::tables::{ColumnTypes, Rows};
use crate::cells::Cell;

pub struct Csv<'a> {
    file: BufWriter<NewFile<'a>>,
    line: String,
}

impl<'a> Rows<'a> for Csv<'a> {
    fn begin(folder: &'a Dir, name: &str, columns: &ColumnTypes) -> anyhow::Result<Self> {
        let mut file = BufWriter::new(folder.begin(format!("{name}.csv"))?);
        let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
        writeln!(file, "{}", names.join(","))?;
        Ok(Self { file, line: String::new() })
    }

    fn row(&mut self, cells: Vec<Cell>) -> anyhow::Result<()> {
        self.line.clear();
        for (i, cell) in cells.iter().enumerate() {
            let comma = if i > 0 { "," } else { "" };
            match cell {
                Cell::None => write!(self.line, "{comma}"),
                Cell::Bool(yes) => write!(self.line, "{comma}{yes}"),
                // All integers of a log are counts.
                Cell::Int(n) => write!(self.line, "{comma}{}", n.cast_unsigned()),
                Cell::Real(x) => write!(self.line, "{comma}{x:?}"),
                Cell::Text(text) if text.contains([',', '"', '\n', '\r']) => {
                    write!(self.line, "{comma}\"{}\"", text.replace('"', "\"\""))
                }
                Cell::Text(text) => write!(self.line, "{comma}{text}"),
            }?;
        }
        self.line.push('\n');
        Ok(self.file.write_all(self.line.as_bytes())?)
    }

    fn finish(self) -> anyhow::Result<()> {
        Ok(self.file.into_inner().map_err(IntoInnerError::into_error)?.finish()?)
    }
}
