//! Several plots on one sheet.

use core::fmt::Write as _;

use docktwin_plot::{Embed, Plot, PlotError, STYLE};

/// Plots in rows on one sheet.
pub(super) fn sheet(rows: &[&[Plot<'_>]]) -> Result<String, PlotError> {
    const GAP: f64 = 10.0;
    let (mut body, mut y, mut width) = (String::new(), 0.0f64, 0.0f64);
    for row in rows {
        let (mut x, mut tallest) = (0.0, 0.0f64);
        for plot in *row {
            let svg = plot.svg(Embed::Page)?;
            let [w, h] = view_box(&svg);
            let placed =
                format!("<svg x=\"{x:.0}\" y=\"{y:.0}\" width=\"{w:.0}\" height=\"{h:.0}\"");
            body.push_str(&svg.replacen("<svg class=\"dtp\"", &placed, 1));
            x += w + GAP;
            tallest = tallest.max(h);
        }
        width = width.max(x - GAP);
        y += tallest + GAP;
    }
    let mut out = String::new();
    // Writing to a String cannot fail. The class of the background is that of the plots' own.
    let _ = writeln!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"dtp\" \
         viewBox=\"0 0 {width:.0} {y:.0}\"><style>{STYLE}</style>\
         <rect class=\"dtf11\" fill=\"#fff\" width=\"100%\" height=\"100%\"/>{body}</svg>"
    );
    Ok(out)
}

/// Width and height of a plot's view box.
fn view_box(svg: &str) -> [f64; 2] {
    let numbers: Vec<f64> = svg
        .split("viewBox=\"")
        .nth(1)
        .and_then(|s| s.split('"').next())
        .map(|s| s.split(' ').filter_map(|n| n.parse().ok()).collect())
        .unwrap_or_default();
    match numbers[..] {
        [_, _, w, h] => [w, h],
        _ => [640.0, 260.0],
    }
}
