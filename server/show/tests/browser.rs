//! The page in headless Chromium: a slider moves the robot, the numbers are the plan's.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::path::PathBuf;
use std::process::{Command, Stdio};

use sarrus_dynamics::{Field, FieldSet, Plan, Query, Request, Status, Workspace};
use sarrus_models::{Loaded, Options, Source, load, texts};
use sarrus_show::{Settings, page};
use serde_json::Value;

/// Width and height of windows: a phone, on its side too, a laptop, a large screen.
const SIZES: [[u32; 2]; 4] = [[390, 844], [844, 390], [1280, 800], [2560, 1440]];

fn loaded(robot: &str) -> Loaded {
    load(&Source::Bundled(robot.to_owned()), &Options::default()).unwrap()
}

fn settings(robot: &str) -> Settings {
    Settings::new(&Source::Bundled(robot.to_owned()), &Options::default(), false)
}

/// The `answer` of a script at the end of a page, with no error on the way; none without a browser.
fn run(robot: &str, script: &str, [width, height]: [u32; 2], hash: &str) -> Option<Value> {
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
    let text = page(&loaded(robot), &settings(robot)).unwrap();
    let errors = "<script>const errors = [];
        addEventListener('error', (event) => errors.push(event.message));
        console.error = (...words) => errors.push(words.join(' '));</script>";
    let script = format!(
        "<script>const answer = {{}};
        {{
            try {{ {script} }} catch (error) {{ errors.push(String(error)); }}
            const out = document.createElement('pre');
            out.id = 'answer';
            out.textContent = JSON.stringify({{ ...answer, errors }});
            document.body.append(out);
        }}</script>"
    );
    let text = text.replacen("<head>", &format!("<head>{errors}"), 1);
    let text = text.replace("</body>", &format!("{script}</body>"));
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let path = folder.join(format!("{robot}_{width}_{height}{}.html", hash.replace('#', "_")));
    std::fs::write(&path, text).unwrap();
    let mut command = Command::new("timeout");
    command.args(["60", browser, "--headless=new", "--no-sandbox", "--disable-gpu-sandbox"]);
    command.args(["--use-gl=angle", "--use-angle=swiftshader"]);
    command.args(["--virtual-time-budget=4000", "--dump-dom"]);
    command.arg(format!("--user-data-dir={}", path.with_extension("profile").display()));
    command.arg(format!("--window-size={width},{height}"));
    let output = command.arg(format!("file://{}{hash}", path.display())).output().unwrap();
    let dom = String::from_utf8_lossy(&output.stdout);
    let answer = dom.rsplit_once("<pre id=\"answer\">").unwrap_or_else(|| panic!("{dom:.300}")).1;
    let answer = answer.split_once("</pre>").unwrap().0;
    let answer: Value =
        serde_json::from_str(&answer.replace("&lt;", "<").replace("&amp;", "&")).unwrap();
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

#[test]
fn a_page_is_one_small_file_without_outside_references() {
    for (robot, _) in sarrus_models::bundled() {
        let text = page(&loaded(robot), &settings(robot)).unwrap();
        assert!(text.len() < 3_000_000, "{}", text.len());
        let outside = text.split("http").skip(1).filter(|rest| {
            let rest = rest.trim_start_matches('s');
            rest.starts_with("://") && !rest.starts_with("://www.w3.org/")
        });
        assert_eq!(outside.count(), 0, "{robot}");
        let scripts = text.matches("<script").count();
        assert_eq!(scripts, text.matches("</script>").count());
        println!("{robot}: {} bytes", text.len());
    }
}

#[test]
fn a_slider_moves_the_robot_and_the_numbers_are_the_plans() {
    let script = "
        // the colour at a point of the root's frame, and whether it is the ground's
        const copy = document.createElement('canvas');
        const look = (p) => {
            view.draw();
            copy.width = view.canvas.width;
            copy.height = view.canvas.height;
            const of = copy.getContext('2d');
            of.drawImage(view.canvas, 0, 0);
            const scale = copy.width / view.canvas.clientWidth;
            const [x, y] = pixel(p, view.canvas.clientWidth, view.canvas.clientHeight);
            return [...of.getImageData(Math.round(x * scale), Math.round(y * scale), 1, 1).data];
        };
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
        view.draw();
        const copy = document.createElement('canvas');
        copy.width = copy.height = 200;
        const of = copy.getContext('2d');
        of.drawImage(view.canvas, 0, 0, 200, 200);
        const all = of.getImageData(0, 0, 200, 200).data;
        answer.painted = all.filter((x, k) => k % 4 === 3 && x > 100).length;
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
