//! From a docking to what the viewer shows: while it happens in a file ([`ViewerFile`]) or in an open
//! viewer ([`LiveViewer`]), and afterwards from its recording ([`Recording`]). The same code draws all of
//! them ([`Playback`]), so that `run.rrd` can be made from `run.mcap` again and is the same.
//!
//! ```
//! use docktwin_playback::{Recording, ViewerFile, save_one};
//! use docktwin_run::{Rehearsal, RunDirectory};
//! use docktwin_scenario::Scenario;
//! # let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
//! # let path = root.join("scenarios/basic_central_impact.toml");
//! # let folder = tempfile::tempdir()?;
//! # let run = folder.path().join("run");
//! let scenario = Scenario::from_path(path)?;
//! let viewer = ViewerFile::new(run.join("run.rrd"));
//! Rehearsal::new(&scenario)?.run(&mut (RunDirectory::new(&run), viewer))?;
//! assert!(docktwin_view::is_whole(&run.join("run.rrd")));
//!
//! let again = folder.path().join("again.rrd");
//! save_one(&mut Recording::open(&run)?, None, &again)?;
//! assert!(docktwin_view::is_whole(&again));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Absent on purpose: rerun's own types, which stay in `docktwin-view`; printing.

mod error;
mod live;
mod playback;
mod recording;
mod viewer_file;

pub use error::PlaybackError;
pub use live::{Live, LiveError, LiveEvents, LiveReport, LiveViewer};
pub use playback::{Playback, pair_names, play, scene_model};
pub use recording::{Align, Recording, save_one, save_two};
pub use viewer_file::ViewerFile;
