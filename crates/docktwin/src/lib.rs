//! What the command line is put together from beside the engine ([`docktwin_run`]): from a recording to
//! what the viewer shows ([`playback`]), the same while it happens, in a file ([`viewer_file`]) or in an open
//! viewer ([`live`]), a person at the controls
//! ([`pilot`]).

pub mod live;
pub mod pilot;
pub mod playback;
pub mod viewer_file;
