//! A run in memory, as columns.

use std::sync::Arc;

use arrow_array::{
    ArrayRef, RecordBatch,
    builder::{ArrayBuilder, BooleanBuilder, Float64Builder, UInt16Builder, UInt64Builder},
};
use arrow_schema::{ArrowError, DataType, Field, Schema, SchemaRef};
use docktwin_record::{Cell, ColumnKind, Event, Summary};

use super::{Header, Sink, TickView};
use crate::error::SinkError;

/// Rows of one batch: half a megabyte a column at most.
const BATCH_ROWS: usize = 1 << 16;

/// Columns that grow row by row and come out as record batches.
struct Table {
    schema: SchemaRef,
    builders: Vec<Builder>,
    rows: usize,
    batches: Vec<RecordBatch>,
}

enum Builder {
    F64(Float64Builder),
    U64(UInt64Builder),
    U16(UInt16Builder),
    Bool(BooleanBuilder),
}

impl Builder {
    fn new(kind: &DataType) -> Self {
        match kind {
            DataType::UInt64 => Self::U64(UInt64Builder::new()),
            DataType::UInt16 => Self::U16(UInt16Builder::new()),
            DataType::Boolean => Self::Bool(BooleanBuilder::new()),
            _ => Self::F64(Float64Builder::new()),
        }
    }

    fn push(&mut self, cell: Cell) {
        match self {
            Self::F64(b) => b.append_value(cell.as_f64()),
            Self::U64(b) => b.append_value(cell.as_u64()),
            Self::U16(b) => b.append_value(u16::try_from(cell.as_u64()).unwrap_or(u16::MAX)),
            Self::Bool(b) => b.append_value(cell.as_u64() != 0),
        }
    }

    fn finish(&mut self) -> ArrayRef {
        match self {
            Self::F64(b) => ArrayBuilder::finish(b),
            Self::U64(b) => ArrayBuilder::finish(b),
            Self::U16(b) => ArrayBuilder::finish(b),
            Self::Bool(b) => ArrayBuilder::finish(b),
        }
    }
}

impl Table {
    fn new(fields: Vec<Field>) -> Self {
        let builders = fields.iter().map(|f| Builder::new(f.data_type())).collect();
        let schema = Arc::new(Schema::new(fields));
        Self { schema, builders, rows: 0, batches: Vec::new() }
    }

    fn push(&mut self, cells: impl IntoIterator<Item = Cell>) -> Result<(), ArrowError> {
        for (builder, cell) in self.builders.iter_mut().zip(cells) {
            builder.push(cell);
        }
        self.rows += 1;
        if self.rows == BATCH_ROWS { self.close_batch() } else { Ok(()) }
    }

    fn close_batch(&mut self) -> Result<(), ArrowError> {
        if self.rows > 0 {
            let columns = self.builders.iter_mut().map(Builder::finish).collect();
            self.batches.push(RecordBatch::try_new(Arc::clone(&self.schema), columns)?);
            self.rows = 0;
        }
        Ok(())
    }
}

/// The signals of a run as arrow record batches of one schema; a unit is in every column's name.
#[derive(Clone, Debug)]
pub struct Signals {
    /// `tick`, `time_s`, then the columns of a run directory's `telemetry.parquet`.
    pub schema: SchemaRef,
    /// In the order of time.
    pub batches: Vec<RecordBatch>,
}

impl Signals {
    /// Number of ticks.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.batches.iter().map(RecordBatch::num_rows).sum()
    }
}

/// Keeps signals, places of contact and events in memory.
#[derive(Default)]
pub struct Memory {
    signals: Option<Table>,
    contacts: Option<Table>,
    events: Vec<Event>,
}

impl Memory {
    /// Empty.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The signals, one row a tick. Empty before a run has ended.
    #[must_use]
    pub fn signals(&self) -> Signals {
        of(self.signals.as_ref())
    }

    /// Places of contact, one row each: `tick`, `pair`, point, normal, depth, normal force and friction
    /// on the passive side, world axes.
    #[must_use]
    pub fn contacts(&self) -> Signals {
        of(self.contacts.as_ref())
    }

    /// What happened.
    #[must_use]
    pub fn events(&self) -> &[Event] {
        &self.events
    }
}

fn of(table: Option<&Table>) -> Signals {
    table.map_or_else(
        || Signals { schema: Arc::new(Schema::empty()), batches: Vec::new() },
        |t| Signals { schema: Arc::clone(&t.schema), batches: t.batches.clone() },
    )
}

/// Columns of the places of contact after `tick` and `pair`.
const CONTACT: [&str; 11] = [
    "point_x_m",
    "point_y_m",
    "point_z_m",
    "normal_x",
    "normal_y",
    "normal_z",
    "depth_m",
    "normal_force_n",
    "friction_x_n",
    "friction_y_n",
    "friction_z_n",
];

impl Sink for Memory {
    fn begin(&mut self, h: &Header<'_>) -> Result<(), SinkError> {
        let of = |name: &str, kind: DataType| Field::new(name, kind, false);
        let mut fields = vec![of("tick", DataType::UInt64), of("time_s", DataType::Float64)];
        fields.extend(h.columns.iter().map(|c| {
            of(
                &c.name,
                match c.kind {
                    ColumnKind::U64 => DataType::UInt64,
                    ColumnKind::Bool => DataType::Boolean,
                    ColumnKind::F64 => DataType::Float64,
                },
            )
        }));
        self.signals = Some(Table::new(fields));
        let mut fields = vec![of("tick", DataType::UInt64), of("pair", DataType::UInt16)];
        fields.extend(CONTACT.map(|name| of(name, DataType::Float64)));
        self.contacts = Some(Table::new(fields));
        self.events.clear();
        Ok(())
    }

    fn event(&mut self, event: &Event) -> Result<(), SinkError> {
        self.events.push(event.clone());
        Ok(())
    }

    fn tick(&mut self, t: &TickView<'_>) -> Result<(), SinkError> {
        let tick = Cell::from(t.tick.0);
        if let Some(table) = &mut self.signals {
            let time = Cell::from(t.time.seconds());
            table.push([tick, time].into_iter().chain(t.row.iter().copied()))?;
        }
        if let Some(table) = &mut self.contacts {
            for c in t.contacts {
                let vectors = [c.point_w_m, c.normal_w].into_iter().flat_map(|v| v.to_array());
                let numbers = vectors
                    .chain([c.depth_m, c.normal_force_n])
                    .chain(c.friction_w_n.to_array())
                    .map(Cell::from);
                table.push([tick, Cell::from(u64::from(c.pair))].into_iter().chain(numbers))?;
            }
        }
        Ok(())
    }

    fn finish(&mut self, _summary: &mut Summary) -> Result<(), SinkError> {
        for table in [&mut self.signals, &mut self.contacts].into_iter().flatten() {
            table.close_batch()?;
        }
        Ok(())
    }
}
