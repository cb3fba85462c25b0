//! `sarrus robots`.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::NonEmptyStringValueParser;
use sarrus_models::{Options, Source, bundled, load, texts};
use sarrus_proto::Sizes;
use serde::Serialize;

#[cfg(feature = "show")]
use super::output::Failure;
use super::output::{FormatFlag, Outcome, Results, table, write_new};

/// Flags of `robots`.
#[derive(Args)]
pub(crate) struct Robots {
    #[command(flatten)]
    format: FormatFlag,
    /// Writes the files of a bundled robot into a folder, NAME.urdf and NAME.yml, as a start for a
    /// robot of one's own; existing files are not overwritten.
    #[arg(
        long,
        num_args = 2,
        value_names = ["NAME", "DIR"],
        value_parser = NonEmptyStringValueParser::new(),
        conflicts_with = "format"
    )]
    export: Option<Vec<String>>,
    /// Writes a page of each bundled robot into a folder, NAME.html as `sarrus show` does, and
    /// index.html with links to them; existing files are not overwritten.
    #[cfg(feature = "show")]
    #[arg(long, value_name = "DIR", conflicts_with_all = ["format", "export"])]
    gallery: Option<PathBuf>,
}

#[derive(Serialize)]
struct Line {
    robot: &'static str,
    about: &'static str,
    sizes: Sizes,
}

impl Robots {
    pub(crate) fn run(self) -> Outcome {
        if let Some([name, folder]) = self.export.as_deref() {
            return export(name, Path::new(folder));
        }
        #[cfg(feature = "show")]
        if let Some(folder) = &self.gallery {
            return gallery(folder);
        }
        let mut lines = Vec::new();
        for (robot, about) in bundled() {
            let loaded = load(&Source::Bundled(robot.to_owned()), &Options::default())?;
            lines.push(Line { robot, about, sizes: loaded.compiled.model.sizes() });
        }
        Ok(Results { text: self.format.render(&lines, |lines| in_words(lines)), code: 0 })
    }
}

/// Writes the files of a bundled robot.
fn export(name: &str, folder: &Path) -> Outcome {
    let (urdf, submechanisms) = texts(&Source::Bundled(name.to_owned()))?;
    let files = [("urdf", Some(urdf)), ("yml", submechanisms)];
    let files = files
        .into_iter()
        .filter_map(|(ending, text)| Some((folder.join(format!("{name}.{ending}")), text?)));
    write_new(folder, &files.collect::<Vec<(PathBuf, Vec<u8>)>>())
}

/// Writes the pages of all bundled robots.
#[cfg(feature = "show")]
fn gallery(folder: &Path) -> Outcome {
    let mut files = Vec::new();
    let mut robots = Vec::new();
    for (robot, about) in bundled() {
        let source = Source::Bundled(robot.to_owned());
        let options = Options::default();
        let loaded = load(&source, &options)?;
        let settings = sarrus_show::Settings::new(&source, &options, true);
        let page = sarrus_show::page(&loaded, &settings).map_err(Failure::finding)?;
        files.push((folder.join(format!("{robot}.html")), page.into_bytes()));
        let picture = sarrus_show::picture(&loaded.description, &loaded.compiled.model);
        robots.push((robot, about, picture.unwrap_or_default()));
    }
    for mechanism in sarrus_show::MECHANISMS {
        let page = mechanism.page().map_err(Failure::finding)?;
        files.push((folder.join(format!("{}.html", mechanism.name)), page.into_bytes()));
        robots.push((mechanism.name, mechanism.about, mechanism.picture().unwrap_or_default()));
    }
    files.push((folder.join("index.html"), sarrus_show::index(&robots).into_bytes()));
    write_new(folder, &files)
}

fn in_words(lines: &[Line]) -> String {
    let row = |line: &Line| {
        let Sizes { n_v, n_vy, n_u, n_c, .. } = line.sizes;
        let mut row = vec![line.robot.to_owned()];
        row.extend([n_v, n_vy, n_u, n_c].map(|n| n.to_string()));
        row.push(line.about.to_owned());
        row
    };
    let rows: Vec<Vec<String>> = lines.iter().map(row).collect();
    table("robot | tree | independent | active | loop rows | about", &rows)
}
