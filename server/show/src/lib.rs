#![doc = include_str!("../README.md")]

mod code;
mod error;
mod scene;

use sarrus_models::{Base, Loaded, Options, Source};

pub use error::ShowError;

/// The stack of a trace: its recursion is as deep as the robot.
const STACK: usize = 16 << 20;

/// Choices of a page.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Settings {
    /// The robot swings as soon as the page opens.
    pub swing: bool,
    /// The flags by which `sarrus ask` chooses this robot.
    pub flags: String,
}

impl Settings {
    /// For the robot of this source with these options.
    pub fn new(source: &Source, options: &Options, swing: bool) -> Settings {
        let mut flags = match source {
            Source::Bundled(name) => format!("--robot {name}"),
            Source::Files { urdf, submechanisms } => {
                let second = submechanisms.iter().map(|path| format!(" {}", path.display()));
                urdf.display().to_string() + &second.collect::<String>()
            }
            _ => "FILE.urdf FILE.yml".to_owned(),
        };
        let Options { gravity: [x, y, z], lenient, base, lock, only } = options;
        if options.gravity != Options::default().gravity {
            flags += &format!(" --gravity {x},{y},{z}");
        }
        if *lenient {
            flags += " --lenient";
        }
        match base {
            Base::FloatingAt(link) => flags += &format!(" --floating-base {link}"),
            Base::Floating => flags += " --floating-base",
            _ => {}
        }
        for lock in lock {
            let position = lock.position.map(|x| format!("={x}")).unwrap_or_default();
            flags += &format!(" --lock '{}{position}'", lock.joint);
        }
        only.iter().for_each(|link| flags += &format!(" --only '{link}'"));
        Settings { swing, flags }
    }
}

/// The page of a robot: one HTML file that refers to nothing outside.
///
/// The answers in it are those of generated code ([`sarrus_generate::Script`]). Allocates.
///
/// # Errors
/// [`ShowError`]: some query has no straight-line code, or Newton's method closes a loop.
pub fn page(loaded: &Loaded, settings: &Settings) -> Result<String, ShowError> {
    let code = std::thread::scope(|scope| {
        let builder = std::thread::Builder::new().stack_size(STACK);
        let worker =
            builder.spawn_scoped(scope, || code::code(loaded)).map_err(ShowError::Thread)?;
        worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })?;
    let robot = scene::scene(loaded, settings, &code);
    let scripts = [
        include_str!("../page/three/three.min.js"),
        &code.text,
        &format!("const robot = {};", embedded(&robot.to_string())),
        include_str!("../page/geometry.js"),
        include_str!("../page/motion.js"),
        include_str!("../page/view.js"),
        include_str!("../page/panel.js"),
    ];
    let scripts: String = scripts.iter().map(|text| format!("<script>{text}</script>\n")).collect();
    // names go last: no part of a page is a template of another
    Ok(include_str!("../page/page.html")
        .replace("@STYLE@", include_str!("../page/page.css"))
        .replace("@TITLE@", &text(&loaded.description.name))
        .replace("@SCRIPTS@", &scripts))
}

/// A page of links to the pages NAME.html of these robots, each with a line about it. Allocates.
pub fn index(robots: &[(&str, &str)]) -> String {
    let row = |(name, about): &(&str, &str)| {
        let [name, about] = [text(name), text(about)];
        format!("<li><a href=\"{name}.html\">{name}</a> {about}</li>\n")
    };
    include_str!("../page/index.html")
        .replace("@STYLE@", include_str!("../page/page.css"))
        .replace("@ROBOTS@", &robots.iter().map(row).collect::<String>())
}

/// JSON that does not end the script around it.
fn embedded(json: &str) -> String {
    json.replace('<', "\\u003c").replace('\u{2028}', "\\u2028").replace('\u{2029}', "\\u2029")
}

/// Text of a page.
fn text(name: &str) -> String {
    name.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;").replace('@', "&#64;")
}
