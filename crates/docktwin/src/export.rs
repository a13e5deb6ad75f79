//! `export`: a recording for other programs.

use std::{
    fs::File,
    io::{BufWriter, ErrorKind, Write},
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::{Args, ValueEnum};
use docktwin_record::{
    Cut, Exported, RecordError, RunReader, Selection, WRITE_EXPORT, export_csv, export_mat,
};
use serde_json::json;

use crate::failure::{Failure, OTHERWISE};

pub(crate) const EXAMPLES: &str = "\
CSV: a line a tick, names with units in the first line, numbers that come back with their bits; with
--contacts a second file, a line a contact point. MAT: a level 5 file that MATLAB, Octave and
scipy.io.loadmat read, a variable a column. A cut recording is exported up to the cut.

Examples:
  docktwin export runs/wide --format csv
  docktwin export runs/wide --format csv --columns 'relative_*' /loads --every 10 --out short.csv
  docktwin export runs/wide --format csv --out - | head
  docktwin export runs/wide --format mat --contacts --out wide.mat";

/// Options of `export`.
#[derive(Debug, Args)]
pub(crate) struct ExportArgs {
    /// Run directory
    run: PathBuf,
    /// Form of the file
    #[arg(long, value_enum)]
    format: Format,
    /// File to write, `-` for standard output (csv); one that exists is not overwritten [default:
    /// telemetry.csv or telemetry.mat in the run directory]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Only columns, or topics, of these names, with * ? [...] in them
    #[arg(long, value_name = "PATTERN", num_args = 1..)]
    columns: Vec<String>,
    /// Only every N-th tick; contacts are never left out
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    every: u64,
    /// Contacts too: a second file NAME_contacts.csv, or variables contacts_... of the MAT file
    #[arg(long)]
    contacts: bool,
}

/// Form of an export.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Comma-separated values
    Csv,
    /// MATLAB, level 5
    Mat,
}

impl Format {
    const fn extension(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Mat => "mat",
        }
    }
}

/// Runs the command.
pub(crate) fn run(args: &ExportArgs, json: bool) -> Result<ExitCode, Failure> {
    let mut reader = RunReader::open(&args.run)?;
    let selection = Selection { columns: args.columns.clone(), every: args.every };
    let out = args
        .out
        .clone()
        .unwrap_or_else(|| args.run.join(format!("telemetry.{}", args.format.extension())));
    if out == Path::new("-") {
        if args.format == Format::Mat || args.contacts || json {
            return Err(Failure::Usage {
                what: "only one CSV fits on standard output".to_owned(),
                remedy: "name a file with --out, or leave out --contacts and --json".to_owned(),
            });
        }
        match export_csv(&mut reader, &selection, std::io::stdout().lock(), None, &out) {
            Ok(done) => {
                note(&reader, &done);
                return Ok(exit(&done));
            }
            // `export --out - | head`: the reader has what it wants.
            Err(RecordError::Io { kind: ErrorKind::BrokenPipe, .. }) => {}
            // The log was read: it is the output that is lost.
            Err(RecordError::Io { action: WRITE_EXPORT, reason, .. }) => {
                eprintln!("standard output could not be written: {reason}");
                return Ok(ExitCode::from(OTHERWISE));
            }
            Err(e) => return Err(e.into()),
        }
        return Ok(ExitCode::SUCCESS);
    }
    let points = (args.contacts && args.format == Format::Csv).then(|| {
        let stem = out.file_stem().unwrap_or_default().to_string_lossy();
        out.with_file_name(format!("{stem}_contacts.csv"))
    });
    let mut table = NewFile::create(&out)?;
    let mut second = points.as_deref().map(NewFile::create).transpose()?;
    let done = match args.format {
        Format::Csv => {
            let second = second.as_mut().map(|f| &mut f.file as &mut dyn Write);
            export_csv(&mut reader, &selection, &mut table.file, second, &out)?
        }
        Format::Mat => export_mat(&mut reader, &selection, &mut table.file, args.contacts, &out)?,
    };
    table.keep()?;
    second.map_or(Ok(()), NewFile::keep)?;
    let files: Vec<String> =
        core::iter::once(&out).chain(&points).map(|p| p.display().to_string()).collect();
    if json {
        let cut = done.cut.as_ref().map(ToString::to_string);
        println!(
            "{}",
            json!({
                "files": files, "rows": done.rows, "columns": done.columns,
                "contacts": args.contacts.then_some(done.contacts), "cut": cut,
                "recovered": reader.recovered(),
            })
        );
    } else {
        note(&reader, &done);
        println!("{} rows of {} columns beside tick and time", done.rows, done.columns);
        if args.contacts {
            println!("{} contact points", done.contacts);
        }
        files.iter().for_each(|f| println!("  written to     {f}"));
    }
    Ok(exit(&done))
}

/// 1 when what was exported is not all of what was recorded, for another reason than a run that died.
fn exit(done: &Exported) -> ExitCode {
    let right = done.cut.as_ref().is_none_or(Cut::merely_ends);
    ExitCode::from(if right { 0 } else { OTHERWISE })
}

/// Says where a recording ends before its run.
fn note(reader: &RunReader, done: &Exported) {
    if let Some(cut) = &done.cut {
        eprintln!("the recording is cut or damaged: {cut}");
    } else if let Some(why) = reader.recovered() {
        eprintln!("the recording was recovered: {why}");
    }
}

/// A file that gets its name when it is whole, and does not replace another.
struct NewFile {
    path: PathBuf,
    part: PathBuf,
    file: BufWriter<File>,
    kept: bool,
}

impl NewFile {
    fn create(path: &Path) -> Result<Self, Failure> {
        if path.exists() {
            return Err(Failure::Usage {
                what: format!("the file to be written exists already: {}", path.display()),
                remedy: "name another with --out, or remove it first".to_owned(),
            });
        }
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let part = path.with_file_name(format!(".{name}.part"));
        let file =
            File::create(&part).map_err(|e| RecordError::of_file("create the export", path, &e))?;
        Ok(Self { path: path.to_owned(), part, file: BufWriter::new(file), kept: false })
    }

    fn keep(mut self) -> Result<(), Failure> {
        let done = self.file.flush().and_then(|()| std::fs::rename(&self.part, &self.path));
        done.map_err(|e| RecordError::of_file("write the export", &self.path, &e))?;
        self.kept = true;
        Ok(())
    }
}

impl Drop for NewFile {
    fn drop(&mut self) {
        if !self.kept {
            // Half a file serves nobody; there is nobody to tell if it stays.
            let _ = std::fs::remove_file(&self.part);
        }
    }
}
