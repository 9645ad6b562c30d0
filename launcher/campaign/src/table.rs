//! Tables of flights: typed columns in memory, and Parquet files compressed with LZ4.
//!
//! A file carries the SHA-256 of its columns, because Parquet does not always notice a changed bit in a number.

use std::sync::Arc;

use anyhow::{Context, bail, ensure};
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use serde_json::json;
use sha2::{Digest, Sha256};
use toml::Value;
use view::draw::short;

use crate::hex::hex;

/// Rows of a row group, which is compressed as one.
const GROUP: usize = 1 << 16;
/// Key of the hash of the columns in the metadata of a file.
const HASH: &str = "columns_sha256";

/// Type of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Bool,
    Int,
    Real,
    Text,
}

/// One value of a column; `None` is stored as null.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    None,
    Bool(bool),
    Int(i64),
    Real(f64),
    Text(String),
}

/// Values of one column.
#[derive(Debug, Clone, PartialEq)]
pub enum Column {
    Bool(Vec<Option<bool>>),
    Int(Vec<Option<i64>>),
    Real(Vec<Option<f64>>),
    Text(Vec<Option<String>>),
}

/// Named columns of the same length.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    pub columns: Vec<(String, Column)>,
}

impl Kind {
    /// Converts a value of TOML to a cell for such a column; a value of another type becomes text.
    pub fn cell(self, value: &Value) -> Cell {
        match (self, value) {
            (Self::Int, Value::Integer(n)) => Cell::Int(*n),
            (Self::Real, Value::Integer(n)) => Cell::Real(*n as f64),
            (Self::Real, Value::Float(x)) => Cell::Real(*x),
            (Self::Bool, Value::Boolean(yes)) => Cell::Bool(*yes),
            (_, Value::String(text)) => Cell::Text(text.clone()),
            (_, other) => Cell::Text(other.to_string()),
        }
    }
}

impl Cell {
    /// Returns whether a column of this kind accepts the cell.
    pub fn is(&self, kind: Kind) -> bool {
        matches!(
            (self, kind),
            (Self::None, _)
                | (Self::Bool(_), Kind::Bool)
                | (Self::Int(_), Kind::Int)
                | (Self::Real(_), Kind::Real)
                | (Self::Text(_), Kind::Text)
        )
    }
}

impl Column {
    fn new(kind: Kind) -> Self {
        match kind {
            Kind::Bool => Self::Bool(vec![]),
            Kind::Int => Self::Int(vec![]),
            Kind::Real => Self::Real(vec![]),
            Kind::Text => Self::Text(vec![]),
        }
    }

    fn kind(&self) -> Kind {
        match self {
            Self::Bool(_) => Kind::Bool,
            Self::Int(_) => Kind::Int,
            Self::Real(_) => Kind::Real,
            Self::Text(_) => Kind::Text,
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::Bool(all) => all.len(),
            Self::Int(all) => all.len(),
            Self::Real(all) => all.len(),
            Self::Text(all) => all.len(),
        }
    }

    /// Adds a cell. NaN is stored as null, and so is a cell of another kind.
    fn push(&mut self, cell: Cell) {
        match (self, cell) {
            (Self::Bool(all), Cell::Bool(yes)) => all.push(Some(yes)),
            (Self::Int(all), Cell::Int(n)) => all.push(Some(n)),
            (Self::Real(all), Cell::Real(x)) => all.push(Some(x).filter(|x| !x.is_nan())),
            (Self::Text(all), Cell::Text(text)) => all.push(Some(text)),
            (Self::Bool(all), _) => all.push(None),
            (Self::Int(all), _) => all.push(None),
            (Self::Real(all), _) => all.push(None),
            (Self::Text(all), _) => all.push(None),
        }
    }

    fn append(&mut self, other: Self) -> anyhow::Result<()> {
        match (self, other) {
            (Self::Bool(all), Self::Bool(more)) => all.extend(more),
            (Self::Int(all), Self::Int(more)) => all.extend(more),
            (Self::Real(all), Self::Real(more)) => all.extend(more),
            (Self::Text(all), Self::Text(more)) => all.extend(more),
            _ => bail!("columns of different types"),
        }
        Ok(())
    }

    /// Returns the value of a row.
    pub fn cell(&self, row: usize) -> Cell {
        match self {
            Self::Bool(all) => all[row].map_or(Cell::None, Cell::Bool),
            Self::Int(all) => all[row].map_or(Cell::None, Cell::Int),
            Self::Real(all) => all[row].map_or(Cell::None, Cell::Real),
            Self::Text(all) => all[row].clone().map_or(Cell::None, Cell::Text),
        }
    }

    /// Returns the number of a row; `None` for null and in columns of text or booleans.
    pub fn number(&self, row: usize) -> Option<f64> {
        match self {
            Self::Int(all) => all[row].map(|n| n as f64),
            Self::Real(all) => all[row],
            Self::Bool(_) | Self::Text(_) => None,
        }
    }

    /// Returns the text of a row; empty for null and in columns of other kinds.
    pub fn text(&self, row: usize) -> &str {
        match self {
            Self::Text(all) => all[row].as_deref().unwrap_or_default(),
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
        let mut one = |value: Option<&[u8]>| {
            hash.update(value.map_or(u64::MAX, |bytes| bytes.len() as u64).to_le_bytes());
            hash.update(value.unwrap_or_default());
        };
        match self {
            Self::Bool(all) => all.iter().for_each(|yes| one(yes.map(|yes| [u8::from(yes)]).as_ref().map(|b| &b[..]))),
            Self::Int(all) => all.iter().for_each(|n| one(n.map(i64::to_le_bytes).as_ref().map(|b| &b[..]))),
            Self::Real(all) => all.iter().for_each(|x| one(x.map(f64::to_le_bytes).as_ref().map(|b| &b[..]))),
            Self::Text(all) => all.iter().for_each(|text| one(text.as_deref().map(str::as_bytes))),
        }
    }
}

impl Table {
    pub fn new(columns: &[(String, Kind)]) -> Self {
        Self { columns: columns.iter().map(|(name, kind)| (name.clone(), Column::new(*kind))).collect() }
    }

    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |(_, column)| column.len())
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
        ensure!(self.names().eq(other.names()), "tables with different columns");
        let pairs = self.columns.iter_mut().zip(other.columns);
        pairs.into_iter().try_for_each(|((_, column), (_, more))| column.append(more))
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
    pub fn column(&self, name: &str) -> Option<&Column> {
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
        let field = |(name, column): &(String, Column)| {
            let (physical, logical) = match column.kind() {
                Kind::Bool => (Physical::BOOLEAN, None),
                Kind::Int => (Physical::INT64, None),
                Kind::Real => (Physical::DOUBLE, None),
                Kind::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
            };
            let field = Type::primitive_type_builder(name, physical).with_repetition(Repetition::OPTIONAL);
            field.with_logical_type(logical).build().map(Arc::new)
        };
        let fields = self.columns.iter().map(field).collect::<Result<Vec<_>, _>>()?;
        let schema = Type::group_type_builder("flights").with_fields(fields).build()?;
        let own = [(HASH, self.hash())];
        let words = words.iter().chain(&own).map(|(key, word)| KeyValue::new((*key).to_owned(), word.clone()));
        let properties = WriterProperties::builder()
            .set_compression(Compression::LZ4_RAW)
            .set_created_by("trefoil".into())
            .set_key_value_metadata(Some(words.collect()));
        let mut writer = SerializedFileWriter::new(vec![], Arc::new(schema), Arc::new(properties.build()))?;
        for from in (0..self.rows()).step_by(GROUP) {
            let rows = from..self.rows().min(from + GROUP);
            let mut group = writer.next_row_group()?;
            for (_, column) in &self.columns {
                let mut written = group.next_column()?.context("a column of the schema")?;
                macro_rules! write {
                    ($type:ty, $values:expr, $of:expr) => {{
                        let levels: Vec<i16> =
                            $values[rows.clone()].iter().map(|value| i16::from(value.is_some())).collect();
                        let values: Vec<_> = $values[rows.clone()].iter().flatten().map($of).collect();
                        written.typed::<$type>().write_batch(&values, Some(&levels), None)?;
                    }};
                }
                match column {
                    Column::Bool(all) => write!(BoolType, all, |yes| *yes),
                    Column::Int(all) => write!(Int64Type, all, |n| *n),
                    Column::Real(all) => write!(DoubleType, all, |x| *x),
                    Column::Text(all) => write!(ByteArrayType, all, |text| ByteArray::from(text.as_str())),
                }
                written.close()?;
            }
            group.close()?;
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
            Physical::BOOLEAN => Ok(Kind::Bool),
            Physical::INT64 => Ok(Kind::Int),
            Physical::DOUBLE => Ok(Kind::Real),
            Physical::BYTE_ARRAY => Ok(Kind::Text),
            other => bail!("a column of type {other}"),
        };
        let columns = metadata.schema_descr().columns().iter();
        let columns = columns.map(|column| Ok((column.name().to_owned(), kind(column.physical_type())?)));
        let mut table = Self::new(&columns.collect::<anyhow::Result<Vec<_>>>()?);
        for group in 0..reader.num_row_groups() {
            let group = reader.get_row_group(group)?;
            let rows = usize::try_from(group.metadata().num_rows())?;
            for (i, (_, column)) in table.columns.iter_mut().enumerate() {
                match (column, group.get_column_reader(i)?) {
                    (Column::Bool(all), ColumnReader::BoolColumnReader(read)) => all.extend(values(read, rows)?),
                    (Column::Int(all), ColumnReader::Int64ColumnReader(read)) => all.extend(values(read, rows)?),
                    (Column::Real(all), ColumnReader::DoubleColumnReader(read)) => all.extend(values(read, rows)?),
                    (Column::Text(all), ColumnReader::ByteArrayColumnReader(read)) => {
                        let text = |bytes: ByteArray| bytes.as_utf8().map(str::to_owned);
                        for value in values(read, rows)? {
                            all.push(value.map(text).transpose()?);
                        }
                    }
                    _ => bail!("a column of another type than its own"),
                }
            }
        }
        let hash = words.iter().find(|(key, _)| key == HASH).map(|(_, hash)| hash.as_str());
        ensure!(hash == Some(table.hash().as_str()), "its columns are not those that were written");
        Ok((table, words))
    }
}

/// Reads all values of a column of `rows` rows.
fn values<T: DataType>(mut column: ColumnReaderImpl<T>, rows: usize) -> anyhow::Result<Vec<Option<T::T>>> {
    let (mut levels, mut values) = (vec![], vec![]);
    let mut read = 0;
    while read < rows {
        let (records, ..) = column.read_records(rows - read, Some(&mut levels), None, &mut values)?;
        ensure!(records > 0, "a column ends after {read} of {rows} rows");
        read += records;
    }
    let mut values = values.into_iter();
    levels
        .iter()
        .map(|level| if *level == 0 { Ok(None) } else { values.next().map(Some).context("too few values") })
        .collect()
}

#[cfg(test)]
mod tests;
