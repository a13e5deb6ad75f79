//! Where the messages of a recording go: into a file, or to a viewer that is open.
//!
//! The part of rerun's `RecordingStream` that is needed here, made of rerun's own chunks, file writer
//! and client. The type itself would bring rerun's chunk store, its MCAP reader, image codecs and the
//! client of its data platform into every build.

use core::time::Duration;
use std::path::Path;
use std::sync::Arc;

use re_chunk::{Chunk, ChunkError, ChunkId, RowId, TimeColumn};
use re_log_encoding::{FileSink, FileSinkError};
use re_log_types::{
    BlueprintActivationCommand, EntityPath, LogMsg, RecordingId, SetStoreInfo, StoreId, StoreInfo,
    StoreKind, StoreSource, TimePoint, Timeline,
};
use re_sdk_types::archetypes::RecordingInfo;
use re_sdk_types::components::Timestamp;
use re_sdk_types::{AsComponents, SerializedComponentColumn};

use crate::{ViewError, paths, whole};

/// Name under which the viewer keeps its own changes to the layout.
const APPLICATION: &str = "docktwin";
/// How long the last messages may take to their file or viewer.
const FLUSH_LIMIT: Duration = Duration::from_secs(60);
/// How long a viewer may take to answer at first.
#[cfg(feature = "live")]
const CONNECT_LIMIT: Duration = Duration::from_secs(2);

/// What comes of sending: data that rerun refuses are an error, a file that cannot be written shows
/// when it is closed.
pub(crate) type Sent = Result<(), ChunkError>;

/// One recording, or the layout that belongs to it. Clones write into the same one.
#[derive(Clone)]
pub(crate) struct Stream {
    store: StoreId,
    sink: Arc<Sink>,
}

enum Sink {
    File(FileSink),
    #[cfg(feature = "live")]
    Viewer(re_grpc_client::write::Client),
}

impl Sink {
    fn send(&self, message: LogMsg) {
        match self {
            Self::File(file) => file.send(message),
            #[cfg(feature = "live")]
            Self::Viewer(viewer) => viewer.send_blocking(message),
        }
    }

    fn flush(&self, limit: Duration) -> Result<(), String> {
        match self {
            Self::File(file) => file.flush_blocking(limit).map_err(|e| e.to_string()),
            #[cfg(feature = "live")]
            Self::Viewer(viewer) => viewer.flush_blocking(limit).map_err(|e| e.to_string()),
        }
    }
}

fn store(kind: StoreKind) -> StoreId {
    StoreId::new(kind, APPLICATION, RecordingId::random())
}

impl Stream {
    /// Starts a recording of this name in a file. An existing file is replaced.
    ///
    /// # Errors
    /// [`ViewError::Create`] when the file cannot be made, [`ViewError::Encode`] when rerun refuses the
    /// name.
    pub(crate) fn create(path: &Path, name: &str) -> Result<Self, ViewError> {
        let create = |source: FileSinkError| ViewError::Create {
            path: path.to_owned(),
            source: Box::new(source),
        };
        Self::begin(Sink::File(FileSink::new(path).map_err(create)?), name)
    }

    /// Refuses to: this build has no client of the viewer.
    ///
    /// # Errors
    /// [`ViewError::WithoutLive`], always.
    #[cfg(not(feature = "live"))]
    pub(crate) fn connect(url: &str, _name: &str) -> Result<Self, ViewError> {
        Err(ViewError::WithoutLive { url: url.to_owned() })
    }

    /// Starts a recording of this name in the viewer that is open at `url`.
    ///
    /// # Errors
    /// [`ViewError::NoViewer`] when none answers there within two seconds, [`ViewError::Encode`] when
    /// rerun refuses the name.
    #[cfg(feature = "live")]
    pub(crate) fn connect(url: &str, name: &str) -> Result<Self, ViewError> {
        let nobody = |message: String| ViewError::NoViewer { url: url.to_owned(), message };
        let uri = match url.parse() {
            Ok(re_uri::RedapUri::Proxy(uri)) => uri,
            Ok(_) => return Err(nobody("not a `/proxy` endpoint".to_owned())),
            Err(e) => return Err(nobody(e.to_string())),
        };
        let viewer = re_grpc_client::write::Client::new(uri, Default::default());
        let stream = Self::begin(Sink::Viewer(viewer), name)?;
        // Before the scene: without a viewer rerun 0.36.3 waits for ever once it holds 100 messages.
        if stream.sink.flush(CONNECT_LIMIT).is_err() {
            // Dropping the stream would wait for the viewer for another while.
            core::mem::forget(stream);
            return Err(nobody("no answer within 2 s".to_owned()));
        }
        Ok(stream)
    }

    fn begin(sink: Sink, name: &str) -> Result<Self, ViewError> {
        let stream = Self { store: store(StoreKind::Recording), sink: Arc::new(sink) };
        stream.announce();
        // The date is for the viewer's list of recordings alone.
        let info = RecordingInfo::new().with_start_time(Timestamp::now()).with_name(name);
        stream
            .row(EntityPath::properties(), TimePoint::default(), &info)
            .map_err(|e| ViewError::encode("properties", e))?;
        Ok(stream)
    }

    /// Says what is to come: to the viewer, before all else.
    fn announce(&self) {
        // The viewer shows the source as "Rust SDK (rustc …)".
        let source = StoreSource::RustSdk {
            rustc_version: env!("CARGO_PKG_RUST_VERSION").to_owned(),
            llvm_version: String::new(),
        };
        let info = StoreInfo::new(self.store.clone(), source);
        self.sink.send(SetStoreInfo { row_id: *RowId::new(), info }.into());
    }

    fn row(
        &self,
        path: impl Into<EntityPath>,
        at: TimePoint,
        what: &(impl AsComponents + ?Sized),
    ) -> Sent {
        let parts = what.as_serialized_batches();
        let chunk = Chunk::builder(path).with_serialized_batches(RowId::new(), at, parts);
        self.chunk(&chunk.build()?)
    }

    fn chunk(&self, chunk: &Chunk) -> Sent {
        self.sink.send(LogMsg::ArrowMsg(self.store.clone(), chunk.to_arrow_msg()?));
        Ok(())
    }

    /// Records what holds at all times.
    pub(crate) fn log_static(
        &self,
        path: impl Into<EntityPath>,
        what: &(impl AsComponents + ?Sized),
    ) -> Sent {
        self.row(path, TimePoint::default(), what)
    }

    /// Records rows of one entity at these times, ns.
    pub(crate) fn send_columns(
        &self,
        path: &str,
        times: &[i64],
        columns: impl Iterator<Item = SerializedComponentColumn>,
    ) -> Sent {
        let times = TimeColumn::new_duration_nanos(paths::TIMELINE, times.iter().copied());
        let times = core::iter::once((*times.timeline().name(), times)).collect();
        let columns = columns.map(|c| (c.descriptor, c.list_array)).collect();
        self.chunk(&Chunk::from_auto_row_ids(ChunkId::new(), path.into(), times, columns)?)
    }

    /// Stores what `write` logs as the layout of the recording, and makes it the active one.
    pub(crate) fn layout(&self, write: impl FnOnce(&Layout) -> Sent) -> Sent {
        let layout = Self { store: store(StoreKind::Blueprint), sink: Arc::clone(&self.sink) };
        layout.announce();
        let layout = Layout(layout);
        write(&layout)?;
        let blueprint_id = layout.0.store;
        let activation =
            BlueprintActivationCommand { blueprint_id, make_active: true, make_default: true };
        self.sink.send(activation.into());
        Ok(())
    }

    /// Waits until all that was sent has arrived. The last clone closes the recording; `path` names it
    /// in errors.
    ///
    /// # Errors
    /// [`ViewError::Write`] when it could not be written to its end.
    pub(crate) fn close(self, path: &Path) -> Result<(), ViewError> {
        let wrong = |message| ViewError::Write { path: path.to_owned(), message };
        if let Err(message) = self.sink.flush(FLUSH_LIMIT) {
            // Dropping a viewer that does not answer would wait for it for ever: the stream is left to
            // the end of the process.
            core::mem::forget(self);
            return Err(wrong(message));
        }
        if let Some(Sink::File(file)) = Arc::into_inner(self.sink) {
            // Puts the table of contents at the end of the file, and keeps to itself if that fails.
            drop(file);
            // A pipe or a device has no end to look at.
            if path.is_file() && !whole::has_footer(path) {
                return Err(wrong("its end is missing".to_owned()));
            }
        }
        Ok(())
    }
}

/// The layout of a recording, while it is written.
pub(crate) struct Layout(Stream);

impl Layout {
    /// Records one part of the layout.
    pub(crate) fn log(
        &self,
        path: impl Into<EntityPath>,
        what: &(impl AsComponents + ?Sized),
    ) -> Sent {
        // The viewer looks for layouts on a timeline of this name.
        let at = TimePoint::default().with(Timeline::new_sequence("blueprint"), 0);
        self.0.row(path, at, what)
    }
}
