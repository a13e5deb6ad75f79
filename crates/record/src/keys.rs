//! Names of the metadata of a log, and of what stands in them.

pub(crate) const METADATA: &str = "docktwin";
pub(crate) const METADATA_COLUMNS: &str = "docktwin.columns";
pub(crate) const METADATA_PAIRS: &str = "docktwin.pairs";
pub(crate) const SCHEMA_KEY: &str = "docktwin_record_schema";
/// Says that rows and events are followed by their digests, and which.
pub(crate) const DIGEST_KEY: &str = "record_digest";
pub(crate) const DIGEST_KIND: &str = "blake3-128 chained by tick, 1";
/// Why a log was written anew.
pub(crate) const RECOVERED_KEY: &str = "recovered";
/// Wall clock at the start of the recording, ns since 1970.
pub(crate) const STARTED_KEY: &str = "started_unix_ns";
