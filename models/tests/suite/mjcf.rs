//! MJCF against MuJoCo: the vectors of `mjcf/generate.py`, and rules that are refused or noted.

use std::fs;
use std::path::{Path, PathBuf};

use sarrus_dynamics::{Field, FieldSet, Plan, Query, Request, Status, Workspace};
use sarrus_models::{Imported, LoadError, Options, Report, Source, import, load};
use serde_json::Value;

/// Largest difference, relative to the largest number of a quantity.
const ROUNDING: f64 = 1e-12;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/suite/mjcf")
}

fn names(value: &Value) -> Vec<String> {
    value.as_array().unwrap().iter().map(|name| name.as_str().unwrap().to_owned()).collect()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

fn rows(value: &Value) -> Vec<Vec<f64>> {
    value.as_array().unwrap().iter().map(numbers).collect()
}

fn size(of: &[f64]) -> f64 {
    of.iter().fold(0.0, |size: f64, x| size.max(x.abs()))
}

fn near(name: &str, found: &[f64], wanted: &[f64]) {
    assert_eq!(found.len(), wanted.len(), "{name}");
    let gap = found.iter().zip(wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let scale = size(wanted).max(0.1);
    assert!(gap <= ROUNDING * scale, "{name}: {gap:e} of {scale:e}\n{found:?}\n{wanted:?}");
}

/// Whether a coordinate is that of a joint, or one of its.
fn is_of(coordinate: &str, joint: &str) -> bool {
    let whole = coordinate.rsplit_once('/').map_or(coordinate, |(whole, _)| whole);
    coordinate == joint || whole == joint
}

/// Compares a model with MuJoCo's vectors: q, q̇, q̈, forces, M_y, and the rows of K with K̇ q̇.
fn agrees(name: &str) {
    let text = fs::read_to_string(folder().join(format!("{name}.json"))).unwrap();
    let vectors: Value = serde_json::from_str(&text).unwrap();
    let source = Source::Files { urdf: folder().join(format!("{name}.xml")), submechanisms: None };
    let loaded = load(&source, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
    let model = &loaded.compiled.model;
    let info = model.info();
    let joints = names(&vectors["independent"]);
    // the same joints, in our order
    let order: Vec<usize> = info
        .independent
        .iter()
        .map(|of| {
            joints.iter().position(|joint| is_of(of, joint)).unwrap_or_else(|| panic!("{of}"))
        })
        .collect();
    assert!((0..joints.len()).all(|k| order.contains(&k)), "{name}: {joints:?}");
    let theirs: Vec<String> = joints
        .iter()
        .flat_map(|joint| info.independent.iter().filter(|of| is_of(of, joint)).cloned())
        .collect();
    let given = FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd, Field::QGuess]);
    let wanted = [
        Field::Q,
        Field::Qd,
        Field::Qdd,
        Field::TauQ,
        Field::TauY,
        Field::MY,
        Field::K,
        Field::KBias,
    ];
    let query = Query::new(Request::InverseDynamics, given, FieldSet::of(&wanted));
    let plan = Plan::new(model, &query).unwrap();
    let tendons = vectors["tendons"].as_object().unwrap();
    for state in vectors["states"].as_array().unwrap() {
        let q_of = |coordinate: &str| -> f64 {
            let sum = |terms: &Value| -> f64 {
                let terms = terms.as_object().unwrap();
                terms
                    .iter()
                    .map(|(j, c)| state["q"][j].as_f64().unwrap() * c.as_f64().unwrap())
                    .sum()
            };
            tendons.get(coordinate).map_or_else(|| state["q"][coordinate].as_f64().unwrap(), sum)
        };
        let ours = |key: &str| -> Vec<f64> {
            let all = numbers(&state[key]);
            let at = |of: &String| theirs.iter().position(|known| known == of).unwrap();
            info.independent.iter().map(|of| all[at(of)]).collect()
        };
        let q: Vec<f64> = info.tree_q.iter().map(|of| q_of(of)).collect();
        let mut input: Vec<f64> = model.independent_q_names().iter().map(|of| q_of(of)).collect();
        input.extend(ours("yd"));
        input.extend(ours("ydd"));
        input.extend(&q);
        assert_eq!(input.len(), plan.given().len());
        let mut output = vec![0.0; plan.want().len()];
        let answer = plan.run(model, &mut Workspace::new(model), &input, &mut output);
        assert_eq!(answer.status, Status::Ok, "{name}");
        let field = |field: Field| {
            let at = plan.want().slot(field).unwrap();
            output[at.offset..at.offset + at.rows * at.columns].to_vec()
        };

        near("q", &field(Field::Q), &q);
        // tree quantities of the joints that MuJoCo has and no equality holds
        let tree = names(&vectors["tree"]);
        let columns: Vec<Option<usize>> =
            tree.iter().map(|of| info.tree.iter().position(|known| known == of)).collect();
        let known = |key: &str| -> Vec<f64> {
            let all = numbers(&state[key]);
            all.iter().zip(&columns).filter(|(_, of)| of.is_some()).map(|(x, _)| *x).collect()
        };
        let picked =
            |of: &[f64]| -> Vec<f64> { columns.iter().flatten().map(|k| of[*k]).collect() };
        near("qd", &picked(&field(Field::Qd)), &known("qd"));
        near("qdd", &picked(&field(Field::Qdd)), &known("qdd"));
        // springs of a tendon act on its joints
        let mut tau_q = field(Field::TauQ);
        for (tendon, terms) in tendons {
            let force = tau_q[info.tree.iter().position(|of| of == tendon).unwrap()];
            for (joint, factor) in terms.as_object().unwrap() {
                // one that is held has none
                let Some(j) = info.tree.iter().position(|of| of == joint) else { continue };
                tau_q[j] += force * factor.as_f64().unwrap();
            }
        }
        near("tau_q", &picked(&tau_q), &known("tau_q"));
        near("tau_y", &field(Field::TauY), &ours("tau_y"));
        let their_mass = rows(&state["M_y"]);
        let at = |of: &String| theirs.iter().position(|known| known == of).unwrap();
        let mass: Vec<f64> = info
            .independent
            .iter()
            .flat_map(|i| {
                info.independent.iter().map(|j| their_mass[at(i)][at(j)]).collect::<Vec<_>>()
            })
            .collect();
        near("M_y", &field(Field::MY), &mass);

        // each row of MuJoCo is one of ours, or its negative
        let own = field(Field::K);
        let bias = field(Field::KBias);
        let width = info.tree.len();
        for (row, k_bias) in rows(&state["K"]).iter().zip(numbers(&state["k_bias"])) {
            let wanted: Vec<f64> =
                row.iter().zip(&columns).filter(|(_, of)| of.is_some()).map(|(x, _)| *x).collect();
            if size(&wanted) == 0.0 {
                continue;
            }
            let gap = |i: usize| {
                // a row by a tendon's length is one by its joints
                let mut own = own[i * width..(i + 1) * width].to_vec();
                for (tendon, terms) in tendons {
                    let factor = own[info.tree.iter().position(|of| of == tendon).unwrap()];
                    for (joint, of) in terms.as_object().unwrap() {
                        if let Some(j) = info.tree.iter().position(|of| of == joint) {
                            own[j] += factor * of.as_f64().unwrap();
                        }
                    }
                }
                let own = picked(&own);
                // a coupling's row is that of the joint which follows
                let is_coupling = info.loops[i].ends_with("/coupling");
                let factor = if is_coupling { size(&wanted) / size(&own) } else { 1.0 };
                let of = |factor: f64| {
                    let gap = own.iter().zip(&wanted).map(|(a, b)| (factor * a - b).abs());
                    gap.fold((factor * bias[i] - k_bias).abs(), f64::max)
                };
                of(factor).min(of(-factor))
            };
            let least = (0..bias.len()).map(gap).fold(f64::INFINITY, f64::min);
            assert!(least <= ROUNDING * size(&wanted).max(1.0), "{name}: {least:e} {wanted:?}");
        }
    }
}

#[test]
fn an_ankle_on_two_cranks_agrees_with_mujoco() {
    agrees("ankle");
}

#[test]
fn a_gripper_on_a_tendon_agrees_with_mujoco() {
    agrees("gripper");
}

#[test]
fn a_floating_leg_with_a_ball_rod_agrees_with_mujoco() {
    agrees("leg");
}

#[test]
fn the_rules_of_frames_inertia_and_joints_are_those_of_mujoco() {
    agrees("rules");
}

#[test]
fn couplings_welds_and_sites_agree_with_mujoco() {
    agrees("tied");
}

#[test]
fn a_knee_of_polynomials_agrees_with_mujoco() {
    agrees("knee");
}

#[test]
fn attached_files_agree_with_mujoco() {
    agrees("attached");
}

#[test]
fn a_coupling_between_a_floating_body_and_the_world_agrees_with_mujoco() {
    agrees("geared");
}

#[test]
fn free_bodies_that_loops_hold_agree_with_mujoco() {
    agrees("held");
}

#[test]
fn tendons_that_follow_each_other_along_polynomials_agree_with_mujoco() {
    agrees("tendons");
}

/// A model of one body with these parts around it.
fn model(before: &str, body: &str, behind: &str) -> String {
    format!(
        "<mujoco>{before}<worldbody><body name=\"b\"><joint name=\"j\"/>{body}</body></worldbody>\
         {behind}</mujoco>"
    )
}

fn imported(text: &str, lenient: bool) -> Result<Imported, LoadError> {
    let options = Options { lenient, ..Options::default() };
    import(Path::new("/nowhere/model.xml"), Some(text.as_bytes().to_vec()), &[], &options)
}

/// The errors, warnings and notes of a model.
fn report(text: &str, lenient: bool) -> Report {
    match imported(text, lenient) {
        Ok(imported) => imported.report,
        Err(LoadError::Faults(report)) => report,
        Err(other) => panic!("{other}"),
    }
}

const BALL: &str = "<geom size=\"0.1\"/>";

#[test]
fn a_part_that_changes_numbers_and_has_no_expression_is_an_error_or_a_warning() {
    let tendon =
        "<tendon><spatial name=\"t\" stiffness=\"3\"><site site=\"s\"/></spatial></tendon>";
    let curve = "<tendon><fixed name=\"f\"><joint joint=\"j\" coef=\"1\"/></fixed>\
        <fixed name=\"s\"><joint joint=\"j\" coef=\"2\"/></fixed></tendon>\
        <equality><tendon tendon1=\"f\" tendon2=\"s\" polycoef=\"0 1 2\"/></equality>";
    let bend = "<joint joint1=\"j\" joint2=\"k\" polycoef=\"0 1 2\"/>";
    let bends = format!("<equality>{bend}{bend}</equality>");
    let second = "<geom size=\"0.1\"/><body><joint name=\"k\"/><geom size=\"0.1\"/></body>";
    let site = "<actuator><motor name=\"m\" site=\"s\"/></actuator>";
    let medium = "<option density=\"1.2\"/>";
    for (text, words) in [
        (model("", BALL, tendon), "the spatial tendon `t` with a spring"),
        (model("", BALL, curve), "no joint of the coupling"),
        (model("", second, &bends), "no joint of the coupling"),
        (model("", BALL, site), "the actuator `m` drives no hinge"),
        (model(medium, BALL, ""), "`density` of a medium is not modelled"),
        (model("<option><flag gravity=\"disable\"/></option>", BALL, ""), "`gravity` is disabled"),
        (model("", BALL, "").replace("name=\"b\"", "name=\"b\" gravcomp=\"1\""), "has `gravcomp`"),
        (model("", BALL, "").replace("<joint ", "<joint damping=\"1 2 0\" "), "is not linear"),
        (model("", BALL, "").replace("<joint ", "<joint springdamper=\"1 1\" "), "`springdamper`"),
        (model("", "<composite/>", ""), "the element `composite` is not read"),
        (model("", BALL, "").replace("<joint ", "<joint wobble=\"1\" "), "the attribute `wobble`"),
        (model("", BALL, "<deformable/>"), "the element `deformable` is not read"),
        (
            model("", "<geom type=\"ellipsoid\" size=\"1 1 1\" shellinertia=\"true\"/>", ""),
            "a shell",
        ),
    ] {
        let [strict, lenient] = [false, true].map(|lenient| report(&text, lenient));
        let has = |all: &[sarrus_models::Diagnostic]| all.iter().any(|of| of.found.contains(words));
        assert!(has(&strict.errors), "{words}: {strict}");
        assert!(strict.errors.iter().all(|error| error.line == 1 && error.column > 1));
        assert!(has(&lenient.warnings) && lenient.errors.is_empty(), "{words}: {lenient}");
    }
}

#[test]
fn a_faulty_model_is_refused_with_its_place() {
    let twice = "<geom size=\"0.1\"/><body name=\"b\"/>";
    let twice_in = |section: &str, of: &str| format!("<{section}>{of}{of}</{section}>");
    let motor = "<motor name=\"n\" joint=\"j\"/>";
    let to = |name: &str| format!("<equality><connect body1=\"b\" body2=\"{name}\"/></equality>");
    for (text, words) in [
        (
            model("<compiler coordinate=\"global\"/>", BALL, ""),
            "`coordinate` of `compiler` is `global`",
        ),
        (model("<compiler eulerseq=\"xya\"/>", BALL, ""), "`eulerseq` is `xya`"),
        (model("", twice, ""), "a second body is named `b`"),
        (model("", "<geom class=\"none\"/>", ""), "the class `none`, which does not exist"),
        (model("", "<geom size=\"0.1 x\"/>", ""), "`size`: `x` is not a number"),
        (model("", BALL, &to("c")), "the body `c`, which does not exist"),
        (model("", BALL, &to("b")), "are one body"),
        (model("", "<geom size=\"-1\"/>", ""), "the size of a sphere"),
        (model("", "<geom size=\"1\" mass=\"-1\"/>", ""), "`mass` of a sphere is -1"),
        (model("", "<geom size=\"1\" density=\"-1\"/>", ""), "`density` of a sphere is -1"),
        (model("", "<geom size=\"1\" fromto=\"0 0 0 1 0 0\"/>", ""), "`fromto` of a sphere is"),
        (model("", "<inertial pos=\"0 0 0\"/>", ""), "`inertial` has no `mass`"),
        (model("", "<geom type=\"mesh\" mesh=\"m\"/>", ""), "the mesh `m`, which does not exist"),
        (model("", "<body><freejoint/></body>", ""), "in this place"),
        (
            model("", BALL, "").replace("<joint ", "<joint axis=\"0 0 0\" "),
            "axis of the joint `j` is",
        ),
        (
            model("", BALL, "<keyframe><key qpos=\"0 0\"/></keyframe>"),
            "`qpos` of `key` holds 2 numbers",
        ),
        (model("", "<site name=\"s\"/><site name=\"s\"/>", ""), "a second site is named `s`"),
        (model("", &BALL.replace("<geom", "<geom name=\"g\"").repeat(2), ""), "a second geom is"),
        (model("", BALL, &twice_in("tendon", "<fixed name=\"n\"/>")), "a second tendon is"),
        (model("", BALL, &twice_in("actuator", motor)), "a second actuator is named `n`"),
        (
            model("", BALL, &twice_in("equality", "<joint name=\"n\" joint1=\"j\"/>")),
            "a second equality is named `n`",
        ),
        (model("<include file=\"x.xml\"/>", BALL, ""), "cannot be opened"),
        (
            model("<compiler autolimits=\"false\"/>", BALL, "")
                .replace("<joint ", "<joint range=\"0 1\" "),
            "without `limited`",
        ),
    ] {
        let errors = report(&text, true).errors;
        assert!(errors.iter().any(|error| error.found.contains(words)), "{words}: {errors:?}");
    }
}

/// As fact sheets of MuJoCo 4.0.0 have it.
#[test]
fn angles_are_degrees_and_sequences_turn_in_their_order() {
    for (sequence, [w, x, y, z]) in [
        ("xyz", [0.943_714_36, 0.127_679_44, 0.144_878_13, 0.268_535_82]),
        ("XYZ", [0.951_548_52, 0.038_134_58, 0.189_307_86, 0.239_298_34]),
        ("zyx", [0.951_548_52, 0.239_298_34, 0.189_307_86, 0.038_134_58]),
    ] {
        let angles = "euler=\"10 20 30\"";
        let quaternion = format!("quat=\"{w} {x} {y} {z}\"");
        let [one, other] = [angles, &quaternion].map(|of| {
            let compiler = format!("<compiler eulerseq=\"{sequence}\"/>");
            let text =
                model(&compiler, BALL, "").replace("name=\"b\"", &format!("name=\"b\" {of}"));
            let source = Source::Text { urdf: text.into_bytes(), submechanisms: None };
            let loaded = load(&source, &Options::default()).unwrap_or_else(|e| panic!("{e}"));
            loaded.description.joints[0].origin.rpy
        });
        let gap = one.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(gap < 3e-8, "{sequence}: {gap:e}");
    }
}

#[test]
fn files_are_read_below_the_first_files_folder_or_an_include_folder_only() {
    let root = std::env::temp_dir().join(format!("sarrus_mjcf_{}", std::process::id()));
    let inner = root.join("robot");
    let other = root.join("other");
    fs::create_dir_all(&inner).unwrap();
    fs::create_dir_all(&other).unwrap();
    let part =
        format!("<mujoco><worldbody><body name=\"b\"><joint/>{BALL}</body></worldbody></mujoco>");
    fs::write(other.join("part.xml"), part).unwrap();
    std::os::unix::fs::symlink(other.join("part.xml"), inner.join("link.xml")).unwrap();
    for named in ["../other/part.xml", "link.xml"] {
        let first = inner.join("robot.xml");
        fs::write(&first, format!("<mujoco><include file=\"{named}\"/></mujoco>")).unwrap();
        let read = |folders: &[PathBuf]| import(&first, None, folders, &Options::default());
        let Err(LoadError::Faults(report)) = read(&[]) else { panic!("{named} was read") };
        let error = report.errors[0].to_string();
        assert!(error.contains("outside of the first file's folder"), "{error}");
        assert!(error.contains("--include-dir"), "{error}");
        let imported = read(std::slice::from_ref(&other)).unwrap();
        assert_eq!(imported.independent, ["joint_1"]);
    }
    // each file once
    fs::write(inner.join("robot.xml"), "<mujoco><include file=\"robot.xml\"/></mujoco>").unwrap();
    let outcome = import(&inner.join("robot.xml"), None, &[], &Options::default());
    assert!(outcome.unwrap_err().to_string().contains("a second time"));
    fs::remove_dir_all(root).unwrap();
}

/// A file that `part.xml` is attached to as `part`, with this around it.
fn attaching(asset: &str, attach: &str) -> String {
    let asset = format!("<asset><model name=\"part\" file=\"part.xml\"/>{asset}</asset>");
    model(&asset, &format!("{BALL}{attach}"), "")
}

#[test]
fn an_attached_file_is_refused_with_its_place() {
    let root = std::env::temp_dir().join(format!("sarrus_attach_{}", std::process::id()));
    fs::create_dir_all(&root).unwrap();
    let write = |name: &str, text: &str| fs::write(root.join(name), text).unwrap();
    let both = "<attach model=\"part\" body=\"b\" prefix=\"p_\"/>";
    let part = "<body name=\"c\"><joint name=\"k\"/><geom size=\"0.1\"/></body>";
    let plain = model("", BALL, "").replace("</worldbody>", &format!("{part}</worldbody>"));
    let first = root.join("first.xml");
    let read = |part: &str, first_text: &str| {
        write("part.xml", part);
        write("first.xml", first_text);
        import(&first, None, &[], &Options::default())
    };
    // a model that nothing attaches is left out, and the second of a part's two names is empty
    fs::copy(folder().join("parts/claw.xml"), root.join("unused.xml")).unwrap();
    let unused = "<model name=\"a\" file=\"unused.xml\"/><model name=\"z\" file=\"unused.xml\"/>";
    let tie = "<body><joint/><geom size=\"1\"/></body></worldbody>\
        <equality><joint joint1=\"j\" joint2=\"\"/></equality>";
    let held = plain.replace("</worldbody>", tie);
    for (part, independent) in [(&plain, &["j", "p_j"][..]), (&held, &["j"])] {
        let first = attaching("", both).replace("<asset>", &format!("<asset>{unused}"));
        let imported = read(part, &first).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(imported.independent, independent);
    }
    let wobble = plain.replace("<joint ", "<joint wobble=\"1\" ");
    let other = "<attach model=\"part\" body=\"c\" prefix=\"q_\"/>";
    let twice = "<attach model=\"part\" body=\"b\" prefix=\"\"/>";
    let tied = plain.replace("</mujoco>", "<equality><joint joint1=\"none\"/></equality></mujoco>");
    let tie = "<tendon><fixed><joint joint=\"k\" coef=\"1\"/><joint joint=\"j\" coef=\"1\"/></fixed>\
        </tendon></mujoco>";
    let taken = plain.replace("</mujoco>", tie);
    let asset = |of: &str| attaching(of, both);
    for (part, first, words) in [
        (&*plain, asset("<model name=\"x\"/>"), "`model` has no `file`"),
        (&plain, asset("<model file=\"none.xml\"/>"), "none.xml` cannot be opened"),
        (&plain, asset("<model file=\"/etc/hosts\"/>"), "outside of the first file's folder"),
        (&plain, attaching("", &both.replace("part", "nobody")), "the model `nobody`"),
        (&plain, attaching("", &both.replace("prefix=\"p_\"", "")), "without `model` or `prefix`"),
        (&plain, attaching("", &both.replace("\"b\"", "\"d\"")), "the body `d`"),
        (&plain, attaching("", twice), "a second body is named `b`"),
        ("<robot name=\"r\"/>", attaching("", both), "the root element `robot`"),
        ("<mujoco><model/>", attaching("", both), "this is not XML"),
        // an unknown attribute of a part is an error, though another `attach` leaves that out
        (&wobble, attaching("", &format!("{both}{other}")), "the attribute `wobble`"),
        (&tied, attaching("", both), "the hinge or slide `none`"),
        // MuJoCo would take the joint of the outer file
        (&taken, attaching("", other), "refers to the joint `j`, which is not attached"),
        (&attaching("", both), attaching("", both), "the model has too many files"),
    ] {
        let Err(LoadError::Faults(report)) = read(part, &first) else { panic!("{words}") };
        assert!(report.errors.iter().any(|of| of.found.contains(words)), "{words}: {report}");
    }
    fs::remove_dir_all(root).unwrap();
}

#[test]
fn loops_that_are_open_in_the_files_pose_are_closed_and_a_keyframe_is_projected() {
    let text = fs::read_to_string(folder().join("tied.xml")).unwrap();
    let open =
        text.replace("name=\"end\" pos=\"-0.2 -0.1 0\"", "name=\"end\" pos=\"-0.2 -0.08 0\"");
    assert_ne!(open, text);
    let imported = imported(&open, false).unwrap();
    assert!(imported.report.errors.is_empty(), "{}", imported.report);
    assert!(imported.residual.is_some_and(|of| of > 1e-3), "{:?}", imported.residual);
    // the note names the joints that moved, by how much
    let notes = &imported.report.notes;
    let note = notes.iter().find(|of| of.found.contains("open in the file's pose")).unwrap();
    let (_, moved) = note.help.split_once(": ").unwrap();
    let moved: Vec<_> = moved.split(", ").filter_map(|of| of.split_once(' ')).collect();
    assert!(moved.len() >= 2, "{moved:?}");
    assert!(moved.iter().all(|(_, by)| by.parse::<f64>().unwrap() != 0.0), "{moved:?}");
    assert!(imported.report.notes.iter().any(|of| of.found.contains("is not active")));
    // written and read again
    let source = Source::Text { urdf: imported.urdf, submechanisms: Some(imported.submechanisms) };
    let again = load(&source, &Options::default()).unwrap();
    assert_eq!(again.compiled.model.info().independent, imported.independent);

    let leg = folder().join("leg.xml");
    let imported = import(&leg, None, &[], &Options::default()).unwrap();
    let (name, closed) = imported.keyframe.unwrap();
    assert_eq!((name.as_str(), closed.error), ("home", None));
    assert!(closed.residual < 1e-9 && closed.residual_before > 1e-3, "{}", closed.residual);
}

/// MuJoCo 4.0.0 takes zeros for the numbers that a `qpos` lacks.
#[test]
fn a_short_qpos_begins_a_pose() {
    let text = fs::read_to_string(folder().join("tied.xml")).unwrap();
    let key = "<keyframe><key name=\"first\" qpos=\"0.1\"/></keyframe></mujoco>";
    let imported = imported(&text.replace("</mujoco>", key), false).unwrap();
    assert!(imported.report.errors.is_empty(), "{}", imported.report);
    let (name, closed) = imported.keyframe.unwrap();
    assert_eq!((name.as_str(), closed.error), ("first", None));
    assert_eq!(closed.q.iter().filter(|of| of.given != 0.0).count(), 1);
}

#[test]
fn couplings_in_a_circle_have_an_independent() {
    // c follows b, b follows a, and a follows c again; d is held by a circle of two
    let joints: String = ["a", "b", "c", "d", "e"]
        .map(|name| format!("<body name=\"{name}\"><joint name=\"q{name}\"/>{BALL}</body>"))
        .concat();
    let follow = [("a", "b", 2.0), ("b", "c", -0.5), ("c", "a", -1.0), ("d", "e", 3.0)];
    let mut equalities: String = follow
        .map(|(one, two, slope)| {
            format!("<joint joint1=\"q{one}\" joint2=\"q{two}\" polycoef=\"0 {slope}\"/>")
        })
        .concat();
    equalities += "<joint name=\"back\" joint1=\"qe\" joint2=\"qd\" polycoef=\"0 0.5\"/>";
    let text = format!(
        "<mujoco><worldbody>{joints}</worldbody><equality>{equalities}</equality>\
         <actuator><motor joint=\"qb\"/></actuator></mujoco>"
    );
    let imported = imported(&text, false).unwrap();
    assert!(imported.report.errors.is_empty(), "{}", imported.report);
    assert_eq!(imported.independent, ["qb"]);
    let notes: String = imported.report.notes.iter().map(|of| of.found.clone()).collect();
    for name in ["joint_1", "joint_4", "back"] {
        assert!(notes.contains(&format!("`{name}` is soft in MuJoCo")), "{notes}");
    }
    let source = Source::Text { urdf: imported.urdf, submechanisms: Some(imported.submechanisms) };
    let model = load(&source, &Options::default()).unwrap().compiled.model;
    let query =
        Query::new(Request::Kinematics, FieldSet::of(&[Field::Y]), FieldSet::of(&[Field::Q]));
    let plan = Plan::new(&model, &query).unwrap();
    let mut q = [0.0; 5];
    let answer = plan.run(&model, &mut Workspace::new(&model), &[0.3], &mut q);
    assert_eq!(answer.status, Status::Ok);
    near("q", &q, &[0.6, 0.3, -0.6, 0.0, 0.0]);
}

#[test]
fn independents_are_found_beside_a_ball_whose_spin_is_idle() {
    let path = folder().join("leg.xml");
    let text = fs::read_to_string(&path).unwrap();
    let (before, rest) = text.split_once("<actuator>").unwrap();
    let text = format!("{before}{}", rest.split_once("</actuator>").unwrap().1).into_bytes();
    let imported = import(&path, Some(text), &[], &Options::default()).unwrap();
    assert!(imported.report.errors.is_empty(), "{}", imported.report);
    assert!(imported.independent.iter().all(|of| !of.starts_with("achilles")));
    assert_eq!(imported.independent.len(), 12, "{:?}", imported.independent);
}

#[test]
fn effort_and_range_come_from_actuators_and_joints() {
    let source = Source::Files { urdf: folder().join("rules.xml"), submechanisms: None };
    let loaded = load(&source, &Options::default()).unwrap();
    let limits = |name: &str| {
        let joint = loaded.description.joints.iter().find(|joint| joint.name == name).unwrap();
        let limits = joint.limits.unwrap();
        [limits.lower, limits.upper, limits.effort]
    };
    let rad = f64::to_radians;
    // gear 3 times the larger control; the range counts from ref
    near("a", &limits("a"), &[rad(-40.0) - rad(10.0), rad(60.0) - rad(10.0), 15.0]);
    assert_eq!(limits("b")[2], 10.0);
    assert_eq!(limits("e")[2], 3.0);
    assert_eq!(limits("pull")[2], 14.0);
    assert_eq!(loaded.compiled.model.info().active, ["a", "pull", "b", "e"]);
}

#[test]
fn a_default_that_no_element_takes_is_a_note() {
    let default = "<default><default class=\"c\"><mesh maxhullvert=\"9\"/></default></default>";
    let found = report(&model(default, BALL, ""), false);
    assert!(found.errors.is_empty() && found.warnings.is_empty(), "{found}");
    assert!(found.notes.iter().any(|of| of.found.contains("mesh")), "{found}");
}
