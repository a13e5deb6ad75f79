//! Tables that another program made of a run.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::record::Field;

use crate::RecordError;

/// Columns of a Parquet file by name, every value as a number: integers up to 2⁵³ exactly, yes and no
/// as 1 and 0, an absent value as NaN. Uncompressed or Zstandard.
///
/// # Errors
/// A file that cannot be read, or a column that holds something else than numbers.
pub fn read_table(path: impl AsRef<Path>) -> Result<BTreeMap<String, Vec<f64>>, RecordError> {
    let path = path.as_ref();
    let file = File::open(path).map_err(|e| RecordError::io("open the table", path, &e))?;
    let bad = |e| RecordError::parquet("read the table", path, e);
    let reader = SerializedFileReader::new(file).map_err(bad)?;
    let fields = reader.metadata().file_metadata().schema().get_fields();
    let names: Vec<String> = fields.iter().map(|f| f.name().to_owned()).collect();
    let mut values = vec![Vec::new(); names.len()];
    for row in reader.get_row_iter(None).map_err(bad)? {
        let row = row.map_err(bad)?;
        for ((name, field), out) in row.get_column_iter().zip(&mut values) {
            #[expect(clippy::cast_precision_loss, reason = "counts below 2^53, as documented")]
            out.push(match *field {
                Field::Null => f64::NAN,
                Field::Bool(x) => f64::from(u8::from(x)),
                Field::Int(x) => f64::from(x),
                Field::UInt(x) => f64::from(x),
                Field::Long(x) => x as f64,
                Field::ULong(x) => x as f64,
                Field::Float(x) => f64::from(x),
                Field::Double(x) => x,
                _ => {
                    return Err(RecordError::NotARecording {
                        why: format!("the column `{name}` holds no numbers"),
                        path: path.into(),
                    });
                }
            });
        }
    }
    Ok(names.into_iter().zip(values).collect())
}
