//! `analyze`: what a design does, without a docking: the mechanism on a test bench, and the maps and
//! responses of a rig.

mod bode;
mod frequency;
pub(crate) mod mechanism;
pub(crate) mod plots;
mod rig;
mod stiffness;
mod workspace;

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use docktwin_plot::PlotError;
use docktwin_study::Progress;
use serde::Serialize;

use crate::{cli::AnalyzeCommand, failure::Failure, observers::progress};

/// Runs the command.
pub(crate) fn run(command: &AnalyzeCommand, json: bool) -> Result<ExitCode, Failure> {
    match command {
        AnalyzeCommand::Mechanism(args) => mechanism::run(args, json),
        AnalyzeCommand::Workspace(args) => workspace::run(args, json),
        AnalyzeCommand::Frequency(args) => frequency::run(args, json),
        AnalyzeCommand::Bode(args) => bode::run(args, json),
        AnalyzeCommand::Stiffness(args) => stiffness::run(args, json),
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
        let directory = directory
            .map_or_else(|| crate::commands::new_directory("analysis", name), Path::to_owned);
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
    fn file(&mut self, name: &str) -> PathBuf {
        self.files.push(name.to_owned());
        self.directory.join(name)
    }

    pub(crate) fn save(&mut self, name: String, text: &str) -> Result<(), Failure> {
        let path = self.directory.join(&name);
        std::fs::write(&path, text).map_err(|e| unwritable(&path, &e))?;
        self.files.push(name);
        Ok(())
    }

    /// Saves plots with their file names.
    pub(crate) fn plots(
        &mut self,
        drawn: Result<Vec<(String, String)>, PlotError>,
    ) -> Result<(), Failure> {
        let drawn = drawn.map_err(|e| Failure::Usage {
            what: format!("a plot could not be drawn: {e}"),
            remedy: "check the sizes and stiffnesses in the file; the CSV files are written"
                .to_owned(),
        })?;
        drawn.into_iter().try_for_each(|(name, svg)| self.save(name, &svg))
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
struct Bars {
    json: bool,
    bar: Option<indicatif::ProgressBar>,
}

impl Bars {
    const fn new(json: bool) -> Self {
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

/// A number with three digits and its unit, in the unit's usual multiple.
fn say(x: f64, unit: &str) -> String {
    let digits = |v: f64| match v.abs() {
        a if a >= 99.95 => format!("{v:.0}"),
        a if a >= 9.995 => format!("{v:.1}"),
        a if a >= 0.9995 => format!("{v:.2}"),
        _ => format!("{v:.3}"),
    };
    match unit {
        "m" => format!("{} mm", digits(x * 1e3)),
        "rad" => format!("{} deg", digits(x.to_degrees())),
        _ if x.abs() >= 1e4 => format!("{x:.2e} {unit}"),
        _ if x.abs() < 5e-4 => format!("0 {unit}"),
        _ => format!("{} {unit}", digits(x)),
    }
}

#[cfg(test)]
mod tests {
    use super::say;

    #[test]
    fn oracle_numbers_are_told_with_three_digits() {
        assert_eq!(say(0.1234, "m"), "123 mm");
        assert_eq!(say(-0.000_95, "m"), "-0.950 mm");
        assert_eq!(say(0.174_532_9, "rad"), "10.0 deg");
        assert_eq!(say(3e5, "N/m"), "3.00e5 N/m");
        assert_eq!(say(1e-7, "N"), "0 N");
        assert_eq!(say(800.04, "N/m"), "800 N/m");
    }
}
