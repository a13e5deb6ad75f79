//! Whether `telemetry.parquet` has the rows of the log.

use std::fs::File;
use std::io;
use std::path::Path;

use parquet::column::reader::ColumnReader;
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader as _, RowGroupReader, SerializedFileReader};

use crate::column::{Cell, ColumnKind};
use crate::{RecordError, RunReader};

/// What was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TableState {
    Missing,
    /// With what its end says of its rows.
    Unreadable {
        rows: Option<u64>,
    },
    /// More rows than the log has.
    Longer {
        rows: u64,
    },
    Shorter {
        rows: u64,
    },
    /// First in this tick.
    Differs {
        tick: u64,
    },
    Same,
}

/// Holds the table against all ticks of the log.
pub(crate) fn inspect(path: &Path, r: &mut RunReader) -> Result<TableState, RecordError> {
    let file = match File::open(path) {
        Ok(file) => file,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(TableState::Missing),
        Err(e) => return Err(RecordError::io("open the table", path, &e)),
    };
    let Ok(reader) = SerializedFileReader::new(file) else {
        return Ok(TableState::Unreadable { rows: None });
    };
    let rows = u64::try_from(reader.metadata().file_metadata().num_rows()).ok();
    let unreadable = TableState::Unreadable { rows };
    r.rewind()?;
    let mut compared = 0;
    for i in 0..reader.num_row_groups() {
        let group = reader.get_row_group(i).and_then(|g| columns_of(&*g, r));
        let Ok((n, columns)) = group else { return Ok(unreadable) };
        for k in 0..n {
            let Some(t) = r.next_tick()? else {
                return Ok(rows.map_or(unreadable, |rows| TableState::Longer { rows }));
            };
            let own = [Cell::from(t.tick.0), Cell::from(t.time.seconds())];
            let mut cells = own.iter().chain(&t.row).zip(&columns);
            if cells.any(|(cell, column)| column.get(k) != Some(cell)) {
                let longer = rows.filter(|n| *n > r.count_all().unwrap_or(u64::MAX));
                return Ok(match longer {
                    Some(rows) => TableState::Longer { rows },
                    None => TableState::Differs { tick: t.tick.0 },
                });
            }
            compared += 1;
        }
    }
    Ok(if r.next_tick()?.is_some() {
        TableState::Shorter { rows: compared }
    } else {
        TableState::Same
    })
}

/// All cells of a row group, by column; tick and time first.
fn columns_of(
    group: &dyn RowGroupReader,
    r: &RunReader,
) -> Result<(usize, Vec<Vec<Cell>>), ParquetError> {
    let n = usize::try_from(group.metadata().num_rows())?;
    let own = [ColumnKind::U64, ColumnKind::F64].into_iter();
    let kinds: Vec<ColumnKind> = own.chain(r.columns().iter().map(|c| c.kind)).collect();
    if group.num_columns() != kinds.len() {
        return Err(ParquetError::General("other columns".into()));
    }
    let columns = kinds.iter().enumerate().map(|(i, kind)| {
        let cells: Vec<Cell> = match (group.get_column_reader(i)?, kind) {
            (ColumnReader::DoubleColumnReader(mut c), ColumnKind::F64) => {
                let mut values = Vec::new();
                c.read_records(n, None, None, &mut values)?;
                values.into_iter().map(Cell::from).collect()
            }
            (ColumnReader::Int64ColumnReader(mut c), ColumnKind::U64) => {
                let mut values: Vec<i64> = Vec::new();
                c.read_records(n, None, None, &mut values)?;
                values.into_iter().map(|x| Cell::from(x.cast_unsigned())).collect()
            }
            (ColumnReader::BoolColumnReader(mut c), ColumnKind::Bool) => {
                let mut values: Vec<bool> = Vec::new();
                c.read_records(n, None, None, &mut values)?;
                values.into_iter().map(Cell::from).collect()
            }
            _ => return Err(ParquetError::General("a column of another type".into())),
        };
        Ok(cells)
    });
    Ok((n, columns.collect::<Result<_, ParquetError>>()?))
}
