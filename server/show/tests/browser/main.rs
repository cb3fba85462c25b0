//! The page in headless Chromium: a slider moves the robot, the numbers are the plan's.
#![allow(clippy::unwrap_used, clippy::panic)]

mod hand;
mod lengths;

use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use sarrus_dynamics::{Field, FieldSet, Plan, Query, Request, Status, Workspace};
use sarrus_models::{Loaded, Options, Source, load, texts};
use sarrus_show::{
    Chart, Choices, Curve, Meshes, Motion, Settings, capability, capability_page, motion, page,
};
use serde_json::Value;

/// Width and height of windows: a phone, on its side too, a laptop, a large screen.
const SIZES: [[u32; 2]; 4] = [[390, 844], [844, 390], [1280, 800], [2560, 1440]];

/// For scripts: the colour of the drawing at a point of the root's frame, and how many pixels of a
/// small copy are not transparent.
const LOOK: &str = "
    const drawn = (width, height) => {
        view.draw();
        const copy = document.createElement('canvas');
        Object.assign(copy, { width, height });
        const context = copy.getContext('2d');
        context.drawImage(view.canvas, 0, 0, width, height);
        return context;
    };
    const look = (p) => {
        const { width, height, clientWidth, clientHeight } = view.canvas;
        const scale = width / clientWidth;
        const at = pixel(p, clientWidth, clientHeight).map((x) => Math.round(x * scale));
        return [...drawn(width, height).getImageData(...at, 1, 1).data];
    };
    const painted = () => drawn(200, 200).getImageData(0, 0, 200, 200).data.filter(
        (x, k) => k % 4 === 3 && x > 100).length;
";

fn loaded(robot: &str) -> Loaded {
    load(&Source::Bundled(robot.to_owned()), &Options::default()).unwrap()
}

fn settings(robot: &str) -> Settings {
    Settings::new(&Source::Bundled(robot.to_owned()), &Options::default(), false)
}

fn run(robot: &str, script: &str, size: [u32; 2], hash: &str) -> Option<Value> {
    run_page(robot, &page(&loaded(robot), &settings(robot)).unwrap(), script, size, hash)
}

/// The `answer` of a script at the end of a page, with no error on the way; none without a browser.
fn run_page(
    robot: &str,
    text: &str,
    script: &str,
    [width, height]: [u32; 2],
    hash: &str,
) -> Option<Value> {
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let is_there = |name: &&str| {
        let mut command = Command::new(name);
        command.arg("--version").stdout(Stdio::null()).stderr(Stdio::null());
        command.status().is_ok_and(|status| status.success())
    };
    let Some(browser) = names.into_iter().find(is_there) else {
        println!("not run: no chromium");
        return None;
    };
    let errors = "<script>const errors = [];
        addEventListener('error', (event) => errors.push(event.message));
        console.error = (...words) => errors.push(words.join(' '));</script>";
    let script = format!(
        "<script>const answer = {{}};
        {{
            try {{ {LOOK} {script} }} catch (error) {{ errors.push(String(error)); }}
            const out = document.createElement('pre');
            out.id = 'answer';
            out.textContent = JSON.stringify({{ ...answer, errors }});
            document.body.append(out);
        }}</script>"
    );
    let text = text.replacen("<head>", &format!("<head>{errors}"), 1);
    let text = text.replace("</body>", &format!("{script}</body>"));
    // tests run beside each other: a page and a browser's profile belong to one run
    static RUNS: AtomicUsize = AtomicUsize::new(0);
    let number = RUNS.fetch_add(1, Relaxed);
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("{robot}_{number}.html"));
    let profile = path.with_extension("profile");
    let _ = std::fs::remove_dir_all(&profile);
    std::fs::write(&path, text).unwrap();
    let mut command = Command::new("timeout");
    command.args(["300", browser, "--headless=new", "--no-sandbox", "--disable-gpu-sandbox"]);
    command.args(["--use-gl=angle", "--use-angle=swiftshader"]);
    command.args(["--virtual-time-budget=4000", "--dump-dom"]);
    command.arg(format!("--user-data-dir={}", profile.display()));
    command.arg(format!("--window-size={width},{height}"));
    let output = command.arg(format!("file://{}{hash}", path.display())).output().unwrap();
    let dom = String::from_utf8_lossy(&output.stdout);
    let answer = dom.rsplit_once("<pre id=\"answer\">").unwrap_or_else(|| {
        let errors = String::from_utf8_lossy(&output.stderr);
        panic!("{robot}: {} {dom:.300} {errors:.2000}", output.status)
    });
    let answer = answer.1;
    let answer = answer.split_once("</pre>").unwrap().0;
    let plain = answer.replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&");
    let answer: Value = serde_json::from_str(&plain).unwrap();
    assert_eq!(answer["errors"], serde_json::json!([]), "{robot}");
    Some(answer)
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

/// The link at which a force pulls, from the command that the page shows.
fn pulled(answer: &Value) -> Option<String> {
    let command = answer["command"].as_str()?;
    let line = command.strip_prefix("echo '")?.split_once('\'')?.0;
    let line: Value = serde_json::from_str(line).unwrap();
    let (link, wrench) = line["wrenches"].as_object()?.iter().next()?;
    assert_eq!(numbers(wrench), [0.0, 0.0, 0.0, 0.0, 0.0, -20.0]);
    Some(link.clone())
}

/// The numbers of the plan at rest at y, with 20 N down at a link.
fn answers(robot: &str, y: &[f64], want: Field, link: Option<String>) -> Vec<f64> {
    let loaded = loaded(robot);
    let model = &loaded.compiled.model;
    let given = FieldSet::of(&[Field::Y]);
    let mut query = Query::new(Request::InverseDynamics, given, FieldSet::of(&[want]));
    let mut input = y.to_vec();
    if let Some(link) = link {
        let at = model.info().links.iter().position(|other| *other == link).unwrap();
        query = query.with_wrenches(&[at as u16]);
        input.extend([0.0, 0.0, 0.0, 0.0, 0.0, -20.0]);
    }
    let plan = Plan::new(model, &query).unwrap();
    let mut output = vec![0.0; plan.want().len()];
    let answer = plan.run(model, &mut Workspace::for_plans(model, [&plan]), &input, &mut output);
    assert_eq!(answer.status, Status::Ok);
    output
}

/// Addresses in a page that are no namespace.
fn references(text: &str) -> usize {
    let outside = text.split("http").skip(1).filter(|rest| {
        let rest = rest.trim_start_matches('s');
        rest.starts_with("://") && !rest.starts_with("://www.w3.org/")
    });
    outside.count()
}

#[test]
fn a_page_is_one_small_file_without_outside_references() {
    for (robot, _) in sarrus_models::bundled() {
        let text = page(&loaded(robot), &settings(robot)).unwrap();
        assert!(text.len() < 3_000_000, "{}", text.len());
        assert_eq!(references(&text), 0, "{robot}");
        let scripts = text.matches("<script").count();
        assert_eq!(scripts, text.matches("</script>").count());
        println!("{robot}: {} bytes", text.len());
    }
}

#[test]
fn a_slider_moves_the_robot_and_the_numbers_are_the_plans() {
    let script = "
        view.shown.boxes = view.shown.axes = view.shown.cuts = false;
        answer.kind = view.kind;
        const tip = () => {
            return rods.map(([a, p, b, q, kind], k) => {
                const [s, t] = [placed(view.worlds[a], p), placed(view.worlds[b], q)];
                return [kind === 'rod' ? distance(s, t) : 0, s.map((x, i) => (x + t[i]) / 2), k];
            });
        };
        const before = tip();
        const slider = document.getElementById('slider0');
        const old = { tau_u: now.answer.tau_u };
        slider.value = 0.4;
        slider.dispatchEvent(new Event('input'));
        const after = tip();
        // the rod whose middle moved farthest
        const way = ([length, at, k]) => [length > 0 ? distance(at, after[k][1]) : 0, k];
        const [moved, k] = before.map(way).sort((a, b) => b[0] - a[0])[0];
        answer.moved = moved / view.size;
        answer.there = look(after[k][1]);
        answer.y = now.y;
        answer.u = now.answer.u;
        answer.tau_u = now.answer.tau_u;
        const cell = document.querySelector('#motors tbody tr').cells[2];
        answer.shown = Number(cell.querySelector('span').dataset.value);
        answer.sigma_min = [now.answer.sigma_min];
        const force = element('force_z');
        force.value = -20;
        force.dispatchEvent(new Event('input'));
        answer.pulled = now.answer.tau_u;
        answer.command = element('command').textContent;
        force.value = 0;
        force.dispatchEvent(new Event('input'));
        answer.status = element('status').textContent;
        answer.deviation = deviation;
        slider.value = 0;
        slider.dispatchEvent(new Event('input'));
        answer.gone = look(after[k][1]);
        answer.back = old.tau_u.every((x, i) => x === now.answer.tau_u[i]);
        // by its motors to the same place
        document.querySelector('#by input[value=u]').click();
        const motor = document.getElementById('slider0');
        answer.sliders = document.querySelectorAll('#sliders input').length;
        motor.value = answer.u[0];
        motor.dispatchEvent(new Event('input'));
        answer.by_u = [now.answer.u[0], now.status];
    ";
    let cases =
        [("lambda", ""), ("lambda", "#lines"), ("rh5v2_upper_body", ""), ("five_bar", "#lines")];
    for (robot, hash) in cases {
        let is_closed_form = robot != "five_bar";
        let Some(answer) = run(robot, script, [1280, 800], hash) else { return };
        println!("{robot}{hash}: {answer}");
        assert!(pulled(&answer).is_some());
        assert_eq!(answer["kind"], if hash.is_empty() { "solids" } else { "lines" });
        let y = numbers(&answer["y"]);
        assert_eq!(y[0], 0.4);
        // the bits of the plan; Newton's method takes other last steps
        let most = if is_closed_form { 0.0 } else { 1e-13 };
        let forces = Field::TauU;
        for (name, field, link) in [
            ("u", Field::U, None),
            ("tau_u", forces, None),
            ("sigma_min", Field::SigmaMin, None),
            ("pulled", forces, pulled(&answer)),
        ] {
            let expected = answers(robot, &y, field, link);
            let most = if name == "sigma_min" { 1e-13 } else { most };
            let size = expected.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
            for (found, expected) in numbers(&answer[name]).iter().zip(&expected) {
                let off = (found - expected).abs();
                assert!(off <= most * size, "{robot} {name} {found} {expected}");
            }
        }
        assert_eq!(answer["shown"], answer["tau_u"][0]);
        assert!(answer["deviation"]["worst"].as_f64().unwrap() <= most);
        assert_eq!(answer["deviation"]["left"], 0);
        assert_eq!(answer["back"], true);
        // the picture changes where the rod goes
        assert!(answer["moved"].as_f64().unwrap() > 0.02);
        assert_ne!(answer["there"], answer["gone"]);
        assert!(answer["there"][3].as_f64().unwrap() > 200.0);
        let u = numbers(&answer["u"])[0];
        let by_u = answer["by_u"][0].as_f64().unwrap();
        assert!((by_u - u).abs() < 1e-11, "{by_u} {u}");
    }
}

#[test]
fn no_size_of_window_is_white_or_wider_than_itself() {
    let script = "
        answer.painted = painted();
        answer.wide = document.documentElement.scrollWidth;
        answer.width = innerWidth;
        answer.labelled = [...document.querySelectorAll('#sliders input')].every(
            (input) => input.labels.length === 1 && input.tabIndex === 0);
    ";
    for size in SIZES {
        let Some(answer) = run("r3_lambda_r", script, size, "") else { return };
        println!("{size:?}: {answer}");
        assert!(answer["painted"].as_f64().unwrap() > 500.0);
        assert!(answer["wide"].as_f64() <= answer["width"].as_f64());
        assert_eq!(answer["labelled"], true);
    }
}

#[test]
fn names_of_a_file_end_no_script() {
    let (urdf, submechanisms) = texts(&Source::Bundled("lambda".to_owned())).unwrap();
    let in_xml = "\"&lt;/script&gt;&lt;b&gt;@SCRIPTS@@NUMBERS@\"";
    let in_yaml = "'</script><b>@SCRIPTS@@NUMBERS@'";
    let urdf = String::from_utf8(urdf).unwrap().replace("\"Elbow\"", in_xml);
    let yaml = String::from_utf8(submechanisms.unwrap()).unwrap();
    let yaml = yaml.replace("[Elbow]", &format!("[{in_yaml}]"));
    let yaml = yaml.replace("[Elbow,", &format!("[{in_yaml},"));
    let source = Source::Text { urdf: urdf.into_bytes(), submechanisms: Some(yaml.into_bytes()) };
    let loaded = load(&source, &Options::default()).unwrap();
    let names = &loaded.compiled.model.info().tree;
    assert!(names.iter().any(|joint| joint.contains("</script>")), "{names:?}");
    let text = page(&loaded, &Settings::new(&source, &Options::default(), false)).unwrap();
    assert_eq!(text.matches("<script").count(), text.matches("</script").count());
    assert!(!text.contains("<b>@"));
}

#[test]
fn a_pose_that_is_missing_has_a_red_outline_and_its_reason_in_words() {
    // the page's word for each pose, and the end of the way to it
    let script = "
        const asked = @ASKED@;
        answer.found = asked.map((y) => {
            set(start());
            set(normalised([...y]));
            return { status: element('status').dataset.status, words: element('status').textContent,
                red: element('picture').className === 'bad', last: now.answer.y };
        });
    ";
    let motors = "
        // by its motors, far beyond their reach
        set(start());
        now.by = 'u';
        const before = [...now.answer.u];
        slide(0, before[0] + 50);
        const spoken = element('status');
        answer.motor = { status: spoken.dataset.status, words: spoken.textContent,
            red: element('picture').className === 'bad', kept: now.answer.u[0] === before[0] };
    ";
    for robot in ["bricard", "four_bars_2", "lambda"] {
        let loaded = loaded(robot);
        let model = &loaded.compiled.model;
        let want = FieldSet::of(&[Field::Q]);
        let query = Query::new(Request::Kinematics, FieldSet::of(&[Field::Y]), want);
        let plan = Plan::new(model, &query).unwrap();
        let mut workspace = Workspace::for_plans(model, [&plan]);
        let n = plan.given().len();
        let asked: Vec<Vec<f64>> = (0..12)
            .map(|k| (0..n).map(|i| 3.1 * (f64::from(k) * 0.7 + 2.3 * i as f64).sin()).collect())
            .collect();
        let motors = if robot == "lambda" { motors } else { "" };
        let script = script.replace("@ASKED@", &format!("{asked:?}")) + motors;
        let Some(answer) = run(robot, &script, [1280, 800], "") else { return };
        let mut seen = Vec::new();
        for (y, found) in asked.iter().zip(answer["found"].as_array().unwrap()) {
            let mut output = vec![0.0; plan.want().len()];
            let status = plan.run(model, &mut workspace, y, &mut output).status;
            let word = found["status"].as_str().unwrap();
            let is_right = match word {
                "ok" | "no_forces" => status == Status::Ok,
                "unreachable" => [
                    Status::Unreachable,
                    Status::BranchChanged,
                    Status::SingularClosure,
                    Status::SingularIndependents,
                ]
                .contains(&status),
                // the page's Newton method gives up before the plan's
                _ => true,
            };
            assert!(is_right, "{robot} {y:?}: {word}, the plan {}", status.name());
            if status == Status::Unreachable {
                assert_eq!(found["red"], true, "{robot} {y:?} {found}");
                let words = found["words"].as_str().unwrap();
                assert!(words.contains("comes to"), "{words}");
                // the pose that stands is the start
                assert!(numbers(&found["last"]).iter().all(|x| x.abs() < 1.0), "{found}");
            }
            seen.push((word.to_owned(), status.name()));
        }
        let words: std::collections::BTreeSet<_> = seen.into_iter().collect();
        println!("{robot}: {words:?}; {}", answer["motor"]);
        let is_there = |word: &str| words.iter().any(|(found, _)| found == word);
        assert!(is_there("ok") && (robot != "bricard" || is_there("unreachable")));
        if robot == "lambda" {
            let motor = &answer["motor"];
            assert_eq!((&motor["status"], &motor["red"]), (&"no_motors".into(), &true.into()));
            assert_eq!(motor["kept"], true, "{motor}");
            assert!(motor["words"].as_str().unwrap().contains("ElbowAct comes to"), "{motor}");
        }
    }
}

/// A cube of side 2 around (3, 0, 0) as a text.
fn cube() -> String {
    let mut text = String::new();
    for k in 0..8 {
        let side = |bit: i32| if k & bit == 0 { -1 } else { 1 };
        text += &format!("v {} {} {}\n", 3 + side(1), side(2), side(4));
    }
    for face in ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"] {
        text += &format!("f {face}\n");
    }
    text
}

#[test]
fn shapes_of_a_urdf_stand_on_their_links() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("shapes");
    std::fs::create_dir_all(folder.join("meshes")).unwrap();
    std::fs::write(folder.join("meshes/cube.obj"), cube()).unwrap();
    std::fs::write(folder.join("meshes/scene.dae"), "<COLLADA/>").unwrap();
    let urdf = "<robot name='arm'>
        <material name='red'><color rgba='1 0 0 1'/></material>
        <link name='base'><visual><geometry><box size='0.2 0.2 0.1'/></geometry></visual></link>
        <link name='arm'>
          <inertial><mass value='1'/>
            <inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial>
          <visual><origin xyz='0.3 0 0' rpy='0 1.5707963267948966 0'/>
            <geometry><cylinder radius='0.05' length='0.6'/></geometry></visual>
          <visual><origin xyz='0.6 0 0'/><geometry><sphere radius='0.1'/></geometry>
            <material name='red'/></visual>
          <visual><geometry>
            <mesh filename='package://arm/meshes/cube.obj' scale='0.1 0.1 0.1'/></geometry></visual>
          <visual><geometry><mesh filename='meshes/scene.dae'/></geometry></visual>
          <visual><geometry><mesh filename='meshes/none.stl'/></geometry></visual>
        </link>
        <joint name='turn' type='continuous'><parent link='base'/><child link='arm'/>
          <axis xyz='0 0 1'/></joint>
        </robot>";
    let path = folder.join("arm.urdf");
    std::fs::write(&path, urdf).unwrap();
    let source = Source::Files { urdf: path, submechanisms: None };
    let loaded = load(&source, &Options::default()).unwrap();
    let settings = Settings::new(&source, &Options::default(), false);
    let script = "
        answer.kinds = robot.visuals.map((of) => of.kind);
        answer.middles = shapes.map(([k, , , at]) => placed(view.worlds[k], at.slice(0, 3)));
        answer.corners = meshes.map((mesh) => mesh.length);
        answer.notes = element('fine').textContent;
        set([0.5]);
        view.shown.boxes = view.shown.axes = false;
        answer.shown = look(placed(view.worlds[1], [0.6, 0, 0.08]));
        view.shown.shapes = false;
        answer.hidden = look(placed(view.worlds[1], [0.6, 0, 0.08]));
    ";
    for (meshes, corners) in [(Meshes::All, 36), (Meshes::Hull, 36)] {
        let text = page(&loaded, &Settings { meshes, ..settings.clone() }).unwrap();
        let Some(answer) = run_page("shapes", &text, script, [1280, 800], "") else { return };
        println!("{answer}");
        assert_eq!(answer["kinds"], serde_json::json!(["box", "cylinder", "sphere", "mesh"]));
        for (found, expected) in answer["middles"].as_array().unwrap().iter().zip([
            [0.0, 0.0, 0.0],
            [0.3, 0.0, 0.0],
            [0.6, 0.0, 0.0],
            [0.3, 0.0, 0.0],
        ]) {
            let found = numbers(found);
            let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f64::max) < 1e-9, "{found:?} {expected:?}");
        }
        assert_eq!(answer["corners"], serde_json::json!([3 * corners]));
        let notes = answer["notes"].as_str().unwrap();
        assert!(notes.contains("meshes/scene.dae is neither STL nor OBJ"), "{notes}");
        assert!(notes.contains("meshes/none.stl is not there"), "{notes}");
        // the sphere is red, and gone without shapes
        let [shown, hidden] = ["shown", "hidden"].map(|name| numbers(&answer[name]));
        assert!(shown[0] > 2.0 * shown[1] && shown[0] > 2.0 * shown[2], "{shown:?}");
        assert_ne!(shown, hidden);
    }
    let none = page(&loaded, &Settings { meshes: Meshes::None, ..settings }).unwrap();
    assert!(none.contains("\"visuals\":[]") && none.contains("\"meshes\":[]"));
}

#[test]
fn a_motion_moves_the_robot_with_the_cursor_of_its_curves() {
    let loaded = loaded("lambda");
    let model = &loaded.compiled.model;
    let want = FieldSet::of(&[Field::Q, Field::SigmaMin]);
    let query = Query::new(Request::Kinematics, FieldSet::of(&[Field::Y]), want);
    let plan = Plan::new(model, &query).unwrap();
    let mut workspace = Workspace::for_plans(model, [&plan]);
    let mut of =
        Motion { samples: 50_000, command: "sarrus simulate".to_owned(), ..Motion::default() };
    let mut y = Vec::new();
    for k in 0..5000 {
        let time = f64::from(k) / 1000.0;
        y.push(1.6 * (2.0 * time).sin());
        let mut output = vec![0.0; plan.want().len()];
        let answer = plan.run(model, &mut workspace, &[y[y.len() - 1]], &mut output);
        assert_eq!(answer.status, Status::Ok);
        let range = |field| plan.want().slot(field).unwrap().range();
        of.times.push(time);
        of.q.push(output[range(Field::Q)].to_vec());
        of.sigma_min.push(output[range(Field::SigmaMin)][0]);
    }
    let limits = [Some(-1.5), Some(1.5)];
    let curve = |name: &str, values: Vec<f64>| Curve { name: name.to_owned(), values, limits };
    let gap = y.iter().map(|x| if *x > 1.0 { f64::NAN } else { x.abs() }).collect();
    of.charts = vec![
        Chart { title: "y, rad".to_owned(), log: false, curves: vec![curve("Elbow", y.clone())] },
        Chart { title: "gap".to_owned(), log: true, curves: vec![curve("gap", gap)] },
    ];
    let text = motion(&loaded, &settings("lambda"), &of);
    assert!(text.len() < 3_000_000 && references(&text) == 0);
    let script = "
        answer.points = run.times.length;
        answer.deviation = deviation;
        answer.charts = charts.length;
        const middle = () => rods.map(([a, p]) => placed(view.worlds[a], p));
        const far = (a, b) => Math.max(...a.map((p, k) => distance(p, b[k])));
        const before = middle();
        const slider = element('time');
        const at = run.times.findIndex((t) => t > 0.4);
        slider.value = at;
        slider.dispatchEvent(new Event('input'));
        answer.moved = far(before, middle()) / view.size;
        answer.red = element('picture').className;
        answer.words = element('status').textContent;
        // the pointer on a curve takes the robot and the other curve along
        const u = charts[0];
        u.setCursor({ left: u.valToPos(run.times[at + 300], 'x'), top: 20 });
        answer.followed = place - at - 300;
        answer.other = charts[1].cursor.idx - place;
        answer.clock = element('clock').textContent;
        answer.wide = document.documentElement.scrollWidth - innerWidth;
        answer.inside = [...document.querySelectorAll('.uplot')].every(
            (of) => of.getBoundingClientRect().right <= innerWidth + 1);
        answer.painted = painted();
        answer.labelled = slider.labels.length === 1 && slider.tabIndex === 0;
    ";
    for size in SIZES {
        let Some(answer) = run_page("motion", &text, script, size, "") else { return };
        println!("{size:?}: {answer}");
        assert_eq!(answer["points"], 2000);
        assert_eq!(answer["charts"], 2);
        assert!(answer["deviation"].as_f64().unwrap() < 1e-12);
        assert!(answer["moved"].as_f64().unwrap() > 0.02);
        // 1.6 sin 0.8 is within the limits, the pose of the pointer is not
        assert!(answer["followed"].as_f64().unwrap().abs() <= 2.0, "{answer}");
        assert_eq!(answer["other"], 0);
        assert!(answer["wide"].as_f64().unwrap() <= 0.0 && answer["inside"] == true);
        assert!(answer["painted"].as_f64().unwrap() > 500.0);
        assert_eq!(answer["labelled"], true);
    }
}

#[test]
fn a_map_of_motors_shows_the_numbers_of_its_point_at_every_size() {
    for (robot, grid) in [("torso", 21), ("lambda", 41), ("stewart", 2)] {
        let choices = Choices { grid: Some(grid), ..Choices::default() };
        let maps = capability(&loaded(robot), &choices, &mut |_| {}).unwrap();
        let text = capability_page(robot, &maps);
        assert!(!text.contains("https://") && !text.contains("http://"));
        let script = "
            const body = element('numbers').tBodies[0];
            answer.before = [...body.rows].map((row) => row.cells[1].textContent);
            canvas.dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowRight' }));
            answer.at = state.at;
            answer.point = map().points[index(state.at)];
            answer.torque = map().torque_max[index(state.at)];
            answer.after = [...body.rows].map((row) => row.cells[1].textContent);
            for (let k = 0; k < quantities().length; k++) { state.quantity = k; draw(); }
            const brush = canvas.getContext('2d');
            const data = brush.getImageData(0, 0, canvas.width, canvas.height).data;
            answer.colours = new Set(data).size;
            answer.wide = document.documentElement.scrollWidth - innerWidth;
        ";
        for size in SIZES {
            let Some(answer) = run_page(&format!("map_{robot}"), &text, script, size, "") else {
                return;
            };
            assert_ne!(answer["before"], answer["after"], "{robot}");
            let shown: f64 = answer["after"][0].as_str().unwrap().parse().unwrap();
            assert!((shown - numbers(&answer["point"])[0]).abs() < 1e-4, "{answer}");
            assert!(answer["colours"].as_u64().unwrap() > 20, "{answer}");
            assert!(
                answer["wide"].as_i64().unwrap() <= 0,
                "{robot} at {size:?} is wider than its window"
            );
        }
    }
}
