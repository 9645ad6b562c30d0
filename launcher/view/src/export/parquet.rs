//! Tables as Parquet, compressed with LZ4. A missing value is null; NaN is kept.

use std::sync::Arc;

use folder::dir::{Dir, NewFile};
use parquet::file::writer::SerializedFileWriter;

use super::tables::{ColumnTypes, Rows};
use crate::cells::{Cell, ColumnType, properties, schema, write_group};

/// Rows of a row group, which is held in memory until it is written.
const GROUP: usize = 1 << 13;

pub struct Parquet<'a> {
    writer: SerializedFileWriter<NewFile<'a>>,
    /// Cells of each column that are not written yet.
    columns: Vec<(ColumnType, Vec<Cell>)>,
    rows: usize,
}

impl<'a> Rows<'a> for Parquet<'a> {
    fn begin(folder: &'a Dir, name: &str, columns: &ColumnTypes) -> anyhow::Result<Self> {
        let schema = schema(name, columns.iter().map(|(name, kind)| (name.as_str(), *kind)))?;
        let file = folder.begin(format!("{name}.parquet"))?;
        let writer = SerializedFileWriter::new(file, schema, Arc::new(properties().build()))?;
        Ok(Self { writer, columns: columns.iter().map(|(_, kind)| (*kind, vec![])).collect(), rows: 0 })
    }

    fn row(&mut self, cells: Vec<Cell>) -> anyhow::Result<()> {
        self.columns.iter_mut().zip(cells).for_each(|((_, column), cell)| column.push(cell));
        self.rows += 1;
        if self.rows == GROUP { self.write_group() } else { Ok(()) }
    }

    fn finish(mut self) -> anyhow::Result<()> {
        if self.rows > 0 {
            self.write_group()?;
        }
        Ok(self.writer.into_inner()?.finish()?)
    }
}

impl Parquet<'_> {
    fn write_group(&mut self) -> anyhow::Result<()> {
        write_group(&mut self.writer, self.columns.iter().map(|(kind, cells)| (*kind, cells.as_slice())))?;
        self.columns.iter_mut().for_each(|(_, cells)| cells.clear());
        self.rows = 0;
        Ok(())
    }
}
