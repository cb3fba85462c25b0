//! Reads a configuration from its file before the bridge runs. Only this module and `fault_files`
//! open files.

use std::path::{Path, PathBuf};

use sarrus_models::{Options, Report, Source, load};

use super::configuration::{Configuration, Surroundings};

/// Why a configuration cannot be used.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigurationError {
    /// Its file cannot be read: its name, the system's reason.
    #[error("cannot open {0}: {1}; give the path of a readable file")]
    Open(String, String),
    /// Its content is faulty: every fault, and the warnings.
    #[error("{0}")]
    Faults(Report),
}

impl Configuration {
    /// Reads the configuration of a file; paths in it are relative to its folder.
    ///
    /// # Errors
    /// A file that cannot be opened, or every fault of its content.
    pub fn load(path: &Path) -> Result<Configuration, ConfigurationError> {
        let name = path.display().to_string();
        let bytes = std::fs::read(path)
            .map_err(|error| ConfigurationError::Open(name.clone(), error.to_string()))?;
        let folder = path.parent().map(Path::to_owned).unwrap_or_default();
        let file = |name: &str| {
            std::fs::read(folder.join(name)).map(text).map_err(|error| error.to_string())
        };
        let robot = |source: &Source| load(&beside(&folder, source), &Options::default());
        let configuration =
            Configuration::read(&name, bytes, &Surroundings { file: &file, robot: &robot })
                .map_err(ConfigurationError::Faults)?;
        let source = configuration.source.as_ref().map(|source| beside(&folder, source));
        Ok(Configuration { source, ..configuration })
    }
}

/// The text of a file in UTF-8, or else in Latin-1, as DBC files often are.
fn text(bytes: Vec<u8>) -> String {
    String::from_utf8(bytes)
        .unwrap_or_else(|error| error.as_bytes().iter().copied().map(char::from).collect())
}

/// A source whose files lie in a folder.
fn beside(folder: &Path, source: &Source) -> Source {
    let within = |path: &PathBuf| folder.join(path);
    match source {
        Source::Files { urdf, submechanisms } => {
            Source::Files { urdf: within(urdf), submechanisms: submechanisms.as_ref().map(within) }
        }
        other => other.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::text;

    #[test]
    fn a_file_in_latin_1_is_read() {
        assert_eq!(text(b"[-40|150] \"\xB0C\" Host".to_vec()), "[-40|150] \"°C\" Host");
        assert_eq!(text("\"°C\"".as_bytes().to_vec()), "\"°C\"");
    }
}
