//! Scenario schema, checking and explanation.
