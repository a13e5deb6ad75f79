//! Where results go: directories named after what is in them and the time.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use docktwin_report::study::{NamedText, PlotError};
use docktwin_study::Progress;
use serde::Serialize;

use crate::{failure::Failure, observers::progress};

/// The present instant as names of files have it.
pub(crate) fn timestamp() -> String {
    jiff::Timestamp::now().strftime("%Y%m%dT%H%M%SZ").to_string()
}

/// The directory that was asked for, or a new one under `parent`, named after what goes there and the
/// time. A new one is made at once, so that of several processes in one second each has its own.
pub(crate) fn directory(
    asked: Option<&Path>,
    parent: &str,
    name: &str,
) -> Result<PathBuf, Failure> {
    if let Some(asked) = asked {
        return Ok(asked.to_owned());
    }
    let parent = Path::new(parent);
    std::fs::create_dir_all(parent).map_err(|e| unwritable(parent, &e))?;
    let stem = format!("{name}-{}", timestamp());
    let mut n = 1;
    loop {
        let named = if n == 1 { stem.clone() } else { format!("{stem}-{n}") };
        let directory = parent.join(named);
        match std::fs::create_dir(&directory) {
            Ok(()) => return Ok(directory),
            Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => n += 1,
            Err(e) => return Err(unwritable(&directory, &e)),
        }
    }
}

/// The directory of an analysis and what was written into it.
pub(crate) struct Results {
    directory: PathBuf,
    files: Vec<String>,
}

impl Results {
    /// Makes the directory, which must be new or empty: results are never overwritten. Without one it
    /// is named after what is analysed, and the time.
    pub(crate) fn new(directory: Option<&Path>, name: &str) -> Result<Self, Failure> {
        let directory = self::directory(directory, "analysis", name)?;
        if std::fs::read_dir(&directory).is_ok_and(|mut d| d.next().is_some()) {
            return Err(Failure::Usage {
                what: format!("{} is not empty", directory.display()),
                remedy: "give a new directory with --out DIR".to_owned(),
            });
        }
        std::fs::create_dir_all(&directory).map_err(|e| unwritable(&directory, &e))?;
        Ok(Self { directory, files: Vec::new() })
    }

    /// Where a file goes that somebody else writes.
    pub(crate) fn file(&mut self, name: &str) -> PathBuf {
        self.files.push(name.to_owned());
        self.directory.join(name)
    }

    /// Saves texts under their names.
    pub(crate) fn tables(&mut self, all: Vec<NamedText>) -> Result<(), Failure> {
        all.into_iter().try_for_each(|(name, text)| self.save(name, &text))
    }

    fn save(&mut self, name: String, text: &str) -> Result<(), Failure> {
        let path = self.directory.join(&name);
        std::fs::write(&path, text).map_err(|e| unwritable(&path, &e))?;
        self.files.push(name);
        Ok(())
    }

    /// Saves plots with their file names.
    pub(crate) fn plots(
        &mut self,
        drawn: Result<Vec<NamedText>, PlotError>,
    ) -> Result<(), Failure> {
        let drawn = drawn.map_err(|e| Failure::Usage {
            what: format!("a plot could not be drawn: {e}"),
            remedy: "check the sizes and stiffnesses in the file; the CSV files are written"
                .to_owned(),
        })?;
        self.tables(drawn)
    }

    /// Saves the answer as JSON, and prints it, for a script or in words.
    pub(crate) fn finish(
        mut self,
        name: &str,
        answer: &impl Serialize,
        words: &str,
        json: bool,
    ) -> Result<ExitCode, Failure> {
        // A result always serialises.
        let answer = serde_json::to_value(answer).unwrap_or_default();
        let text = serde_json::to_string_pretty(&answer).unwrap_or_default();
        self.save(format!("{name}.json"), &text)?;
        if json {
            println!("{answer}");
        } else {
            // Line by line: what is printed is cleared of control characters.
            words.lines().for_each(|l| println!("{l}"));
            println!("written        {} ({})", self.directory.display(), self.files.join(", "));
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// A bar on stderr, a new one for every stage.
pub(crate) struct Bars {
    json: bool,
    bar: Option<indicatif::ProgressBar>,
}

impl Bars {
    pub(crate) const fn new(json: bool) -> Self {
        Self { json, bar: None }
    }
}

impl Progress for Bars {
    fn at(&mut self, done: u64, of: u64) {
        self.bar.get_or_insert_with(|| progress(of, self.json)).set_position(done);
    }

    fn done(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
    }
}

fn unwritable(path: &Path, e: &std::io::Error) -> Failure {
    Failure::Usage {
        what: format!("{} cannot be written ({e})", path.display()),
        remedy: "give a directory that can be written with --out DIR".to_owned(),
    }
}
