//! `telemetry.parquet`: a row a tick, written in row groups as the run goes.

use std::collections::BTreeMap;
use std::io::Write;
use std::sync::Arc;

use parquet::basic::{
    Compression, Encoding, LogicalType, Repetition, Type as PhysicalType, ZstdLevel,
};
use parquet::data_type::{BoolType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{ColumnPath, Type};

use crate::RECORD_SCHEMA;
use crate::column::{Cell, Column, ColumnKind, OWN_COLUMNS};
use crate::keys::SCHEMA_KEY;
use docktwin_core::{SimTime, Tick};

/// Rows of a row group: 8 s of 1 ms ticks. What a writer keeps of every group to the end of the run is
/// in proportion to their number.
pub(crate) const GROUP_ROWS: usize = 8192;

/// Rows that wait to become a row group.
pub(crate) struct Block {
    ticks: Vec<u64>,
    nanos: Vec<u64>,
    /// Row after row.
    cells: Vec<Cell>,
}

impl Block {
    pub(crate) fn new(columns: usize) -> Self {
        Self {
            ticks: Vec::with_capacity(GROUP_ROWS),
            nanos: Vec::with_capacity(GROUP_ROWS),
            cells: Vec::with_capacity(GROUP_ROWS * columns),
        }
    }

    pub(crate) fn push(&mut self, tick: Tick, time: SimTime, row: &[Cell]) {
        self.ticks.push(tick.0);
        self.nanos.push(time.nanos());
        self.cells.extend_from_slice(row);
    }

    pub(crate) fn rows(&self) -> usize {
        self.ticks.len()
    }

    pub(crate) fn clear(&mut self) {
        self.ticks.clear();
        self.nanos.clear();
        self.cells.clear();
    }
}

pub(crate) struct Table<W: Write + Send> {
    writer: SerializedFileWriter<W>,
    kinds: Vec<ColumnKind>,
    floats: Vec<f64>,
    integers: Vec<i64>,
    bools: Vec<bool>,
}

fn field(name: &str, kind: ColumnKind) -> Result<Arc<Type>, ParquetError> {
    let physical = match kind {
        ColumnKind::F64 => PhysicalType::DOUBLE,
        ColumnKind::U64 => PhysicalType::INT64,
        ColumnKind::Bool => PhysicalType::BOOLEAN,
    };
    let logical = (kind == ColumnKind::U64)
        .then_some(LogicalType::Integer { bit_width: 64, is_signed: false });
    let t = Type::primitive_type_builder(name, physical)
        .with_repetition(Repetition::REQUIRED)
        .with_logical_type(logical)
        .build()?;
    Ok(Arc::new(t))
}

impl<W: Write + Send> Table<W> {
    pub(crate) fn create(
        out: W,
        columns: &[Column],
        metadata: &BTreeMap<String, String>,
    ) -> Result<Self, ParquetError> {
        let own = OWN_COLUMNS.into_iter().zip([ColumnKind::U64, ColumnKind::F64]);
        let named = columns.iter().map(|c| (c.name.as_str(), c.kind));
        let fields = own.chain(named);

        let mut notes: Vec<_> =
            metadata.iter().map(|(k, v)| KeyValue::new(k.clone(), v.clone())).collect();
        notes.push(KeyValue::new(SCHEMA_KEY.into(), RECORD_SCHEMA.to_string()));
        let mut props = WriterProperties::builder()
            .set_compression(Compression::ZSTD(ZstdLevel::try_new(1)?))
            .set_dictionary_enabled(false)
            // Nobody reads them, and a writer keeps them to the end of the run.
            .set_statistics_enabled(EnabledStatistics::None)
            .set_offset_index_disabled(true)
            .set_key_value_metadata(Some(notes))
            .set_created_by(concat!("docktwin ", env!("CARGO_PKG_VERSION")).into());
        let mut schema = Vec::new();
        for (name, kind) in fields {
            // Like bytes of like weight stand together: signs and exponents shrink well.
            if kind == ColumnKind::F64 {
                let path = ColumnPath::from(name);
                props = props.set_column_encoding(path, Encoding::BYTE_STREAM_SPLIT);
            }
            schema.push(field(name, kind)?);
        }
        let schema = Type::group_type_builder("docktwin").with_fields(schema).build()?;
        Ok(Self {
            writer: SerializedFileWriter::new(out, Arc::new(schema), Arc::new(props.build()))?,
            kinds: columns.iter().map(|c| c.kind).collect(),
            floats: Vec::new(),
            integers: Vec::new(),
            bools: Vec::new(),
        })
    }

    /// Writes the rows as one row group.
    pub(crate) fn write(&mut self, block: &Block) -> Result<(), ParquetError> {
        if block.rows() == 0 {
            return Ok(());
        }
        let width = self.kinds.len();
        let own = [ColumnKind::U64, ColumnKind::F64];
        let mut group = self.writer.next_row_group()?;
        let mut index = 0;
        while let Some(mut column) = group.next_column()? {
            let kind = if index < own.len() { own[index] } else { self.kinds[index - own.len()] };
            let cells = || block.cells.iter().skip(index - own.len()).step_by(width);
            match kind {
                ColumnKind::F64 => {
                    self.floats.clear();
                    if index == 1 {
                        let seconds = |&n| SimTime::from_nanos(n).seconds();
                        self.floats.extend(block.nanos.iter().map(seconds));
                    } else {
                        self.floats.extend(cells().map(|c| c.as_f64()));
                    }
                    column.typed::<DoubleType>().write_batch(&self.floats, None, None)?;
                }
                ColumnKind::U64 => {
                    // Parquet stores unsigned integers in the bits of signed ones.
                    self.integers.clear();
                    if index == 0 {
                        self.integers.extend(block.ticks.iter().map(|t| t.cast_signed()));
                    } else {
                        self.integers.extend(cells().map(|c| c.as_u64().cast_signed()));
                    }
                    column.typed::<Int64Type>().write_batch(&self.integers, None, None)?;
                }
                ColumnKind::Bool => {
                    self.bools.clear();
                    self.bools.extend(cells().map(|c| c.as_bool()));
                    column.typed::<BoolType>().write_batch(&self.bools, None, None)?;
                }
            }
            column.close()?;
            index += 1;
        }
        group.close().map(|_| ())
    }

    /// Writes the footer, without which no Parquet file can be read.
    pub(crate) fn finish(mut self) -> Result<(), ParquetError> {
        self.writer.finish()?;
        self.writer.flush()?;
        Ok(())
    }
}
