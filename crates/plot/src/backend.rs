//! Where plotters draws: SVG whose colours are classes of [`crate::STYLE`].

use core::convert::Infallible;
use core::fmt::Write as _;

use plotters_backend::text_anchor::{HPos, VPos};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingBackend, DrawingErrorKind,
    FontStyle, FontTransform,
};

use crate::plot::Dash;
use crate::theme;

/// plotters counts in whole units; one of ours is ten of them.
pub(crate) const FINE: f64 = 10.0;

/// Colour and dashes, as the three bytes that plotters carries through.
#[derive(Clone, Copy)]
pub(crate) struct Ink {
    pub(crate) number: u8,
    pub(crate) dash: Dash,
}

impl Ink {
    pub(crate) const fn of(number: u8) -> Self {
        Self { number, dash: Dash::Solid }
    }

    pub(crate) fn rgb(self) -> plotters::style::RGBColor {
        plotters::style::RGBColor(self.number, self.dash as u8, 0)
    }
}

pub(crate) struct Svg<'a> {
    pub(crate) body: &'a mut String,
    pub(crate) size: (u32, u32),
}

type Drawn = Result<(), DrawingErrorKind<Infallible>>;

/// Tenths as decimals.
struct Tenths(i32);

impl core::fmt::Display for Tenths {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let (whole, part) = (self.0.abs() / 10, self.0.abs() % 10);
        let sign = if self.0 < 0 { "-" } else { "" };
        match (whole, part) {
            (w, 0) => write!(f, "{sign}{w}"),
            (0, p) => write!(f, "{sign}.{p}"),
            (w, p) => write!(f, "{sign}{w}.{p}"),
        }
    }
}

fn opacity(c: BackendColor) -> String {
    if c.alpha < 1.0 { format!(" opacity=\"{:.2}\"", c.alpha) } else { String::new() }
}

fn stroke(c: BackendColor, width: u32) -> String {
    let n = c.rgb.0;
    let dashes = match c.rgb.1 {
        1 => " stroke-dasharray=\"7 4\"",
        2 => " stroke-dasharray=\"1.5 3\"",
        3 => " stroke-dasharray=\"8 3 1.5 3\"",
        _ => "",
    };
    format!(
        " class=\"dts{n}\" stroke=\"{}\" stroke-width=\"{}\"{dashes}{}",
        theme::light(n),
        Tenths(i32::try_from(width).unwrap_or(10)),
        opacity(c)
    )
}

fn fill(c: BackendColor) -> String {
    let n = c.rgb.0;
    format!(" class=\"dtf{n}\" fill=\"{}\"{}", theme::light(n), opacity(c))
}

/// A path through points, in steps from one to the next, which are short to write.
fn path(points: impl IntoIterator<Item = BackendCoord>) -> String {
    let mut d = String::new();
    let mut last: Option<BackendCoord> = None;
    for (x, y) in points {
        // Writing to a String cannot fail.
        let _ = match last {
            None => write!(d, "M{} {}l", Tenths(x), Tenths(y)),
            Some((x0, y0)) => {
                let (dx, dy) = (Tenths(x - x0), Tenths(y - y0));
                let before = if d.ends_with('l') || x < x0 { "" } else { " " };
                let between = if y < y0 { "" } else { " " };
                write!(d, "{before}{dx}{between}{dy}")
            }
        };
        last = Some((x, y));
    }
    d
}

pub(crate) fn escape(text: &str) -> String {
    text.chars().fold(String::with_capacity(text.len()), |mut out, c| {
        match c {
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '&' => out.push_str("&amp;"),
            '"' => out.push_str("&quot;"),
            // XML has no other control characters.
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
        out
    })
}

impl DrawingBackend for Svg<'_> {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        self.size
    }

    fn ensure_prepared(&mut self) -> Drawn {
        Ok(())
    }

    fn present(&mut self) -> Drawn {
        Ok(())
    }

    fn draw_pixel(&mut self, at: BackendCoord, c: BackendColor) -> Drawn {
        self.draw_rect(at, (at.0 + 1, at.1 + 1), &c, true)
    }

    fn draw_line<S: BackendStyle>(
        &mut self,
        from: BackendCoord,
        to: BackendCoord,
        style: &S,
    ) -> Drawn {
        self.draw_path([from, to], style)
    }

    fn draw_rect<S: BackendStyle>(
        &mut self,
        a: BackendCoord,
        b: BackendCoord,
        style: &S,
        filled: bool,
    ) -> Drawn {
        let c = style.color();
        if c.alpha > 0.0 {
            let paint = if filled {
                fill(c)
            } else {
                format!(" fill=\"none\"{}", stroke(c, style.stroke_width()))
            };
            let _ = write!(
                self.body,
                "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"{paint}/>",
                Tenths(a.0.min(b.0)),
                Tenths(a.1.min(b.1)),
                Tenths((b.0 - a.0).abs()),
                Tenths((b.1 - a.1).abs()),
            );
        }
        Ok(())
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        points: I,
        style: &S,
    ) -> Drawn {
        let c = style.color();
        let d = path(points);
        if c.alpha > 0.0 && !d.ends_with('l') && !d.is_empty() {
            let paint = stroke(c, style.stroke_width());
            let _ = write!(
                self.body,
                "<path d=\"{d}\" fill=\"none\" stroke-linejoin=\"round\"{paint}/>"
            );
        }
        Ok(())
    }

    fn draw_circle<S: BackendStyle>(
        &mut self,
        centre: BackendCoord,
        radius: u32,
        style: &S,
        filled: bool,
    ) -> Drawn {
        let c = style.color();
        if c.alpha > 0.0 {
            let paint = if filled {
                fill(c)
            } else {
                format!(" fill=\"none\"{}", stroke(c, style.stroke_width()))
            };
            let _ = write!(
                self.body,
                "<circle cx=\"{}\" cy=\"{}\" r=\"{}\"{paint}/>",
                Tenths(centre.0),
                Tenths(centre.1),
                Tenths(i32::try_from(radius).unwrap_or(10)),
            );
        }
        Ok(())
    }

    fn fill_polygon<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        points: I,
        style: &S,
    ) -> Drawn {
        let c = style.color();
        let d = path(points);
        if c.alpha > 0.0 && !d.ends_with('l') && !d.is_empty() {
            let _ = write!(self.body, "<path d=\"{d}z\"{}/>", fill(c));
        }
        Ok(())
    }

    fn draw_text<S: BackendTextStyle>(
        &mut self,
        text: &str,
        style: &S,
        (x, y): BackendCoord,
    ) -> Drawn {
        let anchor = match style.anchor().h_pos {
            HPos::Left => "",
            HPos::Right => " text-anchor=\"end\"",
            HPos::Center => " text-anchor=\"middle\"",
        };
        let dy = match style.anchor().v_pos {
            VPos::Top => 0.76,
            VPos::Center => 0.35,
            VPos::Bottom => -0.22,
        };
        let turn = match style.transform() {
            FontTransform::None => None,
            FontTransform::Rotate90 => Some(90),
            FontTransform::Rotate180 => Some(180),
            FontTransform::Rotate270 => Some(270),
        };
        let turn = turn.map_or(String::new(), |a| {
            format!(" transform=\"rotate({a} {} {})\"", Tenths(x), Tenths(y))
        });
        let bold =
            if matches!(style.style(), FontStyle::Bold) { " font-weight=\"600\"" } else { "" };
        let size = style.size() / FINE;
        let _ = write!(
            self.body,
            "<text x=\"{}\" y=\"{}\" dy=\"{:.1}\" font-size=\"{size:.1}\" \
             font-family=\"sans-serif\"{anchor}{bold}{turn}{}>{}</text>",
            Tenths(x),
            Tenths(y),
            dy * size,
            fill(style.color()),
            escape(text),
        );
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_paths_are_short_and_exact() {
        assert_eq!(path([(10, 20), (15, 18), (12, 30), (112, 30)]), "M1 2l.5-.2-.3 1.2 10 0");
        assert_eq!(Tenths(-7).to_string(), "-.7");
        assert_eq!(escape("a<b & \"c\"\u{1}"), "a&lt;b &amp; &quot;c&quot; ");
    }
}
