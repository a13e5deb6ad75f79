use std::path::Path;

use rerun::external::re_log_encoding::DecoderApp;

/// Whether a recording is there and readable to its end.
#[must_use]
pub fn is_whole(path: &Path) -> bool {
    let Ok(file) = std::fs::File::open(path) else { return false };
    let Ok(messages) = DecoderApp::decode_eager(std::io::BufReader::new(file)) else {
        return false;
    };
    let mut some = false;
    for message in messages {
        if message.is_err() {
            return false;
        }
        some = true;
    }
    some
}
