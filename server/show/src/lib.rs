#![doc = include_str!("../README.md")]

mod capability;
mod code;
mod error;
mod lengths;
mod mesh;
mod motion;
mod picture;
mod scene;
mod visuals;

use sarrus_models::{Base, Loaded, Options, Source};
use serde_json::Value;

pub use capability::{
    Capability, CapabilityError, Choices, MOST_POINTS, capability, capability_page,
};
pub use error::ShowError;
pub use lengths::{MECHANISMS, Mechanism};
pub use motion::{Chart, Curve, Motion, POINTS, motion, sparse};
pub use picture::picture;

/// The stack of a trace: its recursion is as deep as the robot.
const STACK: usize = 16 << 20;

/// The first lines of every page.
const HEAD: &str = include_str!("../page/head.html");

/// The longest page.
const LONGEST: usize = 2_950_000;

/// Meshes of a page.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Meshes {
    /// Nothing that the URDF draws.
    None,
    /// Boxes, cylinders and spheres, and the convex hull of each mesh.
    Hull,
    /// Meshes too; the largest ones are hulls where the page would be too long.
    #[default]
    All,
}

/// Choices of a page.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Settings {
    /// The robot swings as soon as the page opens.
    pub swing: bool,
    /// The flags by which `sarrus ask` chooses this robot.
    pub flags: String,
    /// Which meshes are drawn.
    pub meshes: Meshes,
    /// The files in which visuals stand; without them none is drawn.
    pub source: Option<Source>,
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
        Settings { swing, flags, meshes: Meshes::default(), source: Some(source.clone()) }
    }
}

/// The page of a robot: one HTML file that refers to nothing outside.
///
/// The answers in it are those of generated code ([`sarrus_generate::Script`]). Allocates.
///
/// # Errors
/// [`ShowError`]: some query has no straight-line code, or Newton's method closes a loop.
pub fn page(loaded: &Loaded, settings: &Settings) -> Result<String, ShowError> {
    let code = traced(|| code::code(loaded))?;
    let robot = scene::scene(loaded, settings, &code);
    let motion = concat!(include_str!("../page/motion.js"), include_str!("../page/hand.js"));
    let parts = [&code.text, motion, include_str!("../page/panel.js")];
    Ok(assembled(include_str!("../page/page.html"), loaded, settings, robot, parts))
}

/// The result of something that traces, on a stack for that.
fn traced<R: Send>(of: impl FnOnce() -> Result<R, ShowError> + Send) -> Result<R, ShowError> {
    std::thread::scope(|scope| {
        let builder = std::thread::Builder::new().stack_size(STACK);
        let worker = builder.spawn_scoped(scope, of).map_err(ShowError::Thread)?;
        worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

/// The robot as pages have it, in JSON: links with joints, inertia boxes and visuals, loops and
/// limits. Allocates.
pub fn description(loaded: &Loaded, settings: &Settings) -> String {
    let mut robot = scene::scene(loaded, settings, &code::Code::default());
    visuals::add(&mut robot, &loaded.description, settings, LONGEST);
    robot.to_string()
}

/// A page from its template, the robot with its visuals, and scripts: before the robot, after the
/// geometry, and after the view.
fn assembled(
    template: &str,
    loaded: &Loaded,
    settings: &Settings,
    mut robot: Value,
    [first, motion, panel]: [&str; 3],
) -> String {
    let three = include_str!("../page/three/three.min.js");
    let geometry = include_str!("../page/geometry.js");
    let view = include_str!("../page/view.js");
    let style = include_str!("../page/page.css");
    let length = [template, first, three, geometry, motion, view, panel, style].map(str::len);
    let length = length.iter().sum::<usize>() + robot.to_string().len();
    visuals::add(&mut robot, &loaded.description, settings, LONGEST.saturating_sub(length));
    let robot = format!("const robot = {};", embedded(&robot.to_string()));
    let scripts = [three, first, &robot, geometry, motion, view, panel];
    filled(template, &loaded.description.name, &scripts)
}

/// A template with its style, title and scripts.
fn filled(template: &str, title: &str, scripts: &[&str]) -> String {
    let scripts = scripts.iter().filter(|text| !text.is_empty());
    let scripts: String = scripts.map(|text| format!("<script>{text}</script>\n")).collect();
    // names go last: no part of a page is a template of another
    template
        .replace("@HEAD@", HEAD)
        .replace("@STYLE@", include_str!("../page/page.css"))
        .replace("@TITLE@", &text(title))
        .replace("@SCRIPTS@", &scripts)
}

/// A page of links to the pages NAME.html of these robots, each with a line about it and its
/// [`picture`]. Allocates.
pub fn index(robots: &[(&str, &str, String)]) -> String {
    let row = |(name, about, picture): &(&str, &str, String)| {
        let [name, about] = [text(name), text(about)];
        format!("<li><a href=\"{name}.html\">{picture}{name}</a><p>{about}</p></li>\n")
    };
    include_str!("../page/index.html")
        .replace("@HEAD@", HEAD)
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
