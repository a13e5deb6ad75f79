//! The full twin: the on-orbit world integrated by rapier.
