//! What commands read: `--set`, and files that belong together.

use std::path::{Path, PathBuf};

use docktwin_model::input::shown;
use docktwin_scenario::Loader;

use crate::failure::Failure;

/// `--set key.path=value` as pairs.
pub(crate) fn overrides(set: &[String]) -> Result<Vec<(String, String)>, Failure> {
    set.iter()
        .map(|s| {
            s.split_once('=').map(|(k, v)| (k.trim().to_owned(), v.trim().to_owned())).ok_or_else(
                || Failure::Usage {
                    what: format!("`--set {}` has no `=`", shown(s)),
                    remedy: "write it as --set key.path=value, for example \
                             --set initial.lateral_y_m=0.1"
                        .to_owned(),
                },
            )
        })
        .collect()
}

/// Reads scenarios with `--set` applied.
pub(crate) fn loader(set: &[String]) -> Result<Loader, Failure> {
    Ok(Loader::new().set_texts("--set ", &overrides(set)?))
}

/// Both sides of a mechanism from any of its files.
pub(crate) fn sides(file: &Path, passive: Option<&Path>) -> Result<(PathBuf, PathBuf), Failure> {
    let urdf = file.with_extension("urdf");
    if let Some(p) = passive {
        return Ok((urdf, p.with_extension("urdf")));
    }
    let stem = urdf.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let beside = |s: &str, side: &str| urdf.with_file_name(format!("{s}{side}.urdf"));
    if let Some(s) = stem.strip_suffix("_active") {
        return Ok((urdf.clone(), beside(s, "_passive")));
    }
    if let Some(s) = stem.strip_suffix("_passive") {
        return Ok((beside(s, "_active"), urdf.clone()));
    }
    Err(Failure::Usage {
        what: format!("`{}` does not say which side of a mechanism it is", file.display()),
        remedy: "give the file of the active side and --passive FILE, or name the two \
                 …_active.urdf and …_passive.urdf"
            .to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_sides_are_found_from_any_file() {
        let pair = |f: &str| sides(Path::new(f), None).ok();
        let want = Some((PathBuf::from("m/a_active.urdf"), PathBuf::from("m/a_passive.urdf")));
        for f in ["m/a_active.urdf", "m/a_active.toml", "m/a_passive.toml", "m/a_passive.urdf"] {
            assert_eq!(pair(f), want, "{f}");
        }
        assert_eq!(pair("m/ring.urdf"), None);
    }
}
