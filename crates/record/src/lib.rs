//! MCAP log, Parquet, events, replay source.
