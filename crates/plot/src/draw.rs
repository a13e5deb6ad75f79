//! Layout of a plot.

use core::fmt::Write as _;

use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::drawing::{DrawingArea, IntoDrawingArea as _};
use plotters::element::{Circle, PathElement, Rectangle, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{
    Color as _, FontFamily, FontStyle, IntoTextStyle as _, RGBColor, ShapeStyle, TextStyle,
};

use crate::backend::{FINE, Ink, Svg, escape};
use crate::decimate::decimate;
use crate::plot::{Axis, Colour, Dash, Embed, Plot, PlotError};
use crate::theme::{BACKGROUND, GRID, MUTED, STYLE, TEXT};
use crate::ticks::{self, Ticks};

const TITLE: f64 = 13.0;
const LABEL: f64 = 11.0;
const ROW: f64 = 15.0;
/// Events nearer than this share a label.
const JOIN: f64 = 3.0;
/// Free to the left of the name of the vertical axis.
const EDGE: f64 = 5.0;

type Chart<'a, 'b> = ChartContext<'a, Svg<'b>, Cartesian2d<Scale, Scale>>;

/// An axis as plotters sees it: linear in its own coordinate, with our ticks.
struct Scale {
    range: [f64; 2],
    at: Vec<(f64, String)>,
}

impl Ranged for Scale {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let share = (value - self.range[0]) / (self.range[1] - self.range[0]);
        let (from, to) = (f64::from(limit.0), f64::from(limit.1));
        #[expect(clippy::cast_possible_truncation, reason = "of the size of the plot")]
        let at = (from + share * (to - from)).round() as i32;
        at
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        // Everything is a bold point; light ones would be lines between the ticks.
        if hint.weight().allow_light_points() {
            return Vec::new();
        }
        self.at.iter().map(|(v, _)| *v).collect()
    }

    fn range(&self) -> core::ops::Range<f64> {
        self.range[0]..self.range[1]
    }
}

impl ValueFormatter<f64> for Scale {
    fn format_ext(&self, v: &f64) -> String {
        let near =
            |a: &&(f64, String), b: &&(f64, String)| (a.0 - v).abs().total_cmp(&(b.0 - v).abs());
        self.at.iter().min_by(near).map_or(String::new(), |(_, l)| l.clone())
    }
}

#[expect(clippy::cast_possible_truncation, reason = "sizes are checked to be at most 4000")]
fn fine(x: f64) -> i32 {
    (x * FINE).round() as i32
}

fn fine_u(x: f64) -> u32 {
    u32::try_from(fine(x)).unwrap_or(0)
}

/// A generous estimate: what a system font needs.
fn text_width(text: &str, size: f64) -> f64 {
    let wide = |c: char| match c {
        'i' | 'l' | 'I' | '.' | ',' | '\'' | '|' | ' ' | 't' | 'f' | 'r' | '·' => 0.36,
        'm' | 'w' | 'M' | 'W' | '×' => 0.88,
        c if c.is_uppercase() => 0.70,
        _ => 0.575,
    };
    text.chars().map(wide).sum::<f64>() * size
}

/// Decides the range of an axis, in its own coordinate (log10 for a logarithmic one).
fn range(axis: &Axis, data: impl Iterator<Item = f64>, pad: f64) -> Result<[f64; 2], PlotError> {
    let to = |v: f64| if axis.log { v.log10() } else { v };
    if let Some([from, end]) = axis.range {
        if axis.log && from <= 0.0 {
            return Err(PlotError::Log { axis: axis.name.clone(), from });
        }
        if !(from.is_finite() && end.is_finite() && end > from && (end - from).is_finite()) {
            return Err(PlotError::Range { axis: axis.name.clone(), from, to: end });
        }
        return Ok([to(from), to(end)]);
    }
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for v in data.chain(axis.include.iter().copied()).map(to).filter(|v| v.is_finite()) {
        low = low.min(v);
        high = high.max(v);
    }
    if low > high {
        return Ok([0.0, 1.0]);
    }
    let middle = 0.5 * (low + high);
    // A constant has no range of its own, and rounding noise about it deserves none.
    let least = axis.at_least.max(1e-9 * middle.abs());
    let least = if low < high || least > 0.0 { least } else { 1.0 };
    if high - low < least {
        (low, high) = (middle - 0.5 * least, middle + 0.5 * least);
    }
    let span = (high - low).min(f64::MAX);
    Ok([low - pad * span, high + pad * span])
}

fn text(size: f64, ink: u8, h: HPos, v: VPos) -> TextStyle<'static> {
    let mut style = (FontFamily::SansSerif, size * FINE).into_text_style(&(1000, 1000));
    style.color = Ink::of(ink).rgb().to_backend_color();
    style.pos(Pos::new(h, v))
}

fn line_style(colour: RGBColor, alpha: f64, width: f64) -> ShapeStyle {
    ShapeStyle { color: colour.mix(alpha), filled: false, stroke_width: fine_u(width) }
}

/// What stands between two points inside the box, after Liang and Barsky.
fn clip(a: [f64; 2], b: [f64; 2], x: [f64; 2], y: [f64; 2]) -> Option<([f64; 2], [f64; 2])> {
    let (mut t0, mut t1) = (0.0f64, 1.0f64);
    for (p, d, r) in [(a[0], b[0] - a[0], x), (a[1], b[1] - a[1], y)] {
        for (distance, speed) in [(p - r[0], d), (r[1] - p, -d)] {
            // Inside where distance + t · speed ≥ 0.
            if speed.abs() < f64::MIN_POSITIVE {
                if distance < 0.0 {
                    return None;
                }
            } else if speed > 0.0 {
                t0 = t0.max(-distance / speed);
            } else {
                t1 = t1.min(-distance / speed);
            }
        }
    }
    let at = |t: f64| [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
    (t0 <= t1).then(|| (at(t0), at(t1)))
}

/// Pieces of a polyline inside the box.
fn clipped(points: &[[f64; 2]], x: [f64; 2], y: [f64; 2]) -> Vec<Vec<(f64, f64)>> {
    let mut out: Vec<Vec<(f64, f64)>> = Vec::new();
    let mut joined = false;
    for pair in points.windows(2) {
        let Some((a, b)) = clip(pair[0], pair[1], x, y) else {
            joined = false;
            continue;
        };
        let same = |p: [f64; 2], q: [f64; 2]| p.map(f64::to_bits) == q.map(f64::to_bits);
        match out.last_mut() {
            Some(piece) if joined && same(a, pair[0]) => piece.push((b[0], b[1])),
            _ => out.push(vec![(a[0], a[1]), (b[0], b[1])]),
        }
        joined = same(b, pair[1]);
    }
    out
}

struct Layout {
    x: [f64; 2],
    y: [f64; 2],
    x_ticks: Ticks,
    y_ticks: Ticks,
    left: f64,
    legend: Vec<Entry>,
    labels: Vec<Label>,
    top: f64,
    bottom: f64,
    right: f64,
}

struct Entry {
    name: String,
    colour: Colour,
    dash: Option<Dash>,
    at: [f64; 2],
}

struct Label {
    text: String,
    colour: Colour,
    x: f64,
    anchor: HPos,
    row: f64,
}

fn colour_of(i: usize, own: Option<Colour>) -> Colour {
    own.unwrap_or(Colour::of_series(i))
}

impl Layout {
    fn new(p: &Plot<'_>) -> Result<Self, PlotError> {
        let size_ok = (160.0..=4000.0).contains(&p.width) && (20.0..=4000.0).contains(&p.height);
        if !size_ok {
            return Err(PlotError::Size { width: p.width, height: p.height });
        }
        let curves = p.lines.len() + p.points.len();
        if !p.lanes.is_empty() && curves > 0 {
            return Err(PlotError::Mixed);
        }
        let series =
            || p.lines.iter().map(|l| l.points).chain(p.points.iter().map(|s| s.points)).flatten();
        let bars =
            || p.lanes.iter().flat_map(|l| &l.bars).flat_map(|b| [b.range.start, b.range.end]);
        let mut x = range(&p.x, series().map(|q| q[0]).chain(bars()), 0.0)?;
        let visible = |q: &&[f64; 2]| {
            let v = if p.x.log { q[0].log10() } else { q[0] };
            (x[0]..=x[1]).contains(&v)
        };
        let mut y = if p.lanes.is_empty() {
            range(&p.y, series().filter(visible).map(|q| q[1]), 0.06)?
        } else {
            #[expect(clippy::cast_precision_loss, reason = "few lanes")]
            let n = p.lanes.len() as f64;
            [0.0, n]
        };
        let right = 10.0;
        let guess = p.left.unwrap_or(60.0);
        if p.equal && p.lanes.is_empty() {
            let (w, h) = ((p.width - guess - right).max(1.0), p.height);
            let per_unit = ((x[1] - x[0]) / w).max((y[1] - y[0]) / h);
            for (r, length) in [(&mut x, w), (&mut y, h)] {
                let (middle, half) = (0.5 * (r[0] + r[1]), 0.5 * per_unit * length);
                *r = [middle - half, middle + half];
            }
        }
        let ticks = |axis: &Axis, r: [f64; 2], n: f64| {
            if axis.log { ticks::log(r[0], r[1]) } else { ticks::linear(r[0], r[1], n) }
        };
        let y_ticks = if p.lanes.is_empty() {
            ticks(&p.y, y, (p.height / 34.0).clamp(2.0, 8.0))
        } else {
            let at = p.lanes.iter().enumerate().map(|(i, l)| {
                #[expect(clippy::cast_precision_loss, reason = "few lanes")]
                let middle = y[1] - i as f64 - 0.5;
                (middle, l.name.clone())
            });
            Ticks { at: at.collect(), exponent: 0 }
        };
        let named = if p.lanes.is_empty() && !p.y.name.is_empty() { 18.0 } else { 0.0 };
        let widest = y_ticks.at.iter().map(|(_, l)| text_width(l, LABEL)).fold(0.0, f64::max);
        let left = p.left.unwrap_or(named + widest + 10.0).clamp(8.0, 0.6 * p.width);
        let x_ticks = ticks(&p.x, x, ((p.width - left) / 75.0).clamp(2.0, 12.0));

        // A label under the end of the axis reaches beyond it.
        let end = x_ticks.at.last().filter(|t| !p.equal && t.0 > x[1] - 0.01 * (x[1] - x[0]));
        let right = end.map_or(right, |(_, l)| right.max(0.5 * text_width(l, LABEL) + 2.0));

        let (legend, legend_rows) = legend(p);
        let (labels, label_rows) = labels(p, x, left, right);
        let title = if p.title.is_empty() { 4.0 } else { TITLE + 8.0 };
        let top = title + ROW * legend_rows + 13.0 * label_rows + 4.0;
        let bottom = if p.x.name.is_empty() { 22.0 } else { 36.0 };
        Ok(Self { x, y, x_ticks, y_ticks, left, legend, labels, top, bottom, right })
    }
}

/// Entries of the legend with their places, and how many rows they take.
fn legend(p: &Plot<'_>) -> (Vec<Entry>, f64) {
    let lines = p
        .lines
        .iter()
        .enumerate()
        .map(|(i, l)| (l.name.clone(), colour_of(i, l.colour), Some(l.dash)));
    let points = p
        .points
        .iter()
        .enumerate()
        .map(|(i, s)| (s.name.clone(), colour_of(p.lines.len() + i, s.colour), None));
    let others = p.legend.iter().map(|(name, colour)| (name.clone(), *colour, None));
    let (mut at, mut row) = (8.0, 0.0);
    let mut out: Vec<Entry> = Vec::new();
    for (name, colour, dash) in lines.chain(points).chain(others).filter(|e| !e.0.is_empty()) {
        let width = 26.0 + text_width(&name, LABEL) + 12.0;
        if at + width > p.width && at > 8.0 {
            (at, row) = (8.0, row + 1.0);
        }
        out.push(Entry { name, colour, dash, at: [at, row] });
        at += width;
    }
    let rows = if out.is_empty() { 0.0 } else { row + 1.0 };
    (out, rows)
}

/// Labels of the events with their places, and how many rows they take.
fn labels(p: &Plot<'_>, x: [f64; 2], left: f64, right: f64) -> (Vec<Label>, f64) {
    let to = |v: f64| if p.x.log { v.log10() } else { v };
    let scale = (p.width - left - right) / (x[1] - x[0]);
    let mut events: Vec<(f64, String, Colour)> = p
        .markers
        .iter()
        .filter(|m| !m.label.is_empty() && (x[0]..=x[1]).contains(&to(m.at)))
        .map(|m| (left + (to(m.at) - x[0]) * scale, m.label.clone(), m.colour))
        .collect();
    events.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut joined: Vec<(f64, String, Colour)> = Vec::new();
    for e in events {
        match joined.last_mut() {
            Some(last) if e.0 - last.0 < JOIN => {
                last.1.push_str(", ");
                last.1.push_str(&e.1);
            }
            _ => joined.push(e),
        }
    }
    // Right ends of the rows; a label goes into the lowest row with room.
    let mut ends: Vec<f64> = Vec::new();
    let mut out = Vec::new();
    for (at, text, colour) in joined {
        let width = text_width(&text, 10.5);
        let (anchor, from) = if at + width + 3.0 > p.width {
            (HPos::Right, (at - width).max(0.0))
        } else {
            (HPos::Left, at)
        };
        let row = ends.iter().position(|end| *end < from).unwrap_or(ends.len());
        if row == ends.len() {
            ends.push(0.0);
        }
        ends[row] = from + width + 8.0;
        #[expect(clippy::cast_precision_loss, reason = "few rows")]
        out.push(Label { text, colour, x: at, anchor, row: row as f64 });
    }
    #[expect(clippy::cast_precision_loss, reason = "few rows")]
    let rows = ends.len() as f64;
    (out, rows)
}

impl Plot<'_> {
    /// Draws it.
    ///
    /// # Errors
    /// A range, size or mixture that cannot be drawn. Missing data are no error: the plot says so.
    pub fn svg(&self, embed: Embed) -> Result<String, PlotError> {
        svg(self, embed)
    }
}

fn svg(p: &Plot<'_>, embed: Embed) -> Result<String, PlotError> {
    let l = Layout::new(p)?;
    let total = l.top + p.height + l.bottom;
    let mut body = String::new();
    draw(p, &l, total, &mut body).map_err(PlotError::Layout)?;
    let mut out = String::with_capacity(body.len() + 512);
    let label = escape(if p.title.is_empty() { "plot" } else { &p.title });
    let xmlns = match embed {
        Embed::Alone => " xmlns=\"http://www.w3.org/2000/svg\"",
        Embed::Page => "",
    };
    // Writing to a String cannot fail.
    let _ = write!(
        out,
        "<svg{xmlns} class=\"dtp\" viewBox=\"0 0 {:.0} {total:.0}\" role=\"img\" \
         aria-label=\"{label}\">",
        p.width
    );
    if embed == Embed::Alone {
        let _ = write!(
            out,
            "<style>{STYLE}</style><rect class=\"dtf11\" fill=\"{}\" width=\"100%\" \
             height=\"100%\"/>",
            crate::theme::light(BACKGROUND)
        );
    }
    out.push_str(&body);
    out.push_str("</svg>\n");
    Ok(out)
}

fn draw(p: &Plot<'_>, l: &Layout, total: f64, body: &mut String) -> Result<(), String> {
    let say = |e: &dyn core::fmt::Display| e.to_string();
    let backend = Svg { body, size: (fine_u(p.width), fine_u(total)) };
    let root = backend.into_drawing_area();
    head(p, l, &root)?;
    let area = root.margin(fine(l.top), 0, fine(EDGE), fine(l.right));
    let mut chart: Chart<'_, '_> = ChartBuilder::on(&area)
        .x_label_area_size(fine_u(l.bottom))
        .y_label_area_size(fine_u(l.left - EDGE))
        .build_cartesian_2d(
            Scale { range: l.x, at: l.x_ticks.at.clone() },
            Scale { range: l.y, at: l.y_ticks.at.clone() },
        )
        .map_err(|e| say(&e))?;
    spans(p, l, &mut chart)?;
    let name = |axis: &Axis, exponent: i32| match (axis.unit.as_str(), exponent) {
        ("", 0) => axis.name.clone(),
        ("", e) => format!("{}, {}", axis.name, ticks::power(e)),
        (unit, 0) => format!("{}, {unit}", axis.name),
        (unit, e) => format!("{}, {} {unit}", axis.name, ticks::power(e)),
    };
    let (x_name, y_name) = (name(&p.x, l.x_ticks.exponent), name(&p.y, l.y_ticks.exponent));
    // A name longer than a low plot is high would lose its ends.
    let room = l.top.min(l.bottom) * 2.0 + p.height;
    let names = LABEL * (room / text_width(&y_name, LABEL).max(1.0)).clamp(0.6, 1.0);
    let mut mesh = chart.configure_mesh();
    mesh.bold_line_style(line_style(Ink::of(GRID).rgb(), 1.0, 0.8))
        .light_line_style(line_style(Ink::of(GRID).rgb(), 0.0, 0.8))
        .axis_style(line_style(Ink::of(MUTED).rgb(), 0.7, 0.8))
        .label_style(text(LABEL, MUTED, HPos::Center, VPos::Center))
        .axis_desc_style(text(names, MUTED, HPos::Center, VPos::Center))
        .set_all_tick_mark_size(fine_u(3.0))
        .x_desc(x_name.as_str());
    if p.lanes.is_empty() {
        mesh.y_desc(y_name.as_str());
    } else {
        mesh.disable_y_mesh();
    }
    mesh.draw().map_err(|e| say(&e))?;
    events(p, l, &mut chart)?;
    lanes(p, l, &mut chart)?;
    series(p, l, &mut chart)
}

/// Title, legend and labels of events.
fn head(p: &Plot<'_>, l: &Layout, root: &DrawingArea<Svg<'_>, Shift>) -> Result<(), String> {
    let say = |e: &dyn core::fmt::Display| e.to_string();
    let write = |s: &str, at: [f64; 2], style: &TextStyle<'_>| {
        root.draw_text(s, style, (fine(at[0]), fine(at[1]))).map_err(|e| say(&e))
    };
    let mut y = 4.0;
    if !p.title.is_empty() {
        let mut bold = text(TITLE, TEXT, HPos::Left, VPos::Top);
        bold.font = bold.font.style(FontStyle::Bold);
        write(&p.title, [8.0, y], &bold)?;
        y += TITLE + 4.0;
    }
    for e in &l.legend {
        let (x, middle) = (e.at[0], y + ROW * (e.at[1] + 0.5));
        match e.dash {
            Some(dash) => {
                let ink = Ink { number: e.colour as u8, dash };
                let ends = [x, x + 20.0].map(|x| (fine(x), fine(middle)));
                root.draw(&PathElement::new(ends, line_style(ink.rgb(), 1.0, 2.0)))
                    .map_err(|e| say(&e))?;
            }
            None => {
                let ink = Ink::of(e.colour as u8).rgb();
                let corners =
                    [(fine(x + 6.0), fine(middle - 4.0)), (fine(x + 18.0), fine(middle + 4.0))];
                root.draw(&Rectangle::new(corners, ink.filled())).map_err(|e| say(&e))?;
            }
        }
        write(&e.name, [x + 25.0, middle], &text(LABEL, TEXT, HPos::Left, VPos::Center))?;
    }
    for e in &l.labels {
        let at = l.top - 3.0 - 13.0 * e.row;
        let ink = if e.colour == Colour::Grey { MUTED } else { e.colour as u8 };
        let x = if matches!(e.anchor, HPos::Left) { e.x - 1.0 } else { e.x + 1.0 };
        write(&e.text, [x, at], &text(10.5, ink, e.anchor, VPos::Bottom))?;
    }
    Ok(())
}

fn spans(p: &Plot<'_>, l: &Layout, chart: &mut Chart<'_, '_>) -> Result<(), String> {
    for s in &p.spans {
        let [a, b] = s.range.map(|v| if p.x.log { v.log10() } else { v }.clamp(l.x[0], l.x[1]));
        if b > a {
            let ink = Ink::of(s.colour as u8).rgb().mix(0.13).filled();
            let one = Rectangle::new([(a, l.y[0]), (b, l.y[1])], ink);
            chart.draw_series([one]).map_err(|e| e.to_string())?;
        }
    }
    Ok(())
}

fn events(p: &Plot<'_>, l: &Layout, chart: &mut Chart<'_, '_>) -> Result<(), String> {
    for m in &p.markers {
        let at = if p.x.log { m.at.log10() } else { m.at };
        if (l.x[0]..=l.x[1]).contains(&at) {
            let ink = Ink { number: m.colour as u8, dash: Dash::Dashed }.rgb();
            let one = PathElement::new([(at, l.y[0]), (at, l.y[1])], line_style(ink, 0.75, 1.0));
            chart.draw_series([one]).map_err(|e| e.to_string())?;
        }
    }
    Ok(())
}

fn lanes(p: &Plot<'_>, l: &Layout, chart: &mut Chart<'_, '_>) -> Result<(), String> {
    let scale = (p.width - l.left - l.right) / (l.x[1] - l.x[0]);
    for ((middle, _), lane) in l.y_ticks.at.iter().zip(&p.lanes) {
        for bar in &lane.bars {
            let [a, b] = [bar.range.start, bar.range.end]
                .map(|v| if p.x.log { v.log10() } else { v }.clamp(l.x[0], l.x[1]));
            let outside = bar.range.end < l.x[0] || bar.range.start > l.x[1];
            if p.x.log || (!outside && b >= a) {
                // A bar shorter than the eye sees is drawn as long as it sees.
                let b = b.max((a + 1.2 / scale).min(l.x[1]));
                let half = 0.4 * bar.height.clamp(0.05, 1.0);
                let ink = Ink::of(bar.colour as u8).rgb();
                let one = Rectangle::new([(a, middle - half), (b, middle + half)], ink.filled());
                chart.draw_series([one]).map_err(|e| e.to_string())?;
                if !bar.label.is_empty() && (b - a) * scale > text_width(&bar.label, 10.0) + 6.0 {
                    let style = text(10.0, BACKGROUND, HPos::Center, VPos::Center);
                    let one = Text::new(bar.label.clone(), (0.5 * (a + b), *middle), style);
                    chart.draw_series([one]).map_err(|e| e.to_string())?;
                }
            }
        }
    }
    Ok(())
}

fn series(p: &Plot<'_>, l: &Layout, chart: &mut Chart<'_, '_>) -> Result<(), String> {
    let own = |q: &[f64; 2]| {
        let to = |v: f64, log: bool| if log { v.log10() } else { v };
        [to(q[0], p.x.log), to(q[1], p.y.log)]
    };
    let mut drawn = !p.lanes.is_empty();
    for (i, line) in p.lines.iter().enumerate() {
        let ink = Ink { number: colour_of(i, line.colour) as u8, dash: line.dash };
        let style = line_style(ink.rgb(), 1.0, line.width);
        let points: Vec<[f64; 2]> = line.points.iter().map(own).collect();
        let rising = points
            .windows(2)
            .all(|w| w[1][0] >= w[0][0] || !(w[0][0].is_finite() && w[1][0].is_finite()));
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "≤ 4000")]
        let columns = (p.width - l.left - l.right).max(1.0) as u32;
        let pieces = if rising {
            decimate(&points, l.x[0], l.x[1], columns)
        } else {
            thinned(&points, l, p)
        };
        for piece in pieces {
            if let [only] = piece[..] {
                // Alone between two gaps, it is a dot.
                let inside = clip(only, only, l.x, l.y).is_some();
                let one =
                    Circle::new((only[0], only[1]), fine(0.7 * line.width), ink.rgb().filled());
                if inside {
                    drawn = true;
                    chart.draw_series([one]).map_err(|e| e.to_string())?;
                }
            }
            for part in clipped(&piece, l.x, l.y) {
                drawn = true;
                let one = PathElement::new(part, style);
                chart.draw_series([one]).map_err(|e| e.to_string())?;
            }
        }
    }
    for (i, s) in p.points.iter().enumerate() {
        let ink = Ink::of(colour_of(p.lines.len() + i, s.colour) as u8).rgb().filled();
        let inside =
            s.points.iter().map(own).filter(|q| {
                q[0].is_finite() && q[1].is_finite() && clip(*q, *q, l.x, l.y).is_some()
            });
        let dots: Vec<_> = inside.map(|q| Circle::new((q[0], q[1]), fine(s.radius), ink)).collect();
        drawn |= !dots.is_empty();
        chart.draw_series(dots).map_err(|e| e.to_string())?;
    }
    if !drawn {
        let style = text(LABEL, MUTED, HPos::Center, VPos::Center);
        let middle = (0.5 * (l.x[0] + l.x[1]), 0.5 * (l.y[0] + l.y[1]));
        let one = Text::new("no data in this range", middle, style);
        chart.draw_series([one]).map_err(|e| e.to_string())?;
    }
    Ok(())
}

/// A curve that turns back keeps every point that lies a quarter of a unit from the one before.
fn thinned(points: &[[f64; 2]], l: &Layout, p: &Plot<'_>) -> Vec<Vec<[f64; 2]>> {
    let (sx, sy) = ((p.width - l.left - l.right) / (l.x[1] - l.x[0]), p.height / (l.y[1] - l.y[0]));
    points
        .split(|q| !(q[0].is_finite() && q[1].is_finite()))
        .filter(|piece| !piece.is_empty())
        .map(|piece| {
            let mut kept = vec![piece[0]];
            for (i, q) in piece.iter().enumerate().skip(1) {
                let last = kept[kept.len() - 1];
                let far = ((q[0] - last[0]) * sx).hypot((q[1] - last[1]) * sy) >= 0.25;
                if far || i == piece.len() - 1 {
                    kept.push(*q);
                }
            }
            kept
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Bar, Lane, Line, Marker, Points, Span};

    fn parse(svg: &str) -> roxmltree::Document<'_> {
        roxmltree::Document::parse(svg).unwrap()
    }

    /// Corners of every path of a colour, absolute.
    fn paths(svg: &str, class: &str) -> Vec<Vec<[f64; 2]>> {
        let numbers = |d: &str| -> Vec<f64> {
            let mut spaced = String::new();
            for c in d.chars() {
                if c == '-' || c == 'l' || c == 'M' {
                    spaced.push(' ');
                }
                if c != 'l' && c != 'M' {
                    spaced.push(c);
                }
            }
            spaced.split_whitespace().map(|n| n.parse().unwrap()).collect()
        };
        parse(svg)
            .descendants()
            .filter(|n| n.has_tag_name("path") && n.attribute("class") == Some(class))
            .map(|n| {
                let n = numbers(n.attribute("d").unwrap());
                let mut at = [0.0, 0.0];
                n.chunks(2)
                    .map(|d| {
                        at = [at[0] + d[0], at[1] + d[1]];
                        at
                    })
                    .collect()
            })
            .collect()
    }

    fn texts(svg: &str) -> Vec<String> {
        parse(svg).descendants().filter_map(|n| n.text().map(str::to_owned)).collect()
    }

    #[test]
    fn oracle_a_straight_line_lies_where_the_axes_say() {
        let points = [[0.0, 0.0], [10.0, 100.0]];
        let svg = Plot::new("")
            .x_axis(Axis::new("x", "s").range(0.0..10.0))
            .y_axis(Axis::new("y", "N").range(0.0..200.0))
            .line(Line::new("", &points).colour(Colour::Green))
            .margin_left(50.0)
            .size(360.0, 100.0)
            .svg(Embed::Page)
            .unwrap();
        let line = &paths(&svg, "dts2")[0];
        // Left 50, right 10: 300 wide from 50; top 8 (no title), 100 high; half the height.
        let want = [[50.0, 108.0], [350.0, 58.0]];
        for (got, want) in line.iter().zip(want) {
            assert!((got[0] - want[0]).abs() < 0.15 && (got[1] - want[1]).abs() < 0.15, "{line:?}");
        }
    }

    #[test]
    fn oracle_thirty_seconds_at_a_kilohertz_are_small_and_keep_the_spike() {
        let points: Vec<[f64; 2]> = (0..30_000u32)
            .map(|i| [f64::from(i) * 1e-3, if i == 7777 { 1e3 } else { f64::from(i % 13) }])
            .collect();
        let svg = Plot::new("noise")
            .x_axis(Axis::new("time", "s"))
            .y_axis(Axis::new("force", "N").range(0.0..1000.0))
            .line(Line::new("n", &points))
            .size(640.0, 200.0)
            .svg(Embed::Page)
            .unwrap();
        assert!(svg.len() < 40_000, "{} bytes", svg.len());
        let top = paths(&svg, "dts0").concat().iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
        let legend_and_title = 4.0 + TITLE + 8.0 + ROW;
        assert!(top < legend_and_title + 6.0, "the spike reaches the upper edge: {top}");
    }

    #[test]
    fn invariant_curves_stay_inside_the_plot_and_gaps_stay_gaps() {
        let points = [
            [-5.0, 0.0],
            [1.0, 50.0],
            [2.0, f64::NAN],
            [3.0, 1.0],
            [4.0, -80.0],
            [5.0, 0.5],
            [20.0, 3.0],
        ];
        let svg = Plot::new("t")
            .x_axis(Axis::new("x", "").range(0.0..6.0))
            .y_axis(Axis::new("y", "").range(-1.0..2.0))
            .line(Line::new("", &points))
            .size(400.0, 150.0)
            .svg(Embed::Page)
            .unwrap();
        let pieces = paths(&svg, "dts0");
        assert_eq!(
            pieces.len(),
            2,
            "the first rises beyond the top before it enters from the left"
        );
        for p in pieces.concat() {
            assert!((0.0..=390.5).contains(&p[0]) && (24.0..=176.0).contains(&p[1]), "{p:?}");
        }
    }

    #[test]
    fn invariant_every_kind_of_plot_is_well_formed_and_has_a_view_box() {
        let curve: Vec<[f64; 2]> =
            (0..200).map(|i| [f64::from(i), (f64::from(i) * 0.1).sin() * 1e6]).collect();
        let back: Vec<[f64; 2]> =
            (0..200).map(|i| [(f64::from(i) * 0.05).cos(), (f64::from(i) * 0.05).sin()]).collect();
        let base = || Plot::new("a <b> & \"c\"").x_axis(Axis::new("t", "s"));
        let lane = Lane {
            name: "latch 1".into(),
            bars: vec![Bar {
                range: 1.0..9.0,
                colour: Colour::Green,
                height: 1.0,
                label: "x".into(),
            }],
        };
        let plots = [
            base().line(Line::new("one", &curve).dash(Dash::Dotted)).span(Span::new(3.0..9.0)),
            base().y_axis(Axis::new("y", "N").log()).line(Line::new("log", &curve)),
            base().line(Line::new("loop", &back)).equal_aspect(),
            base().points(Points::new("p", &back)).marker(Marker::new(0.2, "here")),
            base().lane(lane).legend("latched", Colour::Green),
            base(),
            base().line(Line::new("", &[])),
        ];
        for p in plots {
            for embed in [Embed::Alone, Embed::Page] {
                let svg = p.svg(embed).unwrap();
                let doc = parse(&svg);
                assert!(doc.root_element().attribute("viewBox").is_some());
                assert_eq!(svg.contains("<style>"), embed == Embed::Alone);
                assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
            }
        }
        assert!(texts(&base().svg(Embed::Page).unwrap()).iter().any(|t| t.starts_with("no data")));
    }

    #[test]
    fn oracle_equal_aspect_makes_a_circle_round() {
        let round: Vec<[f64; 2]> =
            (0..=360).map(|i| f64::from(i).to_radians()).map(|a| [a.cos(), a.sin()]).collect();
        let svg = Plot::new("")
            .line(Line::new("", &round))
            .margin_left(60.0)
            .equal_aspect()
            .size(500.0, 200.0)
            .svg(Embed::Page)
            .unwrap();
        let p = paths(&svg, "dts0").concat();
        let extent = |k: usize| {
            let v = || p.iter().map(|q| q[k]);
            v().fold(f64::NEG_INFINITY, f64::max) - v().fold(f64::INFINITY, f64::min)
        };
        assert!((extent(0) / extent(1) - 1.0).abs() < 0.01, "{} {}", extent(0), extent(1));
    }

    #[test]
    fn invariant_the_name_of_the_vertical_axis_is_not_cut() {
        let points = [[0.0, -1e4], [1.0, 2e4]];
        for (name, height) in [("natural frequency", 80.0), ("gain", 200.0)] {
            let svg = Plot::new("")
                .y_axis(Axis::new(name, "kHz"))
                .line(Line::new("", &points))
                .size(300.0, height)
                .svg(Embed::Page)
                .unwrap();
            let doc = parse(&svg);
            let box_height: f64 = doc
                .root_element()
                .attribute("viewBox")
                .and_then(|b| b.split(' ').nth(3)?.parse().ok())
                .unwrap();
            let text = doc
                .descendants()
                .find(|n| n.attribute("transform").is_some_and(|t| t.starts_with("rotate")))
                .unwrap();
            let number = |k: &str| text.attribute(k).unwrap().parse::<f64>().unwrap();
            // Turned, the ascenders point left and the text runs upwards, both ways from the middle.
            assert!(number("x") + number("dy") - 0.8 * number("font-size") >= 3.0, "{svg}");
            let half = 0.5 * text_width(text.text().unwrap(), number("font-size"));
            assert!(
                number("y") - half >= 0.0 && number("y") + half <= box_height,
                "{name}: {half}"
            );
        }
    }

    #[test]
    fn invariant_labels_of_events_do_not_overlap() {
        let mut p = Plot::new("t").x_axis(Axis::new("t", "s").range(0.0..10.0)).size(380.0, 100.0);
        for (at, label) in [
            (5.0, "first contact"),
            (5.3, "peak force"),
            (5.301, "latch 1"),
            (6.0, "latch 2"),
            (9.8, "captured"),
        ] {
            p = p.marker(Marker::new(at, label));
        }
        let l = Layout::new(&p).unwrap();
        assert_eq!(l.labels.len(), 4, "two fall on each other and share a label");
        let span = |l: &Label| {
            let w = text_width(&l.text, 10.5);
            if matches!(l.anchor, HPos::Left) { (l.x, l.x + w) } else { (l.x - w, l.x) }
        };
        for (i, a) in l.labels.iter().enumerate() {
            assert!(span(a).0 >= 0.0 && span(a).1 <= 380.0);
            for b in &l.labels[i + 1..] {
                let apart = span(a).1 < span(b).0 || span(b).1 < span(a).0;
                assert!(apart || (a.row - b.row).abs() > 0.5, "{} {}", a.text, b.text);
            }
        }
    }

    #[test]
    fn invariant_what_cannot_be_drawn_is_an_error() {
        let bad = |p: Plot<'_>| p.svg(Embed::Page).unwrap_err().to_string();
        let axis = |a: Axis| Plot::new("").x_axis(a);
        assert!(bad(axis(Axis::new("x", "").range(1.0..1.0))).contains("two finite numbers"));
        assert!(bad(axis(Axis::new("x", "").range(f64::NAN..1.0))).contains("two finite"));
        assert!(bad(axis(Axis::new("x", "").range(0.0..1.0).log())).contains("above zero"));
        assert!(bad(Plot::new("").size(10.0, 10.0)).contains("160 to 4000"));
        let mixed = Plot::new("").line(Line::new("", &[])).lane(Lane::default());
        assert_eq!(mixed.svg(Embed::Page), Err(PlotError::Mixed));
    }
}
