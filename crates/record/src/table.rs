//! `telemetry.parquet`: a row a tick, written in row groups as the run goes.

use std::collections::BTreeMap;
use std::io::Write;
use std::sync::Arc;

use parquet::basic::{
    Compression, Encoding, LogicalType, Repetition, Type as PhysicalType, ZstdLevel,
};
use parquet::data_type::{BoolType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::{
    FileMetaData, KeyValue, ParquetMetaData, ParquetMetaDataWriter, RowGroupMetaData,
};
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterPropertiesPtr};
use parquet::file::writer::{SerializedRowGroupWriter, TrackedWrite};
use parquet::schema::types::{ColumnPath, SchemaDescPtr, SchemaDescriptor, Type};

use crate::RECORD_SCHEMA;
use crate::column::{Cell, Column, ColumnKind, OWN_COLUMNS};
use crate::keys::SCHEMA_KEY;
use docktwin_core::{SimTime, Tick};

/// Begin and end of a Parquet file.
const MAGIC: [u8; 4] = *b"PAR1";

/// Rows of a row group: 8 s of 1 ms ticks.
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

/// What the footer has to know of a row group beyond what all have in common, as small as it can be: all
/// groups are kept to the end of the run. The writer of the library keeps half a kilobyte a column.
struct GroupNote {
    offset: i64,
    rows: i64,
    /// Bytes of every column, compressed and not.
    columns: Box<[(u32, u32)]>,
}

pub(crate) struct Table<W: Write + Send> {
    out: TrackedWrite<W>,
    schema: SchemaDescPtr,
    props: WriterPropertiesPtr,
    /// The first group, which all others resemble.
    first: Option<RowGroupMetaData>,
    groups: Vec<GroupNote>,
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
            // Nobody reads them.
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
        let mut out = TrackedWrite::new(out);
        out.write_all(&MAGIC)?;
        Ok(Self {
            out,
            schema: Arc::new(SchemaDescriptor::new(Arc::new(schema))),
            props: Arc::new(props.build()),
            first: None,
            groups: Vec::new(),
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
        let ordinal = i16::try_from(self.groups.len())
            .map_err(|_| ParquetError::General("more row groups than Parquet can number".into()))?;
        let (schema, props) = (Arc::clone(&self.schema), Arc::clone(&self.props));
        let mut group = SerializedRowGroupWriter::new(schema, props, &mut self.out, ordinal, None);
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
        let group = group.close()?;
        self.groups.push(GroupNote::of(&group)?);
        self.first.get_or_insert_with(|| (*group).clone());
        Ok(())
    }

    /// Writes the footer, without which no Parquet file can be read.
    pub(crate) fn finish(mut self) -> Result<(), ParquetError> {
        let mut groups = Vec::with_capacity(self.groups.len());
        if let Some(first) = &self.first {
            for (ordinal, note) in (0..).zip(&self.groups) {
                groups.push(note.group(first, ordinal)?);
            }
        }
        let file = FileMetaData::new(
            self.props.writer_version().as_num(),
            self.groups.iter().map(|g| g.rows).sum(),
            Some(self.props.created_by().to_owned()),
            self.props.key_value_metadata().cloned(),
            Arc::clone(&self.schema),
            None,
        );
        let footer = ParquetMetaData::new(file, groups);
        // Not straight into the file: what is left in the library's buffer would be lost without a word.
        let mut bytes = Vec::new();
        ParquetMetaDataWriter::new(&mut bytes, &footer).finish()?;
        self.out.write_all(&bytes)?;
        self.out.flush()?;
        Ok(())
    }
}

impl GroupNote {
    fn of(group: &RowGroupMetaData) -> Result<Self, ParquetError> {
        let size = |bytes: i64| {
            u32::try_from(bytes)
                .map_err(|_| ParquetError::General("a row group above 4 GiB".into()))
        };
        let columns = group.columns().iter();
        let columns =
            columns.map(|c| Ok((size(c.compressed_size())?, size(c.uncompressed_size())?)));
        Ok(Self {
            // Without dictionaries a column begins with its first page, right behind the one before.
            offset: group.columns().first().map_or(0, |c| c.data_page_offset()),
            rows: group.num_rows(),
            columns: columns.collect::<Result<_, ParquetError>>()?,
        })
    }

    /// The group in the words of the footer.
    fn group(
        &self,
        like: &RowGroupMetaData,
        ordinal: i16,
    ) -> Result<RowGroupMetaData, ParquetError> {
        let mut offset = self.offset;
        let mut columns = Vec::with_capacity(self.columns.len());
        for (c, &(compressed, uncompressed)) in like.columns().iter().zip(&self.columns) {
            let column = c
                .clone()
                .into_builder()
                .set_num_values(self.rows)
                .set_total_compressed_size(compressed.into())
                .set_total_uncompressed_size(uncompressed.into())
                .set_data_page_offset(offset)
                // Tells numbers of pages, which differ.
                .clear_page_encoding_stats();
            columns.push(column.build()?);
            offset += i64::from(compressed);
        }
        let bytes = self.columns.iter().map(|&(_, b)| i64::from(b)).sum();
        like.clone()
            .into_builder()
            .set_num_rows(self.rows)
            .set_total_byte_size(bytes)
            .set_file_offset(self.offset)
            .set_ordinal(ordinal)
            .set_column_metadata(columns)
            .build()
    }
}
