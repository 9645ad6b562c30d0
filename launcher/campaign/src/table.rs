//! Tables of flights: typed columns in memory, and Parquet files compressed with LZ4.
//!
//! A file carries the SHA-256 of its columns, because Parquet does not always notice a changed bit in a number.

use std::sync::Arc;

use anyhow::{Context, bail, ensure};
use flight::programs::hex;
use parquet::basic::Type as Physical;
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::file::metadata::KeyValue;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use serde_json::json;
use sha2::{Digest, Sha256};
use toml::Value;
pub use view::cells::{Cell, ColumnType};
use view::cells::{properties, schema, write_group};
use view::draw::short;

/// Rows of a row group, which is compressed as one.
const GROUP: usize = 1 << 16;
/// Key of the hash of the columns in the metadata of a file.
const HASH: &str = "columns_sha256";

/// Values of one column.
#[derive(Debug, Clone, PartialEq)]
pub struct TableColumn {
    kind: ColumnType,
    cells: Vec<Cell>,
}

/// Named columns of the same length.
#[derive(Debug, Clone, PartialEq)]
pub struct FlightTable {
    pub columns: Vec<(String, TableColumn)>,
}

/// Converts a value of TOML to a cell of a column of this kind; a value of another type becomes text.
pub fn cell_of(kind: ColumnType, value: &Value) -> Cell {
    match (kind, value) {
        (ColumnType::Int, Value::Integer(n)) => Cell::Int(*n),
        (ColumnType::Real, Value::Integer(n)) => Cell::Real(*n as f64),
        (ColumnType::Real, Value::Float(x)) => Cell::Real(*x),
        (ColumnType::Bool, Value::Boolean(yes)) => Cell::Bool(*yes),
        (_, Value::String(text)) => Cell::Text(text.clone()),
        (_, other) => Cell::Text(other.to_string()),
    }
}

impl TableColumn {
    /// Adds a cell. NaN is stored as null, and so is a cell of another kind.
    fn push(&mut self, cell: Cell) {
        let is_nan = matches!(cell, Cell::Real(x) if x.is_nan());
        self.cells.push(if is_nan || !cell.is(self.kind) { Cell::None } else { cell });
    }

    /// Returns whether the values are numbers.
    pub fn is_number(&self) -> bool {
        matches!(self.kind, ColumnType::Int | ColumnType::Real)
    }

    /// Returns the value of a row.
    pub fn cell(&self, row: usize) -> Cell {
        self.cells[row].clone()
    }

    /// Returns the number of a row; `None` for null and in columns of text or booleans.
    pub fn number(&self, row: usize) -> Option<f64> {
        match self.cells[row] {
            Cell::Int(n) => Some(n as f64),
            Cell::Real(x) => Some(x),
            _ => None,
        }
    }

    /// Returns the text of a row; empty for null and in columns of other kinds.
    pub fn text(&self, row: usize) -> &str {
        match &self.cells[row] {
            Cell::Text(text) => text,
            _ => "",
        }
    }

    /// Formats the value of a row.
    pub fn word(&self, row: usize) -> String {
        match self.cell(row) {
            Cell::None => "none".to_owned(),
            Cell::Bool(yes) => yes.to_string(),
            Cell::Int(n) => n.to_string(),
            Cell::Real(x) => short(x),
            Cell::Text(text) => text,
        }
    }

    fn hash(&self, hash: &mut Sha256) {
        let mut one = |length: u64, bytes: &[u8]| {
            hash.update(length.to_le_bytes());
            hash.update(bytes);
        };
        for cell in &self.cells {
            match cell {
                Cell::None => one(u64::MAX, &[]),
                Cell::Bool(yes) => one(1, &[u8::from(*yes)]),
                Cell::Int(n) => one(8, &n.to_le_bytes()),
                Cell::Real(x) => one(8, &x.to_le_bytes()),
                Cell::Text(text) => one(text.len() as u64, text.as_bytes()),
            }
        }
    }
}

impl FlightTable {
    pub fn new(columns: &[(String, ColumnType)]) -> Self {
        let column = |(name, kind): &(String, ColumnType)| (name.clone(), TableColumn { kind: *kind, cells: vec![] });
        Self { columns: columns.iter().map(column).collect() }
    }

    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |(_, column)| column.cells.len())
    }

    /// Adds a row; cells absent at the end are null.
    pub fn push(&mut self, row: Vec<Cell>) {
        let cells = row.into_iter().chain(std::iter::repeat(Cell::None));
        for ((_, column), cell) in self.columns.iter_mut().zip(cells) {
            column.push(cell);
        }
    }

    /// Adds the rows of a table; an error if its columns differ.
    pub fn append(&mut self, other: Self) -> anyhow::Result<()> {
        let kinds = |table: &Self| table.columns.iter().map(|(_, column)| column.kind).collect::<Vec<_>>();
        let is_same = self.names().eq(other.names()) && kinds(self) == kinds(&other);
        ensure!(is_same, "tables with different columns");
        let pairs = self.columns.iter_mut().zip(other.columns);
        pairs.for_each(|((_, column), (_, more))| column.cells.extend(more.cells));
        Ok(())
    }

    /// Returns the rows as objects.
    pub fn to_json(&self) -> serde_json::Value {
        let cell = |cell: Cell| match cell {
            Cell::None => json!(null),
            Cell::Bool(yes) => json!(yes),
            Cell::Int(n) => json!(n),
            Cell::Real(x) => json!(x),
            Cell::Text(text) => json!(text),
        };
        let row = |row: usize| -> serde_json::Map<String, serde_json::Value> {
            self.columns.iter().map(|(name, column)| (name.clone(), cell(column.cell(row)))).collect()
        };
        (0..self.rows()).map(row).collect()
    }

    /// Finds a column by name.
    pub fn column(&self, name: &str) -> Option<&TableColumn> {
        self.columns.iter().find(|(of, _)| of == name).map(|(_, column)| column)
    }

    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.columns.iter().map(|(name, _)| name.as_str())
    }

    fn hash(&self) -> String {
        let mut hash = Sha256::new();
        for (name, column) in &self.columns {
            hash.update(name.as_bytes());
            column.hash(&mut hash);
        }
        hex(&hash.finalize())
    }

    /// Writes a Parquet file with `words` as key-value metadata.
    pub fn to_parquet(&self, words: &[(&str, String)]) -> anyhow::Result<Vec<u8>> {
        let columns = self.columns.iter().map(|(name, column)| (name.as_str(), column.kind));
        let schema = schema("flights", columns)?;
        let own = [(HASH, self.hash())];
        let words = words.iter().chain(&own).map(|(key, word)| KeyValue::new((*key).to_owned(), word.clone()));
        let properties = properties().set_key_value_metadata(Some(words.collect())).build();
        let mut writer = SerializedFileWriter::new(vec![], schema, Arc::new(properties))?;
        for from in (0..self.rows()).step_by(GROUP) {
            let rows = from..self.rows().min(from + GROUP);
            let columns = self.columns.iter().map(|(_, column)| (column.kind, &column.cells[rows.clone()]));
            write_group(&mut writer, columns)?;
        }
        Ok(writer.into_inner()?)
    }

    /// Reads a Parquet file written by [`to_parquet`](Self::to_parquet), with its metadata and at most `limit` rows,
    /// because a small file can claim more rows than memory holds.
    ///
    /// # Errors
    /// Anything that [`to_parquet`](Self::to_parquet) would not have written.
    pub fn from_parquet(bytes: Vec<u8>, limit: u64) -> anyhow::Result<(Self, Vec<(String, String)>)> {
        let reader = SerializedFileReader::new(bytes::Bytes::from(bytes))?;
        let metadata = reader.metadata().file_metadata().clone();
        let rows =
            reader.metadata().row_groups().iter().map(|group| u64::try_from(group.num_rows()).unwrap_or(u64::MAX));
        let rows = rows.fold(0, u64::saturating_add);
        ensure!(rows <= limit, "it has {rows} rows, and at most {limit} are expected");
        let words = metadata.key_value_metadata().cloned().unwrap_or_default();
        let words: Vec<(String, String)> =
            words.into_iter().map(|word| (word.key, word.value.unwrap_or_default())).collect();
        let kind = |physical: Physical| match physical {
            Physical::BOOLEAN => Ok(ColumnType::Bool),
            Physical::INT64 => Ok(ColumnType::Int),
            Physical::DOUBLE => Ok(ColumnType::Real),
            Physical::BYTE_ARRAY => Ok(ColumnType::Text),
            other => bail!("a column of type {other}"),
        };
        let columns = metadata.schema_descr().columns().iter();
        let columns = columns.map(|column| Ok((column.name().to_owned(), kind(column.physical_type())?)));
        let mut table = Self::new(&columns.collect::<anyhow::Result<Vec<_>>>()?);
        for group in 0..reader.num_row_groups() {
            let group = reader.get_row_group(group)?;
            let rows = usize::try_from(group.metadata().num_rows())?;
            for (i, (_, column)) in table.columns.iter_mut().enumerate() {
                column.cells.extend(match group.get_column_reader(i)? {
                    ColumnReader::BoolColumnReader(read) => cells(read, rows, |yes| Ok(Cell::Bool(yes))),
                    ColumnReader::Int64ColumnReader(read) => cells(read, rows, |n| Ok(Cell::Int(n))),
                    ColumnReader::DoubleColumnReader(read) => cells(read, rows, |x| Ok(Cell::Real(x))),
                    ColumnReader::ByteArrayColumnReader(read) => {
                        cells(read, rows, |text| Ok(Cell::Text(text.as_utf8()?.to_owned())))
                    }
                    _ => bail!("a column of another type than its own"),
                }?);
            }
        }
        let hash = words.iter().find(|(key, _)| key == HASH).map(|(_, hash)| hash.as_str());
        ensure!(hash == Some(table.hash().as_str()), "its columns are not those that were written");
        Ok((table, words))
    }
}

/// Reads all values of a column of `rows` rows as cells.
fn cells<T: DataType>(
    mut column: ColumnReaderImpl<T>,
    rows: usize,
    cell: impl Fn(T::T) -> anyhow::Result<Cell>,
) -> anyhow::Result<Vec<Cell>> {
    let (mut levels, mut values) = (vec![], vec![]);
    let mut read = 0;
    while read < rows {
        let (records, ..) = column.read_records(rows - read, Some(&mut levels), None, &mut values)?;
        ensure!(records > 0, "a column ends after {read} of {rows} rows");
        read += records;
    }
    let mut values = values.into_iter();
    let of_level =
        |level: &i16| if *level == 0 { Ok(Cell::None) } else { cell(values.next().context("too few values")?) };
    levels.iter().map(of_level).collect()
}

#[cfg(test)]
mod tests;
