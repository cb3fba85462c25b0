//! Robot files: URDF alone, a submechanism file with its URDF, MJCF, SDF, and the files of Gepetto's
//! tools.

use std::path::Path;

use sarrus_dynamics::{Field, FieldSet, Model, Plan, Query, Request, Status, Workspace};
use sarrus_models::{
    Imported, LoadError, Loaded, Options, Source, bundled, bundled_text, import, load,
};

use super::{BETWEEN, Check, Target, corpus, diagnostics, kind, law, parts};

/// The longest bundled URDF that serves as a seed `[byte]`; larger ones are slow.
const LARGE: usize = 9000;

pub(super) const URDF: Target = Target {
    name: "urdf",
    seeds: || {
        let mut seeds = corpus!(
            "urdf/terms.urdf",
            "urdf/couplings.urdf",
            "urdf/curves.urdf",
            "urdf/balls.urdf",
            "urdf/loops.urdf",
            "urdf/compounds.urdf"
        )();
        seeds.extend(robots().map(|(urdf, _)| urdf.as_bytes().to_vec()));
        seeds
    },
    tokens: &[
        "<link name=\"a\"/>",
        "<joint name=\"j\" type=\"revolute\">",
        "</joint>",
        "<robot name=\"r\">",
        "</robot>",
        "<parent link=\"a\"/>",
        "<child link=\"b\"/>",
        "<axis xyz=\"0 0 1\"/>",
        "<limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/>",
        "<mimic joint=\"j\"/>",
        "<inertial>",
        "</inertial>",
        "<mass value=\"1\"/>",
        "<origin xyz=\"0 0 1\" rpy=\"0 0 0\"/>",
        "<inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/>",
        "continuous",
        "prismatic",
        "floating",
        "planar",
        "fixed",
        "spherical",
        "<dynamics damping=\"1\"/>",
        "spring_stiffness=\"1\"",
        "<transmission name=\"t\">",
        "</transmission>",
        "<actuator>",
        "<rotor_inertia value=\"1\"/>",
        "drake:",
        "xmlns:drake=\"x\"",
        "<!--",
        "-->",
        "<![CDATA[",
        "]]>",
        "<?xml version=\"1.0\"?>",
        "&amp;",
        "&#0;",
        "&lt;",
        "<!DOCTYPE",
        "\u{feff}",
        "\u{0}",
        "<depends_on joint=\"j\" multiplier=\"2\"/>",
        "polynomial=\"0 1e9 -2\"",
        "table=\"0 0 1 1 2 4\"",
        "ü",
        "\u{202e}",
        "\u{85}",
        "\r\n",
    ],
    start: || {
        let check: Check = Box::new(|input| check(input, None));
        Ok(check)
    },
};

pub(super) const SUBMECHANISMS: Target = Target {
    name: "submechanisms",
    seeds: || {
        let mut seeds = corpus!("submechanisms/lambda.txt", "submechanisms/cuts.txt")();
        seeds.extend(robots().map(|(urdf, yaml)| format!("{yaml}{BETWEEN}{urdf}").into_bytes()));
        seeds
    },
    tokens: &[
        "submechanisms:",
        "- name: a",
        "type: NUMERICAL",
        "RRPR",
        "2SPU+1U",
        "2SPRR+1U",
        "6UPS",
        "PARALLELOGRAMCHAIN",
        "FOURBAR",
        "SLIDERCRANK",
        "TRANSMISSION",
        "DIFFERENTIAL",
        "contextual_name: a",
        "file_path: a.urdf",
        "jointnames: []",
        "jointnames_spanningtree: []",
        "jointnames_independent: []",
        "jointnames_active: []",
        "loop_constraints:",
        "- cut_joint: a",
        "predecessor_body: a",
        "successor_body: a",
        "constraint_axes:",
        "- {name: x, axis: [0, 0, 0, 1, 0, 0]}",
        "cut_joint_type: spherical",
        "weld",
        "universal",
        "planar_revolute",
        "axis: [0, 0, 1]",
        "axis2: [1, 0, 0]",
        "predecessor_placement: {xyz: [0, 0, 0], rpy: [0, 0, 0]}",
        "successor_placement: {}",
        "&a ",
        "*a",
        "!!str ",
        "? ",
        ": ",
        "| ",
        "> ",
        "---\n",
        "...\n",
        "%YAML 1.2\n",
        "~",
        "null",
        "<<: ",
        "\t",
        "\u{feff}",
        "\u{85}",
        "\u{2028}",
        "# ",
        "'",
        "\"\\x00\"",
        "\r\n",
    ],
    start: || {
        let check: Check = Box::new(|input| {
            let [yaml, urdf] = parts(input);
            check(urdf, Some(yaml))
        });
        Ok(check)
    },
};

/// MJCF without the files that it names: these lie nowhere.
pub(super) const MJCF: Target = Target {
    name: "mjcf",
    seeds: corpus!("mjcf/tree.xml", "mjcf/loop.xml"),
    tokens: &[
        "<body name=\"a\" pos=\"1 0 0\">",
        "</body>",
        "<joint name=\"j\" type=\"slide\"/>",
        "type=\"ball\"",
        "<freejoint/>",
        "<geom size=\"0.1\"/>",
        "<geom type=\"mesh\" mesh=\"m\"/>",
        "<inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"1 1 1\"/>",
        "<site name=\"s\"/>",
        "<frame euler=\"1 2 3\">",
        "</frame>",
        "<replicate count=\"3\">",
        "</replicate>",
        "count=\"1e9\"",
        "<default class=\"d\">",
        "</default>",
        "class=\"d\"",
        "childclass=\"d\"",
        "<equality><connect body1=\"a\" body2=\"b\"/></equality>",
        "<weld body1=\"a\"/>",
        "<joint joint1=\"j\" joint2=\"k\" polycoef=\"0 1\"/>",
        "<joint joint1=\"j\" joint2=\"k\" polycoef=\"0 1 -2 0.1 3\"/>",
        "<motor joint=\"j\" gear=\"2\"/>",
        "<compiler angle=\"radian\" autolimits=\"false\"/>",
        "inertiafromgeom=\"true\"",
        "settotalmass=\"1\"",
        "<include file=\"a.xml\"/>",
        "<mesh name=\"m\" file=\"a.stl\"/>",
        "range=\"-1 1\"",
        "limited=\"true\"",
        "quat=\"1 0 0 0\"",
        "xyaxes=\"1 0 0 0 1 0\"",
        "zaxis=\"0 0 1\"",
        "fromto=\"0 0 0 1 0 0\"",
        "ref=\"1\"",
        "<key qpos=\"0 0\"/>",
        "0 0 0",
        "1e308",
        "-1",
        "<!--",
    ],
    start: || {
        let check: Check = Box::new(convert);
        Ok(check)
    },
};

/// SDF, which names no file.
pub(super) const SDF: Target = Target {
    name: "sdf",
    seeds: corpus!("sdf/tree.sdf", "sdf/loop.sdf"),
    tokens: &[
        "<sdf version=\"1.4\">",
        "<model name=\"m\">",
        "</model>",
        "<link name=\"a\"/>",
        "<link name=\"a\">",
        "</link>",
        "<joint name=\"j\" type=\"revolute\">",
        "</joint>",
        "type=\"ball\"",
        "type=\"universal\"",
        "type=\"screw\"",
        "type=\"gearbox\"",
        "type=\"fixed\"",
        "type=\"prismatic\"",
        "<parent>world</parent>",
        "<child>a</child>",
        "<child>tip::t</child>",
        "<frame name=\"f\" attached_to=\"a\"/>",
        "attached_to=\"f\"",
        "relative_to=\"f\"",
        "relative_to=\"__model__\"",
        "expressed_in=\"a\"",
        "canonical_link=\"a\"",
        "degrees=\"true\"",
        "rotation_format=\"quat_xyzw\"",
        "<pose>1 0 0 0 1 0</pose>",
        "<pose>0 0 0 0 0 0 1</pose>",
        "<axis><xyz>0 0 1</xyz></axis>",
        "<axis2><xyz>0 1 0</xyz></axis2>",
        "<limit><lower>-1</lower><upper>1</upper></limit>",
        "<dynamics><damping>1</damping></dynamics>",
        "<mimic joint=\"j\"/>",
        "<inertial><mass>1</mass></inertial>",
        "<inertia><ixx>1</ixx></inertia>",
        "<static>true</static>",
        "<gravity>0</gravity>",
        "<plugin name=\"JointController\"><joint_name>j</joint_name></plugin>",
        "<use_parent_model_frame>1</use_parent_model_frame>",
        "<include><uri>x</uri></include>",
        "0 0 0",
        "1e308",
        "1e16",
        "inf",
        "-1",
        "<!--",
    ],
    start: || {
        let check: Check = Box::new(convert);
        Ok(check)
    },
};

/// YAML of Gepetto's tools with the URDF beside it, in files of this process.
pub(super) const GEPETTO: Target = Target {
    name: "gepetto",
    seeds: corpus!("gepetto/pair.txt", "gepetto/typeless.txt"),
    tokens: &[
        "closed_loop:",
        "[[A, B]]",
        "type: ['6d']",
        "'3d'",
        "name_mot: [one]",
        "joint_name: [ball]",
        "joint_type: [SPHERICAL]",
        "UJOINT",
        "<joint name=\"ball\" type=\"continuous\">",
        "<link name=\"A\"/>",
        "</robot>",
        "</robot",
        "<!-- </robot> -->",
        "&amp;",
        "[]",
        "~",
    ],
    start: || {
        let folder = std::env::temp_dir();
        let yaml = folder.join(format!("sarrus_fuzz_{}.yaml", std::process::id()));
        let check: Check = Box::new(move |input| {
            let [text, urdf] = parts(input);
            let write = |path: &Path, bytes: &[u8]| {
                std::fs::write(path, bytes).map_err(|error| error.to_string())
            };
            write(&yaml, text)?;
            write(&yaml.with_extension("urdf"), urdf)?;
            let outcome = converted(&yaml, None);
            for path in [&yaml, &yaml.with_extension("urdf")] {
                std::fs::remove_file(path).map_err(|error| error.to_string())?;
            }
            outcome
        });
        Ok(check)
    },
};

/// A model is converted twice alike, and files without a fault load and move.
fn convert(input: &[u8]) -> Result<u64, String> {
    converted(Path::new("/nowhere/model.xml"), Some(input))
}

/// As [`convert`], of a file where there is no text.
fn converted(path: &Path, text: Option<&[u8]>) -> Result<u64, String> {
    let options = Options { lenient: true, ..Options::default() };
    let read = || import(path, text.map(<[u8]>::to_vec), &[], &options);
    let report_of = |outcome: &Result<Imported, LoadError>| match outcome {
        Ok(imported) => Ok(imported.report.clone()),
        Err(LoadError::Faults(report)) => Ok(report.clone()),
        Err(other) => Err(format!("a text that cannot be opened: {other}")),
    };
    let outcome = read();
    let report = report_of(&outcome)?;
    law(report == report_of(&read())?, || "two reports on one text".to_owned())?;
    let Ok(Imported { urdf, submechanisms, independent, .. }) = outcome else {
        law(!report.errors.is_empty(), || "refused without an error".to_owned())?;
        return Ok(report.errors.iter().fold(0, |kinds, of| kinds ^ kind(&of.found)));
    };
    if !report.errors.is_empty() {
        return Ok(kind(&report.errors[0].found));
    }
    let source = Source::Text { urdf, submechanisms: Some(submechanisms) };
    let loaded = load(&source, &options).map_err(|error| format!("written, not read: {error}"))?;
    let model = &loaded.compiled.model;
    law(model.info().independent == independent, || "written with other joints".to_owned())?;
    moves(model)
}

/// The small bundled robots.
fn robots() -> impl Iterator<Item = (&'static str, &'static str)> {
    bundled().filter_map(|(name, _)| bundled_text(name)).filter(|(urdf, _)| urdf.len() < LARGE)
}

fn check(urdf: &[u8], yaml: Option<&[u8]>) -> Result<u64, String> {
    let source = Source::Text { urdf: urdf.to_vec(), submechanisms: yaml.map(<[u8]>::to_vec) };
    let files = [("robot.urdf", urdf), ("submechanisms.yml", yaml.unwrap_or_default())];
    let lenient = Options { lenient: true, ..Options::default() };
    let report_of = |outcome: &Result<Loaded, LoadError>| match outcome {
        Ok(loaded) => Ok(loaded.report.clone()),
        Err(LoadError::Faults(report)) => Ok(report.clone()),
        Err(other) => Err(format!("texts that cannot be opened: {other}")),
    };

    // reading twice gives the same outcome
    let outcome = load(&source, &Options::default());
    let report = report_of(&outcome)?;
    let again = load(&source, &Options::default());
    law(outcome.is_ok() == again.is_ok(), || "read once and not again".to_owned())?;
    law(report == report_of(&again)?, || "two reports on one text".to_owned())?;
    let kind = diagnostics::check(&report, &files)?;
    match (&outcome, &again) {
        (Ok(loaded), Ok(again)) => {
            law(report.errors.is_empty(), || "loaded with errors".to_owned())?;
            let [one, two] = [loaded, again].map(|loaded| loaded.compiled.model.fingerprint());
            law(one == two, || "two models of one text".to_owned())?;
            Ok(kind ^ moves(&loaded.compiled.model)? << 32)
        }
        _ => {
            law(!report.errors.is_empty(), || "refused without an error".to_owned())?;
            // lenient: a model that loads can be asked
            let outcome = load(&source, &lenient);
            diagnostics::check(&report_of(&outcome)?, &files)?;
            if let Ok(loaded) = outcome {
                moves(&loaded.compiled.model)?;
            }
            Ok(kind)
        }
    }
}

/// A compiled model answers with numbers, or with a status and no numbers.
fn moves(model: &Model<f64>) -> Result<u64, String> {
    let given = FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]);
    let want = FieldSet::of(&[Field::Q, Field::TauY, Field::TauQ]);
    let plan = Plan::new(model, &Query::new(Request::InverseDynamics, given, want))
        .map_err(|error| format!("a model that cannot be asked: {error}"))?;
    // these quaternions have no unit length: a bad request and nothing worse
    let input: Vec<f64> = (0..plan.given().len()).map(|k| 1e-3 * (k % 7) as f64).collect();
    let mut output = vec![0.0; plan.want().len()];
    let answer = plan.run(model, &mut Workspace::new(model), &input, &mut output);
    let is_ok = answer.status == Status::Ok;
    let holds = match is_ok {
        true => output.iter().all(|number| number.is_finite()),
        false => output.iter().all(|number| number.is_nan()),
    };
    law(holds, || format!("status {} with {output:?}", answer.status.name()))?;
    Ok(answer.status as u64)
}
