use std::path::PathBuf;

/// Why a recording could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// The file could not be made.
    #[error(
        "cannot create the viewer recording: {source}; choose a directory that exists and can be \
         written, path: {path}"
    )]
    Create {
        /// The file.
        path: PathBuf,
        /// What rerun said.
        #[source]
        source: Box<re_log_encoding::FileSinkError>,
    },
    /// The file could not be written to its end: most often the disk is full.
    #[error(
        "cannot write the viewer recording: {message}; free some space on its disk, path: {path}"
    )]
    Write {
        /// The file.
        path: PathBuf,
        /// What rerun said.
        message: String,
    },
    /// No viewer takes a live stream.
    #[error(
        "no viewer answers at {url}: {message}; start one first: rerun --bind 127.0.0.1 (version \
         {}), or name another address: rerun+http://HOST:PORT/proxy",
        crate::VIEWER_VERSION
    )]
    NoViewer {
        /// Address.
        url: String,
        /// What rerun said.
        message: String,
    },
    /// This build cannot speak to a viewer: it was made without the cargo feature `live`.
    #[error(
        "cannot show the run at {url}: this docktwin was built with --no-default-features, without \
         the live view; build it with the live view: cargo build --release --features live, or run \
         without --live and look at run.rrd afterwards"
    )]
    WithoutLive {
        /// Address that was asked for.
        url: String,
    },
    /// A frame or event that cannot be drawn; nothing of it was written, the recording goes on.
    #[error("frame at {time_s} s is not recorded: {}", problems.join("; "))]
    Frame {
        /// Simulated time, s.
        time_s: f64,
        /// Each problem with place, value, unit and allowed range.
        problems: Vec<String>,
    },
    /// The data did not fit rerun's format.
    #[error("cannot encode `{entity}` for the viewer: {message}")]
    Encode {
        /// Entity path in the recording.
        entity: String,
        /// What rerun said.
        message: String,
    },
}

impl ViewError {
    pub(crate) fn encode(entity: &str, e: impl core::fmt::Display) -> Self {
        Self::Encode { entity: entity.to_owned(), message: e.to_string() }
    }
}
