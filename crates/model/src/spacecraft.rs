use docktwin_core::{DMat3, Digest, Pose};

/// A rigid spacecraft: chaser (`e1`) or target (`e2`).
#[derive(Clone, Debug, PartialEq)]
pub struct Spacecraft {
    /// Robot name of the URDF.
    pub name: String,
    /// Mass, kg; of the chaser without the docking ring, which is a body of its own.
    pub mass_kg: f64,
    /// Inertia about the mass centre in body axes (`e1` or `e2`), kg·m²; full tensor, symmetric,
    /// positive definite, principal moments obeying the triangle inequality.
    pub inertia_kg_m2: DMat3,
    /// Mounting plane of the docking mechanism in the body frame: `X_13` or `X_24`.
    pub x_body_port: Pose,
    /// Digest of the URDF and its TOML.
    pub digest: Digest,
}

/// What is drawn of a spacecraft: a cylinder along X about the origin of its root link. No physics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpacecraftHull {
    /// Radius, m.
    pub radius_m: f64,
    /// Length, m.
    pub length_m: f64,
}
