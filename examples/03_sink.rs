//! A sink of one's own: a histogram of the force between the spacecraft, and nothing else kept.
//!
//! `cargo run --release -p docktwin-run --example 03_sink`

use docktwin_record::{Event, Summary};
use docktwin_run::{
    Rehearsal, RunError, Sink, SinkError,
    sink::{Header, TickView},
};
use docktwin_scenario::Scenario;

/// Ticks by the size of F4, in classes of 250 N.
#[derive(Default)]
struct ForceHistogram {
    /// Where F4 stands in a row.
    column: usize,
    classes: [u64; 12],
    contacts: usize,
}

impl Sink for ForceHistogram {
    fn begin(&mut self, header: &Header<'_>) -> Result<(), SinkError> {
        let find = |name: &str| header.columns.iter().position(|c| c.name == name);
        self.column = find("port4_force_x_n").ok_or("this run records no F4")?;
        Ok(())
    }

    fn tick(&mut self, tick: &TickView<'_>) -> Result<(), SinkError> {
        let force: f64 =
            tick.row[self.column..self.column + 3].iter().map(|c| c.as_f64().powi(2)).sum();
        let class = (force.sqrt() / 250.0) as usize;
        self.classes[class.min(11)] += 1;
        Ok(())
    }

    fn event(&mut self, event: &Event) -> Result<(), SinkError> {
        self.contacts += usize::from(event.kind == "contact_begin");
        Ok(())
    }

    fn finish(&mut self, summary: &mut Summary) -> Result<(), SinkError> {
        println!("{}: {} contacts of pairs of surfaces", summary.scenario, self.contacts);
        for (i, ticks) in self.classes.iter().enumerate().filter(|(_, n)| **n > 0) {
            println!("{:5} N and more: {ticks} ticks", 250 * i);
        }
        Ok(())
    }
}

fn main() -> Result<(), RunError> {
    let scenario = Scenario::from_path("scenarios/apas_fast.toml")?;
    Rehearsal::new(&scenario)?.run(&mut ForceHistogram::default())?;
    Ok(())
}
