//! Cells of tables of data, and their columns in Parquet. A missing value is null; NaN is kept.

use std::io::Write;
use std::sync::Arc;

use anyhow::Context;
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::file::properties::{WriterProperties, WriterPropertiesBuilder};
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::{Type, TypePtr};

/// Type of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnType {
    Bool,
    Int,
    /// Unsigned integer; its cells are [`Cell::Int`] with the same bits.
    Count,
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

impl Cell {
    /// Returns whether a column of this kind accepts the cell.
    pub fn is(&self, kind: ColumnType) -> bool {
        matches!(
            (self, kind),
            (Self::None, _)
                | (Self::Bool(_), ColumnType::Bool)
                | (Self::Int(_), ColumnType::Int | ColumnType::Count)
                | (Self::Real(_), ColumnType::Real)
                | (Self::Text(_), ColumnType::Text)
        )
    }
}

/// Properties of a Parquet file, compressed with LZ4.
pub fn properties() -> WriterPropertiesBuilder {
    WriterProperties::builder().set_compression(Compression::LZ4_RAW).set_created_by("trefoil".into())
}

/// Makes the schema of the table `name` with these columns.
pub fn schema<'a>(name: &str, columns: impl Iterator<Item = (&'a str, ColumnType)>) -> anyhow::Result<TypePtr> {
    let field = |(name, kind)| {
        let (physical, logical) = match kind {
            ColumnType::Bool => (Physical::BOOLEAN, None),
            ColumnType::Int => (Physical::INT64, None),
            ColumnType::Count => (Physical::INT64, Some(LogicalType::integer(64, false))),
            ColumnType::Real => (Physical::DOUBLE, None),
            ColumnType::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        };
        let field = Type::primitive_type_builder(name, physical).with_repetition(Repetition::OPTIONAL);
        field.with_logical_type(logical).build().map(Arc::new)
    };
    let fields = columns.map(field).collect::<Result<Vec<_>, _>>()?;
    Ok(Arc::new(Type::group_type_builder(name).with_fields(fields).build()?))
}

/// Writes rows of all columns as one row group, which is compressed as one. A cell of another kind than its column is
/// null.
pub fn write_group<'a, W: Write + Send>(
    writer: &mut SerializedFileWriter<W>,
    columns: impl Iterator<Item = (ColumnType, &'a [Cell])>,
) -> anyhow::Result<()> {
    let mut group = writer.next_row_group()?;
    for (kind, cells) in columns {
        let column = group.next_column()?.context("a column of the schema")?;
        match kind {
            ColumnType::Bool => write_column::<BoolType>(column, cells, |cell| match cell {
                Cell::Bool(yes) => Some(*yes),
                _ => None,
            }),
            ColumnType::Int | ColumnType::Count => write_column::<Int64Type>(column, cells, |cell| match cell {
                Cell::Int(n) => Some(*n),
                _ => None,
            }),
            ColumnType::Real => write_column::<DoubleType>(column, cells, |cell| match cell {
                Cell::Real(x) => Some(*x),
                _ => None,
            }),
            ColumnType::Text => write_column::<ByteArrayType>(column, cells, |cell| match cell {
                Cell::Text(text) => Some(ByteArray::from(text.as_str())),
                _ => None,
            }),
        }?;
    }
    group.close()?;
    Ok(())
}

fn write_column<T: DataType>(
    mut column: SerializedColumnWriter,
    cells: &[Cell],
    value: impl Fn(&Cell) -> Option<T::T>,
) -> anyhow::Result<()> {
    let values: Vec<Option<T::T>> = cells.iter().map(value).collect();
    let levels: Vec<i16> = values.iter().map(|value| value.is_some().into()).collect();
    let values: Vec<T::T> = values.into_iter().flatten().collect();
    column.typed::<T>().write_batch(&values, Some(&levels), None)?;
    Ok(column.close()?)
}
