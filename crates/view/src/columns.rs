//! Rows gathered in memory and sent as columns: a hundred times cheaper than logging them singly.

use docktwin_core::{DVec3, Pose};
use re_sdk_types::SerializedComponentColumn;
use re_sdk_types::archetypes::{
    Arrows3D, LineStrips3D, Points3D, Scalars, StateChange, TextDocument, TextLog, Transform3D,
};
use re_sdk_types::components::{LineStrip3D, MediaType, Radius};
use re_sdk_types::datatypes::Quaternion;

use crate::mesh::f32x3;
use crate::stream::Stream;
use crate::{ViewError, style};

fn send<E: core::fmt::Display, I: Iterator<Item = SerializedComponentColumn>>(
    rec: &Stream,
    path: &str,
    times: &[i64],
    columns: Result<I, E>,
) -> Result<(), ViewError> {
    let columns = columns.map_err(|e| ViewError::encode(path, e))?;
    rec.send_columns(path, times, columns).map_err(|e| ViewError::encode(path, e))
}

/// Poses of one entity.
#[derive(Default)]
pub(crate) struct Poses {
    times: Vec<i64>,
    p: Vec<[f32; 3]>,
    q: Vec<[f32; 4]>,
}

impl Poses {
    pub(crate) fn push(&mut self, time: i64, pose: &Pose) {
        self.times.push(time);
        self.p.push(f32x3(pose.p));
        self.q.push(pose.q.as_quat().to_array());
    }

    pub(crate) fn send(&mut self, rec: &Stream, path: &str) -> Result<(), ViewError> {
        if self.times.is_empty() {
            return Ok(());
        }
        let q = self.q.drain(..).map(Quaternion::from_xyzw);
        let columns = Transform3D::update_fields()
            .with_many_translation(self.p.drain(..))
            .with_many_quaternion(q)
            .columns_of_unit_batches();
        send(rec, path, &self.times, columns)?;
        self.times.clear();
        Ok(())
    }
}

/// Curves that share one plot.
#[derive(Default)]
pub(crate) struct Curves {
    times: Vec<i64>,
    values: Vec<f64>,
}

impl Curves {
    pub(crate) fn push(&mut self, time: i64, values: &[f64]) {
        self.times.push(time);
        self.values.extend_from_slice(values);
    }

    pub(crate) fn send(&mut self, rec: &Stream, path: &str) -> Result<(), ViewError> {
        if self.times.is_empty() {
            return Ok(());
        }
        let width = self.values.len() / self.times.len();
        let columns = Scalars::new(self.values.drain(..)).columns(vec![width; self.times.len()]);
        send(rec, path, &self.times, columns)?;
        self.times.clear();
        Ok(())
    }
}

/// Arrows of one entity: none, one or several at a time.
#[derive(Default)]
pub(crate) struct Arrows {
    times: Vec<i64>,
    lengths: Vec<usize>,
    origins: Vec<[f32; 3]>,
    vectors: Vec<[f32; 3]>,
    colours: Vec<u32>,
    open: usize,
    shown: bool,
}

impl Arrows {
    /// One arrow of the row to come.
    pub(crate) fn add(&mut self, origin: DVec3, vector: DVec3, colour: u32) {
        self.origins.push(f32x3(origin));
        self.vectors.push(f32x3(vector));
        self.colours.push(colour);
        self.open += 1;
    }

    /// Ends the row. An empty row after an empty one is not written: what was last logged holds.
    pub(crate) fn end_row(&mut self, time: i64) {
        if self.open > 0 || self.shown {
            self.times.push(time);
            self.lengths.push(self.open);
        }
        self.shown = self.open > 0;
        self.open = 0;
    }

    pub(crate) fn send(
        &mut self,
        rec: &Stream,
        path: &str,
        radius_ui_points: f32,
    ) -> Result<(), ViewError> {
        if self.times.is_empty() {
            return Ok(());
        }
        let n = self.origins.len();
        let arrows = Arrows3D::update_fields()
            .with_origins(self.origins.drain(..))
            .with_vectors(self.vectors.drain(..))
            .with_colors(self.colours.drain(..))
            .with_radii(vec![Radius::new_ui_points(radius_ui_points); n]);
        send(rec, path, &self.times, arrows.columns(self.lengths.iter().copied()))?;
        self.times.clear();
        self.lengths.clear();
        Ok(())
    }
}

/// Points of one entity; every row replaces the one before.
#[derive(Default)]
pub(crate) struct Points {
    times: Vec<i64>,
    lengths: Vec<usize>,
    positions: Vec<[f32; 3]>,
    colours: Vec<u32>,
}

impl Points {
    pub(crate) fn push(&mut self, time: i64, positions: &[[f32; 3]], colours: &[u32]) {
        self.times.push(time);
        self.lengths.push(positions.len());
        self.positions.extend_from_slice(positions);
        self.colours.extend_from_slice(colours);
    }

    pub(crate) fn send(
        &mut self,
        rec: &Stream,
        path: &str,
        radius: Radius,
    ) -> Result<(), ViewError> {
        if self.times.is_empty() {
            return Ok(());
        }
        let n = self.positions.len();
        let points = Points3D::update_fields()
            .with_positions(self.positions.drain(..))
            .with_colors(self.colours.drain(..))
            .with_radii(vec![radius; n]);
        send(rec, path, &self.times, points.columns(self.lengths.iter().copied()))?;
        self.times.clear();
        self.lengths.clear();
        Ok(())
    }
}

/// Texts in the scene, each at the end of a line that leads to what it speaks of.
#[derive(Default)]
pub(crate) struct Labels {
    times: Vec<i64>,
    lengths: Vec<usize>,
    texts: Vec<String>,
    at: Vec<[f32; 3]>,
    lines: Vec<LineStrip3D>,
    colours: Vec<u32>,
    open: usize,
}

impl Labels {
    /// One label of the row to come.
    pub(crate) fn add(&mut self, text: String, at: DVec3, points_to: DVec3, colour: u32) {
        self.texts.push(text);
        self.at.push(f32x3(at));
        self.lines.push(LineStrip3D::from([f32x3(at), f32x3(points_to)]));
        self.colours.push(colour);
        self.open += 1;
    }

    pub(crate) fn end_row(&mut self, time: i64) {
        self.times.push(time);
        self.lengths.push(core::mem::take(&mut self.open));
    }

    /// Texts go to `path/text`, lines to `path/line`.
    pub(crate) fn send(&mut self, rec: &Stream, path: &str) -> Result<(), ViewError> {
        if self.times.is_empty() {
            return Ok(());
        }
        let n = self.texts.len();
        let lengths = core::mem::take(&mut self.lengths);
        let texts = Points3D::update_fields()
            .with_positions(self.at.drain(..))
            .with_labels(self.texts.drain(..))
            .with_colors(self.colours.iter().copied())
            .with_radii(vec![Radius::new_ui_points(1.0); n])
            .columns(lengths.iter().copied());
        send(rec, &format!("{path}/text"), &self.times, texts)?;
        let lines = LineStrips3D::update_fields()
            .with_strips(self.lines.drain(..))
            .with_colors(self.colours.drain(..).map(|c| style::faded(c, 0x60)))
            .with_radii(vec![Radius::new_ui_points(0.5); n])
            .columns(lengths.iter().copied());
        send(rec, &format!("{path}/line"), &self.times, lines)?;
        self.times.clear();
        Ok(())
    }
}

/// Straight legs of one entity.
#[derive(Default)]
pub(crate) struct Legs {
    times: Vec<i64>,
    strips: Vec<LineStrip3D>,
    colours: Vec<u32>,
}

impl Legs {
    pub(crate) fn push(&mut self, time: i64, legs: impl Iterator<Item = ([DVec3; 2], u32)>) {
        self.times.push(time);
        for (ends, colour) in legs {
            self.strips.push(LineStrip3D::from(ends.map(f32x3)));
            self.colours.push(colour);
        }
    }

    pub(crate) fn send(
        &mut self,
        rec: &Stream,
        path: &str,
        radius_m: f32,
    ) -> Result<(), ViewError> {
        if self.strips.is_empty() {
            return Ok(());
        }
        let (n, rows) = (self.strips.len(), self.times.len());
        let strips = LineStrips3D::update_fields()
            .with_strips(self.strips.drain(..))
            .with_colors(self.colours.drain(..))
            .with_radii(vec![Radius::new_scene_units(radius_m); n]);
        send(rec, path, &self.times, strips.columns(vec![n / rows; rows]))?;
        self.times.clear();
        Ok(())
    }
}

/// Texts of one entity.
#[derive(Default)]
pub(crate) struct Texts {
    times: Vec<i64>,
    levels: Vec<String>,
    texts: Vec<String>,
}

impl Texts {
    pub(crate) fn push(&mut self, time: i64, level: &str, text: String) {
        self.times.push(time);
        self.levels.push(level.to_owned());
        self.texts.push(text);
    }

    pub(crate) fn send_states(&mut self, rec: &Stream, path: &str) -> Result<(), ViewError> {
        let texts = StateChange::new().with_state(self.texts.drain(..));
        self.finish(rec, path, texts.columns_of_unit_batches())
    }

    pub(crate) fn send_markdown(&mut self, rec: &Stream, path: &str) -> Result<(), ViewError> {
        let media = vec![MediaType::markdown(); self.texts.len()];
        let texts = TextDocument::update_fields()
            .with_many_text(self.texts.drain(..))
            .with_many_media_type(media);
        self.finish(rec, path, texts.columns_of_unit_batches())
    }

    pub(crate) fn send_log(&mut self, rec: &Stream, path: &str) -> Result<(), ViewError> {
        let texts = TextLog::update_fields()
            .with_many_text(self.texts.drain(..))
            .with_many_level(self.levels.drain(..));
        self.finish(rec, path, texts.columns_of_unit_batches())
    }

    fn finish<E: core::fmt::Display>(
        &mut self,
        rec: &Stream,
        path: &str,
        columns: Result<impl Iterator<Item = SerializedComponentColumn>, E>,
    ) -> Result<(), ViewError> {
        let times = core::mem::take(&mut self.times);
        self.levels.clear();
        if times.is_empty() { Ok(()) } else { send(rec, path, &times, columns) }
    }
}
