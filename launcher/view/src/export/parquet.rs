//! Tables as Parquet, compressed with LZ4. A missing value is null; NaN is kept.

use std::sync::Arc;

use anyhow::Context;
use flight::dir::{Dir, NewFile};
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::Type;

use super::tables::{Cell, Columns, Kind, Rows};

/// Rows of a row group, which is held in memory until it is written.
const GROUP: usize = 1 << 13;

pub struct Parquet<'a> {
    writer: SerializedFileWriter<NewFile<'a>>,
    columns: Vec<Column>,
    rows: usize,
}

/// Values of a column that are not written yet; `levels` has 0 for null and 1 for a value.
struct Column {
    values: Values,
    levels: Vec<i16>,
}

enum Values {
    Count(Vec<i64>),
    Number(Vec<f64>),
    Text(Vec<ByteArray>),
}

impl<'a> Rows<'a> for Parquet<'a> {
    fn begin(folder: &'a Dir, name: &str, columns: &Columns) -> anyhow::Result<Self> {
        let field = |(name, kind): &(String, Kind)| {
            let unsigned = LogicalType::integer(64, false);
            let (physical, logical) = match kind {
                Kind::Count => (Physical::INT64, Some(unsigned)),
                Kind::Number => (Physical::DOUBLE, None),
                Kind::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
            };
            let field = Type::primitive_type_builder(name, physical).with_repetition(Repetition::OPTIONAL);
            field.with_logical_type(logical).build().map(Arc::new)
        };
        let fields = columns.iter().map(field).collect::<Result<Vec<_>, _>>()?;
        let schema = Type::group_type_builder(name).with_fields(fields).build()?;
        let properties = WriterProperties::builder().set_compression(Compression::LZ4_RAW);
        let properties = properties.set_created_by("trefoil".into()).build();
        let file = folder.begin(&format!("{name}.parquet"))?;
        let writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties))?;
        let columns = columns.iter().map(|(_, kind)| Column::new(*kind)).collect();
        Ok(Self { writer, columns, rows: 0 })
    }

    fn row(&mut self, cells: &[Cell]) -> anyhow::Result<()> {
        self.columns.iter_mut().zip(cells).for_each(|(column, cell)| column.push(cell));
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
        let mut group = self.writer.next_row_group()?;
        for column in &mut self.columns {
            column.write(group.next_column()?.context("a column of the schema")?)?;
        }
        group.close()?;
        self.rows = 0;
        Ok(())
    }
}

impl Column {
    fn new(kind: Kind) -> Self {
        let values = match kind {
            Kind::Count => Values::Count(vec![]),
            Kind::Number => Values::Number(vec![]),
            Kind::Text => Values::Text(vec![]),
        };
        Self { values, levels: vec![] }
    }

    /// Adds a cell; one of another kind is null.
    fn push(&mut self, cell: &Cell) {
        let is_value = match (&mut self.values, cell) {
            (Values::Count(values), Cell::Count(n)) => {
                values.push(n.cast_signed()); // the logical type says that it is unsigned
                true
            }
            (Values::Number(values), Cell::Number(x)) => {
                values.push(*x);
                true
            }
            (Values::Text(values), Cell::Text(text)) => {
                values.push(ByteArray::from(&**text));
                true
            }
            _ => false,
        };
        self.levels.push(is_value.into());
    }

    /// Writes the values, and forgets them.
    fn write(&mut self, column: SerializedColumnWriter) -> anyhow::Result<()> {
        fn all<T: DataType>(
            mut column: SerializedColumnWriter,
            values: &mut Vec<T::T>,
            levels: &[i16],
        ) -> anyhow::Result<()> {
            column.typed::<T>().write_batch(values, Some(levels), None)?;
            values.clear();
            Ok(column.close()?)
        }
        match &mut self.values {
            Values::Count(values) => all::<Int64Type>(column, values, &self.levels),
            Values::Number(values) => all::<DoubleType>(column, values, &self.levels),
            Values::Text(values) => all::<ByteArrayType>(column, values, &self.levels),
        }?;
        self.levels.clear();
        Ok(())
    }
}
