//! Writes the recording of a made-up docking, to look at in the viewer.
//!
//! ```sh
//! cargo run -p docktwin-view --example demo -- demo.rrd 20
//! rerun demo.rrd
//! ```

mod synthetic;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let path = std::path::PathBuf::from(args.next().unwrap_or_else(|| "demo.rrd".to_owned()));
    let end_s = args.next().map_or(Ok(20.0), |s| s.parse::<f64>())?;
    let (frames, spent_s) = synthetic::write(&path, end_s)?;
    let bytes = std::fs::metadata(&path)?.len();
    println!(
        "{}: {frames} frames, {:.1} µs each, {:.2} MB",
        path.display(),
        1e6 * spent_s / frames as f64,
        bytes as f64 / 1e6
    );
    Ok(())
}
