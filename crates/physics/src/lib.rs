//! Laws as pure functions, and the allocation-free reduced twin.
