//! docktwin command line.
fn main() {}
