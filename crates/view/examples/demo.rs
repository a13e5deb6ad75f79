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
    let mut spent_s = synthetic::write(&path, end_s)?;
    spent_s.sort_by(f64::total_cmp);
    let us = |share: f64| 1e6 * spent_s[(share * (spent_s.len() - 1) as f64) as usize];
    println!(
        "{}: {} frames, mean {:.1} µs, p50 {:.1}, p99 {:.1}, max {:.1} (sends a batch); {:.2} MB",
        path.display(),
        spent_s.len(),
        1e6 * spent_s.iter().sum::<f64>() / spent_s.len() as f64,
        us(0.5),
        us(0.99),
        us(1.0),
        std::fs::metadata(&path)?.len() as f64 / 1e6
    );
    Ok(())
}
