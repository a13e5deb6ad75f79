//! Writes `meshes/` again from the parameters of the models. Called by `cargo xtask meshes`.

use std::{path::Path, process::ExitCode};

use docktwin_model::mesh;

fn main() -> ExitCode {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    match mesh::write_all(&root.join("models/urdf"), &root.join("meshes")) {
        Ok(written) => {
            for path in &written {
                println!("{}", path.strip_prefix(&root).unwrap_or(path).display());
            }
            println!("{} meshes written", written.len());
            ExitCode::SUCCESS
        }
        Err(e) => {
            eprintln!("{e}");
            ExitCode::FAILURE
        }
    }
}
