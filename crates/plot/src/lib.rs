//! Plots as SVG text: lines over time or over each other, events, spans, lanes of states.
//!
//! ```
//! use docktwin_plot::{Axis, Colour, Embed, Line, Marker, Plot};
//!
//! let force: Vec<[f64; 2]> = (0..3000).map(|i| {
//!     let t = f64::from(i) * 1e-3;
//!     [t, 900.0 * (-t).exp() * (9.0 * t).sin()]
//! }).collect();
//! let svg = Plot::new("Port force")
//!     .x_axis(Axis::new("time", "s"))
//!     .y_axis(Axis::new("force", "N"))
//!     .line(Line::new("X", &force).colour(Colour::Blue))
//!     .marker(Marker::new(0.17, "peak"))
//!     .size(640.0, 220.0)
//!     .svg(Embed::Alone)?;
//! assert!(svg.starts_with("<svg"));
//! # Ok::<(), docktwin_plot::PlotError>(())
//! ```
//!
//! An SVG has a `viewBox` and no fixed size, so it takes the width it is given. Colours are CSS
//! variables with the light theme as fallback: dark where the reader prefers dark, light on paper.
//! [`Embed::Alone`] is for a file of its own; [`Embed::Page`] for a page that holds [`STYLE`] once.
//!
//! plotters lays out axes and meshes; this crate gives it a drawing backend of its own, because
//! plotters' SVG backend knows neither themes nor dashes nor fractions of a unit.
//!
//! Absent on purpose: files, knowledge of what is plotted.

#![cfg_attr(test, expect(clippy::unwrap_used, reason = "a test stops at the first surprise"))]

mod backend;
mod decimate;
mod draw;
mod plot;
mod theme;
mod ticks;

pub use decimate::decimate;
pub use plot::{Axis, Bar, Colour, Dash, Embed, Lane, Line, Marker, Plot, PlotError, Points, Span};
pub use theme::STYLE;
