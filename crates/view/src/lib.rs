//! rerun scene and blueprint.
