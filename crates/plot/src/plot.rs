use core::ops::Range;

/// Colours that readers with any kind of colour vision tell apart (after Okabe and Ito), each with a
/// light and a dark variant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Colour {
    /// Blue; the passive side.
    Blue = 0,
    /// Vermilion; the active side.
    Vermilion = 1,
    /// Bluish green.
    Green = 2,
    /// Reddish purple.
    Purple = 3,
    /// Amber.
    Amber = 4,
    /// Sky blue.
    Sky = 5,
    /// As text.
    Ink = 6,
    /// Grey.
    Grey = 7,
}

impl Colour {
    /// All, in the order in which series take them.
    pub const ALL: [Self; 8] = [
        Self::Blue,
        Self::Vermilion,
        Self::Green,
        Self::Purple,
        Self::Amber,
        Self::Sky,
        Self::Ink,
        Self::Grey,
    ];

    /// The colour of series `i`, from the start again after the last.
    #[must_use]
    pub const fn of_series(i: usize) -> Self {
        Self::ALL[i % Self::ALL.len()]
    }
}

/// How a line is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Dash {
    /// Without gaps.
    #[default]
    Solid = 0,
    /// Long dashes.
    Dashed = 1,
    /// Dots.
    Dotted = 2,
    /// Dashes and dots.
    DashDot = 3,
}

/// What an axis measures and how.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Axis {
    pub(crate) name: String,
    pub(crate) unit: String,
    pub(crate) range: Option<[f64; 2]>,
    pub(crate) include: Vec<f64>,
    pub(crate) at_least: f64,
    pub(crate) log: bool,
}

impl Axis {
    /// An axis named, with its unit (empty for a pure number).
    #[must_use]
    pub fn new(name: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { name: name.into(), unit: unit.into(), ..Self::default() }
    }

    /// Shows exactly this range. Without it the range is that of the data.
    #[must_use]
    pub const fn range(mut self, range: Range<f64>) -> Self {
        self.range = Some([range.start, range.end]);
        self
    }

    /// Widens the range of the data so that it holds `value`.
    #[must_use]
    pub fn include(mut self, value: f64) -> Self {
        self.include.push(value);
        self
    }

    /// Widens the range of the data to at least `span`, so that rounding noise about a constant does
    /// not fill the plot.
    #[must_use]
    pub const fn at_least(mut self, span: f64) -> Self {
        self.at_least = span;
        self
    }

    /// Logarithmic; values ≤ 0 are gaps.
    #[must_use]
    pub const fn log(mut self) -> Self {
        self.log = true;
        self
    }
}

/// A line through points.
#[derive(Clone, Debug, PartialEq)]
pub struct Line<'a> {
    pub(crate) name: String,
    pub(crate) points: &'a [[f64; 2]],
    pub(crate) colour: Option<Colour>,
    pub(crate) dash: Dash,
    pub(crate) width: f64,
}

impl<'a> Line<'a> {
    /// A line with the name it has in the legend (none if empty). A point that is not finite makes
    /// a gap. Where x never falls, the line is thinned by [`crate::decimate`].
    #[must_use]
    pub fn new(name: impl Into<String>, points: &'a [[f64; 2]]) -> Self {
        Self { name: name.into(), points, colour: None, dash: Dash::Solid, width: 1.5 }
    }

    /// Its colour; without it, the next of [`Colour::ALL`].
    #[must_use]
    pub const fn colour(mut self, colour: Colour) -> Self {
        self.colour = Some(colour);
        self
    }

    /// Its dashes.
    #[must_use]
    pub const fn dash(mut self, dash: Dash) -> Self {
        self.dash = dash;
        self
    }

    /// Its width in units of the view box (1.5).
    #[must_use]
    pub const fn width(mut self, width: f64) -> Self {
        self.width = width;
        self
    }
}

/// Separate points.
#[derive(Clone, Debug, PartialEq)]
pub struct Points<'a> {
    pub(crate) name: String,
    pub(crate) points: &'a [[f64; 2]],
    pub(crate) colour: Option<Colour>,
    pub(crate) radius: f64,
}

impl<'a> Points<'a> {
    /// Points with the name they have in the legend (none if empty).
    #[must_use]
    pub fn new(name: impl Into<String>, points: &'a [[f64; 2]]) -> Self {
        Self { name: name.into(), points, colour: None, radius: 2.0 }
    }

    /// Their colour; without it, the next of [`Colour::ALL`].
    #[must_use]
    pub const fn colour(mut self, colour: Colour) -> Self {
        self.colour = Some(colour);
        self
    }

    /// Their radius in units of the view box (2).
    #[must_use]
    pub const fn radius(mut self, radius: f64) -> Self {
        self.radius = radius;
        self
    }
}

/// An event: a vertical line with a label above the plot. Labels of events that fall on each other
/// are joined, others are put into as many rows as they need.
#[derive(Clone, Debug, PartialEq)]
pub struct Marker {
    pub(crate) at: f64,
    pub(crate) label: String,
    pub(crate) colour: Colour,
}

impl Marker {
    /// At x; without a label (empty) it is a line only.
    #[must_use]
    pub fn new(at: f64, label: impl Into<String>) -> Self {
        Self { at, label: label.into(), colour: Colour::Grey }
    }

    /// Its colour (grey).
    #[must_use]
    pub const fn colour(mut self, colour: Colour) -> Self {
        self.colour = colour;
        self
    }
}

/// A shaded span of x.
#[derive(Clone, Debug, PartialEq)]
pub struct Span {
    pub(crate) range: [f64; 2],
    pub(crate) colour: Colour,
}

impl Span {
    /// From x to x.
    #[must_use]
    pub const fn new(range: Range<f64>) -> Self {
        Self { range: [range.start, range.end], colour: Colour::Grey }
    }

    /// Its colour (grey).
    #[must_use]
    pub const fn colour(mut self, colour: Colour) -> Self {
        self.colour = colour;
        self
    }
}

/// A bar of a [`Lane`].
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    /// From x to x.
    pub range: Range<f64>,
    /// Its colour.
    pub colour: Colour,
    /// Height as a share of the lane, 0 to 1.
    pub height: f64,
    /// Written into it where there is room.
    pub label: String,
}

/// A row of bars along x.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lane {
    /// Written at its left.
    pub name: String,
    /// The bars.
    pub bars: Vec<Bar>,
}

/// Where an SVG goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Embed {
    /// Into a file of its own: with background and style.
    Alone,
    /// Into an HTML page that holds [`crate::STYLE`].
    Page,
}

/// What cannot be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlotError {
    /// A range without extent, or with an end that is not finite.
    #[error("the axis `{axis}` goes from {from} to {to}; give two finite numbers that rise")]
    Range {
        /// Name of the axis.
        axis: String,
        /// Its start.
        from: f64,
        /// Its end.
        to: f64,
    },
    /// A logarithmic axis that reaches zero.
    #[error("the logarithmic axis `{axis}` begins at {from}; give it a start above zero")]
    Log {
        /// Name of the axis.
        axis: String,
        /// Its start.
        from: f64,
    },
    /// No room, or too much of it.
    #[error("a plot of {width} by {height} units; give 160 to 4000 by 20 to 4000")]
    Size {
        /// Width of the whole, units of the view box.
        width: f64,
        /// Height of the plot area, units of the view box.
        height: f64,
    },
    /// Lines and lanes in one plot.
    #[error("a plot has lines or lanes, not both; make two plots")]
    Mixed,
    /// The layout failed.
    #[error("the plot could not be laid out: {0}")]
    Layout(String),
}

/// A plot; see the [crate] for an example.
#[derive(Clone, Debug, PartialEq)]
pub struct Plot<'a> {
    pub(crate) title: String,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    pub(crate) lines: Vec<Line<'a>>,
    pub(crate) points: Vec<Points<'a>>,
    pub(crate) lanes: Vec<Lane>,
    pub(crate) legend: Vec<(String, Colour)>,
    pub(crate) markers: Vec<Marker>,
    pub(crate) spans: Vec<Span>,
    pub(crate) width: f64,
    pub(crate) height: f64,
    pub(crate) left: Option<f64>,
    pub(crate) equal: bool,
}

impl<'a> Plot<'a> {
    /// An empty plot.
    #[must_use]
    pub fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            x: Axis::default(),
            y: Axis::default(),
            lines: Vec::new(),
            points: Vec::new(),
            lanes: Vec::new(),
            legend: Vec::new(),
            markers: Vec::new(),
            spans: Vec::new(),
            width: 640.0,
            height: 220.0,
            left: None,
            equal: false,
        }
    }

    /// The horizontal axis.
    #[must_use]
    pub fn x_axis(mut self, axis: Axis) -> Self {
        self.x = axis;
        self
    }

    /// The vertical axis.
    #[must_use]
    pub fn y_axis(mut self, axis: Axis) -> Self {
        self.y = axis;
        self
    }

    /// Adds a line; later ones lie on top.
    #[must_use]
    pub fn line(mut self, line: Line<'a>) -> Self {
        self.lines.push(line);
        self
    }

    /// Adds points.
    #[must_use]
    pub fn points(mut self, points: Points<'a>) -> Self {
        self.points.push(points);
        self
    }

    /// Adds a lane below the others; a plot with lanes has no vertical axis.
    #[must_use]
    pub fn lane(mut self, lane: Lane) -> Self {
        self.lanes.push(lane);
        self
    }

    /// Adds an entry to the legend that no series stands for, such as the meaning of a bar's colour.
    #[must_use]
    pub fn legend(mut self, name: impl Into<String>, colour: Colour) -> Self {
        self.legend.push((name.into(), colour));
        self
    }

    /// Marks an event.
    #[must_use]
    pub fn marker(mut self, marker: Marker) -> Self {
        self.markers.push(marker);
        self
    }

    /// Shades a span.
    #[must_use]
    pub fn span(mut self, span: Span) -> Self {
        self.spans.push(span);
        self
    }

    /// Width of the whole and height of the plot area, in units of the view box; text is 12 units
    /// high. Title, legend and labels add to the height.
    #[must_use]
    pub const fn size(mut self, width: f64, height: f64) -> Self {
        self.width = width;
        self.height = height;
        self
    }

    /// Width left of the plot area, in units of the view box, so that plots below each other have
    /// their axes in line; without it, what the labels need.
    #[must_use]
    pub const fn margin_left(mut self, left: f64) -> Self {
        self.left = Some(left);
        self
    }

    /// One unit of x is as long as one unit of y; the smaller range is widened.
    #[must_use]
    pub const fn equal_aspect(mut self) -> Self {
        self.equal = true;
        self
    }
}
