//! What `rig identify` and `rig calibrate` write, dated, and runs refer to by digest.

use std::path::{Path, PathBuf};

use docktwin_core::{DMat3, DQuat, DVec3, Digest, Pose, Wrench};
use docktwin_hil::{
    calibrate::{Calibration, SensorB},
    identify::{Identification, LegPass, Pass, ResponsePoint, ValvePass},
};
use docktwin_model::{HydraulicPreset, Rig};
use docktwin_physics::mounted::Payload;
use jiff::Timestamp;
use serde::{Deserialize, Serialize, de::DeserializeOwned};

/// Version of both files.
const SCHEMA: u32 = 1;
/// Degrees of freedom by name.
pub const DOFS: [&str; 6] = ["x", "y", "z", "roll", "pitch", "yaw"];
/// A day, s.
const DAY_S: f64 = 86_400.0;
/// A file larger than this is none of ours.
const MOST_BYTES: u64 = 1 << 20;

/// Why such a file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum RigFileError {
    /// Not readable.
    #[error("it cannot be read ({why}): {}", path.display())]
    Read {
        /// Where.
        path: PathBuf,
        /// As the system says it.
        why: String,
    },
    /// Not what it should be.
    #[error("it is not a file of `docktwin rig {command}` ({why}): {}", path.display())]
    Content {
        /// What writes such files.
        command: &'static str,
        /// Line and key.
        why: String,
        /// Where.
        path: PathBuf,
    },
    /// A number out of range.
    #[error(
        "{key} is {value}, which no rig has; run `docktwin rig {command}` again: {}",
        path.display()
    )]
    Value {
        /// What writes such files.
        command: &'static str,
        /// Which.
        key: String,
        /// Its value.
        value: f64,
        /// Where.
        path: PathBuf,
    },
    /// Of another rig.
    #[error(
        "it was made for a rig file of digest {made_for}, and this one has {is}: run `docktwin rig \
         {command}` again for this rig"
    )]
    Rig {
        /// What writes such files.
        command: &'static str,
        /// Digest in the file.
        made_for: String,
        /// Digest of the rig.
        is: String,
    },
    /// Not writable.
    #[error("it cannot be written ({why}), give a new file with --out: {}", path.display())]
    Write {
        /// Where.
        path: PathBuf,
        /// As the system says it.
        why: String,
    },
}

/// How the file came to be.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// Instant, UTC, as 2026-11-22T10:15:00Z.
    pub made_utc: String,
    /// Version of docktwin.
    pub tool_version: String,
    /// Name of the rig.
    pub rig: String,
    /// Digest of the rig's URDF and TOML.
    pub rig_digest: String,
    /// `emulated` or `ipc:NAME`.
    pub port: String,
    /// Oil that controllers believe in, `none` for a rig without.
    pub preset: String,
    /// Seed of an emulated rig's noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Seed of an emulated rig's draw.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub perturb: Option<u64>,
    /// `p_34` where it was measured, m.
    pub place_m: [f64; 3],
    /// `R_34` there: w, x, y, z.
    pub place_attitude: [f64; 4],
}

impl Origin {
    /// Of now, for a rig.
    #[must_use]
    pub fn now(rig: &Rig, preset: HydraulicPreset, port: &str, place: &Pose) -> Self {
        let q = place.q;
        Self {
            made_utc: Timestamp::now().strftime("%Y-%m-%dT%H:%M:%SZ").to_string(),
            tool_version: env!("CARGO_PKG_VERSION").to_owned(),
            rig: rig.name.clone(),
            rig_digest: rig.digest.to_string(),
            port: port.to_owned(),
            preset: rig.oil_word(preset).to_owned(),
            seed: None,
            perturb: None,
            place_m: place.p.to_array(),
            place_attitude: [q.w, q.x, q.y, q.z],
        }
    }

    /// Days since it was made; infinitely many when the instant is none.
    #[must_use]
    pub fn age_days(&self) -> f64 {
        let made: Result<Timestamp, _> = self.made_utc.parse();
        made.map_or(f64::INFINITY, |t| Timestamp::now().duration_since(t).as_secs_f64() / DAY_S)
    }

    fn place(&self) -> Pose {
        let [w, x, y, z] = self.place_attitude;
        Pose::new(DVec3::from_array(self.place_m), DQuat::from_xyzw(x, y, z, w).normalize())
    }
}

/// A leg as identified.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LegRecord {
    /// Null bias, part of full stroke; of a leg with a valve, as all keys that may be absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub null_bias: Option<f64>,
    /// Flow gain over what the controller believes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flow_gain: Option<f64>,
    /// Speed with the valve fully open, as believed, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_load_speed_m_s: Option<f64>,
    /// Sliding friction, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub friction_n: Option<f64>,
    /// Length error at standstill, m.
    pub hold_error_m: f64,
    /// Lag on a slow move, s.
    pub lag_s: f64,
    /// The same with corrections: what is left.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub corrected_null_bias: Option<f64>,
    /// See `corrected_null_bias`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub corrected_flow_gain: Option<f64>,
    /// See `corrected_null_bias`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub corrected_friction_n: Option<f64>,
    /// See `corrected_null_bias`; without valves as found.
    pub corrected_hold_error_m: f64,
    /// See `corrected_null_bias`; without valves as found.
    pub corrected_lag_s: f64,
}

/// A point of G_MSim.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResponseRecord {
    /// Degree of freedom, of [`DOFS`].
    pub dof: String,
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Amplitude of a translation, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub amplitude_m: Option<f64>,
    /// Amplitude of a rotation, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub amplitude_rad: Option<f64>,
    /// Gain.
    pub gain: f64,
    /// Phase, degrees; late is negative.
    pub phase_deg: f64,
    /// Largest response of another degree of freedom.
    pub coupling: f64,
    /// What does not swing with the drive, over the amplitude.
    pub rest: f64,
}

/// File of `rig identify`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IdentificationFile {
    /// 1.
    pub schema: u32,
    /// `rig_identification`.
    pub kind: String,
    /// How it came to be.
    pub origin: Origin,
    /// From the instant a command is for to the instant the plate is there, s.
    pub delay_s: f64,
    /// The same without corrections: what a ramp alone would have told.
    pub uncorrected_lag_s: f64,
    /// Legs 0 to 5; none where their lengths are not measured.
    #[serde(default)]
    pub leg: Vec<LegRecord>,
    /// G_MSim.
    #[serde(default)]
    pub response: Vec<ResponseRecord>,
}

/// File of `rig calibrate`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibrationFile {
    /// 1.
    pub schema: u32,
    /// `rig_calibration`.
    pub kind: String,
    /// How it came to be.
    pub origin: Origin,
    /// Reading of A with nothing touching, N.
    pub tare_a_n: [f64; 3],
    /// The same, moments, N·m.
    pub tare_a_nm: [f64; 3],
    /// Zero of B, N. What is of B is missing where there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zero_b_n: Option<[f64; 3]>,
    /// The same, moments, N·m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zero_b_nm: Option<[f64; 3]>,
    /// What B carries, kg.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub payload_mass_kg: Option<f64>,
    /// Its mass centre from B, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub payload_com_m: Option<[f64; 3]>,
    /// Its inertia about its mass centre, kg·m².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub payload_inertia_kg_m2: Option<[[f64; 3]; 3]>,
    /// Delay of A's readings against positions of the same stamp, beyond its second order, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delay_a_s: Option<f64>,
    /// The same of B.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delay_b_s: Option<f64>,
    /// The same of the accelerometers, where the rig has them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delay_accelerometers_s: Option<f64>,
    /// What is left unexplained of B, root mean square, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rest_n: Option<f64>,
    /// The same, moments, N·m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rest_nm: Option<f64>,
}

/// A file as read.
#[derive(Clone, Debug, PartialEq)]
pub struct Read<T> {
    /// What it says.
    pub content: T,
    /// Digest of its bytes, by which runs refer to it.
    pub digest: Digest,
    /// Where it was read.
    pub path: PathBuf,
}

/// What both files have in common.
pub trait RigFile: Serialize + DeserializeOwned {
    /// `kind` in the file.
    const KIND: &'static str;
    /// What writes it.
    const COMMAND: &'static str;

    /// Schema and kind as read.
    fn head(&self) -> (u32, &str);

    /// How it came to be.
    fn origin(&self) -> &Origin;

    /// Numbers with the range that they may have.
    fn numbers(&self) -> Vec<(String, f64, [f64; 2])>;

    /// What does not belong together.
    fn torn(&self) -> Option<String> {
        None
    }
}

impl RigFile for IdentificationFile {
    const KIND: &'static str = "rig_identification";
    const COMMAND: &'static str = "identify";

    fn head(&self) -> (u32, &str) {
        (self.schema, &self.kind)
    }

    fn origin(&self) -> &Origin {
        &self.origin
    }

    fn numbers(&self) -> Vec<(String, f64, [f64; 2])> {
        let mut out = vec![("delay_s".to_owned(), self.delay_s, [-0.01, 0.1])];
        // A missing leg is told as a number of legs.
        #[expect(clippy::cast_precision_loss, reason = "a handful")]
        let legs = self.leg.len() as f64;
        if !self.leg.is_empty() {
            out.push(("number of legs".to_owned(), legs, [6.0, 6.0]));
        }
        for (i, l) in self.leg.iter().enumerate() {
            let valve = [
                ("null_bias", l.null_bias, [-0.2, 0.2]),
                ("flow_gain", l.flow_gain, [0.2, 5.0]),
                ("no_load_speed_m_s", l.no_load_speed_m_s, [1e-3, 100.0]),
            ];
            let given = valve.into_iter().filter_map(|(key, x, range)| Some((key, x?, range)));
            out.extend(given.map(|(key, x, range)| (format!("leg.{i}.{key}"), x, range)));
        }
        for (i, r) in self.response.iter().enumerate() {
            let known = DOFS.contains(&r.dof.as_str());
            out.push((format!("response.{i}.dof"), f64::from(u8::from(known)), [1.0, 1.0]));
            out.push((format!("response.{i}.frequency_hz"), r.frequency_hz, [1e-3, 1e3]));
            out.push((format!("response.{i}.gain"), r.gain, [0.0, 100.0]));
            out.push((format!("response.{i}.phase_deg"), r.phase_deg, [-180.0, 180.0]));
        }
        out
    }
}

impl RigFile for CalibrationFile {
    const KIND: &'static str = "rig_calibration";
    const COMMAND: &'static str = "calibrate";

    fn head(&self) -> (u32, &str) {
        (self.schema, &self.kind)
    }

    fn origin(&self) -> &Origin {
        &self.origin
    }

    fn torn(&self) -> Option<String> {
        let of_b = [
            self.zero_b_n.is_some(),
            self.zero_b_nm.is_some(),
            self.payload_mass_kg.is_some(),
            self.payload_com_m.is_some(),
            self.payload_inertia_kg_m2.is_some(),
            self.delay_b_s.is_some(),
            self.rest_n.is_some(),
            self.rest_nm.is_some(),
        ];
        match of_b.iter().filter(|x| **x).count() {
            0 if self.delay_a_s.is_none() => Some("it tells of neither sensor".to_owned()),
            0 => None,
            n if n == of_b.len() => None,
            _ => Some("it has a part of what is of sensor B, and not all of it".to_owned()),
        }
    }

    fn numbers(&self) -> Vec<(String, f64, [f64; 2])> {
        let mut out = vec![
            ("payload_mass_kg".to_owned(), self.payload_mass_kg.unwrap_or(1.0), [1e-6, 1e6]),
            ("delay_b_s".to_owned(), self.delay_b_s.unwrap_or(0.0), [-0.01, 0.1]),
            ("delay_a_s".to_owned(), self.delay_a_s.unwrap_or(0.0), [-0.01, 0.1]),
            (
                "delay_accelerometers_s".to_owned(),
                self.delay_accelerometers_s.unwrap_or(0.0),
                [-0.01, 0.1],
            ),
        ];
        let vectors = [
            ("tare_a_n", self.tare_a_n),
            ("tare_a_nm", self.tare_a_nm),
            ("zero_b_n", self.zero_b_n.unwrap_or_default()),
            ("zero_b_nm", self.zero_b_nm.unwrap_or_default()),
            ("payload_com_m", self.payload_com_m.unwrap_or_default()),
        ];
        let inertia = self.payload_inertia_kg_m2.unwrap_or_default();
        let rows = inertia.map(|r| ("payload_inertia_kg_m2", r));
        for (key, v) in vectors.into_iter().chain(rows) {
            out.extend(v.map(|x| (key.to_owned(), x, [-1e6, 1e6])));
        }
        out
    }
}

/// Reads such a file; unknown keys are refused.
///
/// # Errors
/// See [`RigFileError`].
pub fn read<T: RigFile>(path: &Path) -> Result<Read<T>, RigFileError> {
    let unread = |why: String| RigFileError::Read { path: path.to_owned(), why };
    let size = std::fs::metadata(path).map_err(|e| unread(e.to_string()))?.len();
    if size > MOST_BYTES {
        return Err(unread(format!("{size} bytes are too many")));
    }
    let bytes = std::fs::read(path).map_err(|e| unread(e.to_string()))?;
    let digest = Digest::of_bytes(&bytes);
    let content =
        |why: String| RigFileError::Content { command: T::COMMAND, why, path: path.to_owned() };
    let text = String::from_utf8(bytes).map_err(|e| content(e.to_string()))?;
    let found: T = toml::from_str(&text).map_err(|e| content(e.to_string().trim().to_owned()))?;
    let (schema, kind) = found.head();
    if schema != SCHEMA || kind != T::KIND {
        return Err(content(format!("it is `{kind}`, schema {schema}")));
    }
    if let Some(why) = found.torn() {
        return Err(content(why));
    }
    for (key, value, [least, most]) in found.numbers() {
        if !(least..=most).contains(&value) {
            let path = path.to_owned();
            return Err(RigFileError::Value { command: T::COMMAND, key, value, path });
        }
    }
    Ok(Read { content: found, digest, path: path.to_owned() })
}

impl<T: RigFile> Read<T> {
    /// Whether it was made for this rig.
    ///
    /// # Errors
    /// [`RigFileError::Rig`].
    pub fn made_for(&self, rig: &Rig) -> Result<(), RigFileError> {
        let (made_for, is) = (&self.content.origin().rig_digest, rig.digest.to_string());
        if *made_for == is {
            return Ok(());
        }
        Err(RigFileError::Rig { command: T::COMMAND, made_for: made_for.clone(), is })
    }
}

/// Writes such a file; one that is there is never overwritten.
///
/// # Errors
/// [`RigFileError::Write`].
pub fn write<T: RigFile>(path: &Path, content: &T) -> Result<Digest, RigFileError> {
    let failed = |why: String| RigFileError::Write { path: path.to_owned(), why };
    let text = toml::to_string(content).map_err(|e| failed(e.to_string()))?;
    let text = format!(
        "# Written by `docktwin rig {}`. Every unit stands in its key.\n{text}",
        T::COMMAND
    );
    write_new(path, &text)
}

/// Makes a folder and sees whether a file can be made in it.
///
/// # Errors
/// What the operating system says.
pub fn can_write_in(folder: &Path) -> std::io::Result<()> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    std::fs::create_dir_all(folder)?;
    let probe = folder.join(format!(".docktwin-{}", std::process::id()));
    std::fs::File::create_new(&probe)?;
    std::fs::remove_file(probe)
}

/// Writes a text; a file that is there is never overwritten.
///
/// # Errors
/// [`RigFileError::Write`].
pub fn write_new(path: &Path, text: &str) -> Result<Digest, RigFileError> {
    let failed = |why: String| RigFileError::Write { path: path.to_owned(), why };
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(|e| failed(e.to_string()))?;
    }
    let file = std::fs::File::create_new(path);
    let written = file.and_then(|mut f| std::io::Write::write_all(&mut f, text.as_bytes()));
    written.map_err(|e| failed(e.to_string()))?;
    Ok(Digest::of_bytes(text.as_bytes()))
}

impl IdentificationFile {
    /// Of a rig as identified.
    #[must_use]
    pub fn new(origin: Origin, found: &Identification) -> Self {
        let (a, b) = (&found.found, &found.corrected);
        let valves = (a.valves, b.valves);
        let leg = |(i, a, b): (usize, &LegPass, &LegPass)| LegRecord {
            null_bias: valves.0.map(|v| v.null_bias[i]),
            flow_gain: valves.0.map(|v| v.flow_gain[i]),
            no_load_speed_m_s: found.no_load_speed_m_s.map(|v| v[i]),
            friction_n: valves.0.map(|v| v.friction_n[i]),
            hold_error_m: a.hold_error_m[i],
            lag_s: a.lag_s[i],
            corrected_null_bias: valves.1.map(|v| v.null_bias[i]),
            corrected_flow_gain: valves.1.map(|v| v.flow_gain[i]),
            corrected_friction_n: valves.1.map(|v| v.friction_n[i]),
            corrected_hold_error_m: b.hold_error_m[i],
            corrected_lag_s: b.lag_s[i],
        };
        let legs = a.legs.as_ref().zip(b.legs.as_ref());
        let response = found.response.iter().map(|p| ResponseRecord {
            dof: DOFS[p.dof % 6].to_owned(),
            frequency_hz: p.hz,
            amplitude_m: (p.dof < 3).then_some(p.amplitude),
            amplitude_rad: (p.dof >= 3).then_some(p.amplitude),
            gain: p.gain.norm(),
            phase_deg: p.gain.arg().to_degrees(),
            coupling: p.coupling,
            rest: p.rest,
        });
        Self {
            schema: SCHEMA,
            kind: Self::KIND.to_owned(),
            origin,
            delay_s: found.delay_s(),
            uncorrected_lag_s: a.lag_s,
            leg: legs.map_or_else(Vec::new, |(a, b)| (0..6).map(|i| leg((i, a, b))).collect()),
            response: response.collect(),
        }
    }

    /// The response as the `[drive]` table of a rig's file whose drive is `measured`.
    #[must_use]
    pub fn drive_table(&self) -> String {
        let note = format!("rig identify of {}, rig {}", self.origin.made_utc, self.origin.rig);
        let rows: String = self
            .response
            .iter()
            .map(|r| format!("  [{}, {:.6}, {:.4}],\n", r.frequency_hz, r.gain, r.phase_deg))
            .collect();
        format!(
            "[drive]\nkind = \"measured\"\nlag_s = {{ value = {:.7}, source = \"{note}\" }}\n\
             response_hz_1_deg = {{ value = [\n{rows}], source = \"{note}\" }}\n",
            self.delay_s
        )
    }

    /// The rig as identified. `None` when there are neither six legs nor none, or a leg lacks what another has.
    #[must_use]
    pub fn identification(&self) -> Option<Identification> {
        let legs: Option<&[LegRecord; 6]> = match self.leg.as_slice() {
            [] => None,
            legs => Some(legs.try_into().ok()?),
        };
        let of = |read: fn(&LegRecord) -> f64| legs.map(|l| l.each_ref().map(read));
        let (here, there) = (valves(legs, false)?, valves(legs, true)?);
        let response = self.response.iter().map(|r| {
            let dof = DOFS.iter().position(|d| *d == r.dof)?;
            let phase = r.phase_deg.to_radians();
            Some(ResponsePoint {
                dof,
                hz: r.frequency_hz,
                amplitude: r.amplitude_m.or(r.amplitude_rad)?,
                gain: docktwin_hil::identify::polar(r.gain, phase),
                coupling: r.coupling,
                rest: r.rest,
            })
        });
        Some(Identification {
            found: Pass {
                valves: here.map(|v| v.0),
                legs: of(|l| l.hold_error_m)
                    .zip(of(|l| l.lag_s))
                    .map(|(hold_error_m, lag_s)| LegPass { hold_error_m, lag_s }),
                lag_s: self.uncorrected_lag_s,
            },
            corrected: Pass {
                valves: there.map(|v| v.0),
                legs: of(|l| l.corrected_hold_error_m)
                    .zip(of(|l| l.corrected_lag_s))
                    .map(|(hold_error_m, lag_s)| LegPass { hold_error_m, lag_s }),
                lag_s: self.delay_s,
            },
            no_load_speed_m_s: here.map(|v| v.1),
            place: self.origin.place(),
            response: response.collect::<Option<_>>()?,
        })
    }
}

/// Valves of all six legs, as found or as corrected, and their speeds fully open; none where no leg has one, and
/// no answer where one leg lacks what another has.
type Valves = Option<(ValvePass, [f64; 6])>;

fn valves(legs: Option<&[LegRecord; 6]>, corrected: bool) -> Option<Valves> {
    let Some(legs) = legs else { return Some(None) };
    let of = |l: &LegRecord| {
        let found = [l.null_bias, l.flow_gain, l.friction_n];
        let left = [l.corrected_null_bias, l.corrected_flow_gain, l.corrected_friction_n];
        let [bias, gain, friction] = if corrected { left } else { found };
        [bias, gain, friction, l.no_load_speed_m_s]
    };
    let rows = legs.each_ref().map(of);
    if rows.iter().flatten().all(Option::is_none) {
        return Some(None);
    }
    let mut out = [[0.0; 6]; 4];
    for (i, row) in rows.iter().enumerate() {
        for (out, x) in out.iter_mut().zip(row) {
            out[i] = (*x)?;
        }
    }
    let [null_bias, flow_gain, friction_n, full] = out;
    Some(Some((ValvePass { null_bias, flow_gain, friction_n }, full)))
}

impl CalibrationFile {
    /// Of sensors as calibrated.
    #[must_use]
    pub fn new(origin: Origin, found: &Calibration) -> Self {
        let b = found.of_b;
        Self {
            schema: SCHEMA,
            kind: Self::KIND.to_owned(),
            origin,
            tare_a_n: found.tare_a.f.to_array(),
            tare_a_nm: found.tare_a.m.to_array(),
            zero_b_n: b.map(|b| b.zero.f.to_array()),
            zero_b_nm: b.map(|b| b.zero.m.to_array()),
            payload_mass_kg: b.map(|b| b.payload.mass_kg),
            payload_com_m: b.map(|b| b.payload.com_m.to_array()),
            payload_inertia_kg_m2: b
                .map(|b| b.payload.inertia_kg_m2.transpose().to_cols_array_2d()),
            delay_a_s: found.delay_a_s,
            delay_b_s: b.map(|b| b.delay_s),
            delay_accelerometers_s: found.accelerometer_delay_s,
            rest_n: b.map(|b| b.rest[0]),
            rest_nm: b.map(|b| b.rest[1]),
        }
    }

    /// The sensors as calibrated.
    #[must_use]
    pub fn calibration(&self) -> Calibration {
        let wrench =
            |f: [f64; 3], m: [f64; 3]| Wrench { f: DVec3::from_array(f), m: DVec3::from_array(m) };
        Calibration {
            place: self.origin.place(),
            tare_a: wrench(self.tare_a_n, self.tare_a_nm),
            delay_a_s: self.delay_a_s,
            of_b: self.of_b(&wrench),
            accelerometer_delay_s: self.delay_accelerometers_s,
        }
    }

    /// Sensor B; `None` where the file does not have all of it.
    fn of_b(&self, wrench: &impl Fn([f64; 3], [f64; 3]) -> Wrench) -> Option<SensorB> {
        Some(SensorB {
            zero: wrench(self.zero_b_n?, self.zero_b_nm?),
            payload: Payload {
                mass_kg: self.payload_mass_kg?,
                com_m: DVec3::from_array(self.payload_com_m?),
                inertia_kg_m2: DMat3::from_cols_array_2d(&self.payload_inertia_kg_m2?).transpose(),
            },
            delay_s: self.delay_b_s?,
            rest: [self.rest_n?, self.rest_nm?],
        })
    }
}
