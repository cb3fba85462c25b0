//! A hand that is dragged in headless Chromium, by the pointer, by keys and by a number.

use sarrus_dynamics::{Field, FieldSet, Plan, Query, Request, Status, Workspace};

use super::{answers, loaded, numbers, run};

#[test]
fn a_dragged_hand_moves_y_by_answers_inside_the_limits() {
    let script = "
        const canvas = view.canvas;
        // made events have no pointer that could be captured
        canvas.setPointerCapture = () => {};
        const seen = [];
        const outer = set;
        set = (...of) => {
            const found = outer(...of);
            const off = distance(at(), found.worlds[hand.link]);
            seen.push([found.status, found.exceeded.length, off]);
            return found;
        };
        const at = () => view.worlds[hand.link].slice(0, 3);
        const shown = () => pixel(at(), canvas.clientWidth, canvas.clientHeight);
        const point = (kind, [x, y]) => {
            const { left, top } = canvas.getBoundingClientRect();
            canvas.dispatchEvent(new PointerEvent(kind, { pointerId: 7, pointerType: 'mouse',
                clientX: left + x, clientY: top + y, bubbles: true }));
        };
        answer.link = element('held').selectedOptions[0].textContent;
        element('held').dispatchEvent(new Event('change'));
        outer(normalised(robot.y.map((of, k) => {
            const [lower, upper] = range(of);
            return of.part ? start()[k] : 0.6 * lower + 0.4 * upper;
        })));
        const before = now.answer.y;
        answer.allowed = now.answer.exceeded.length;
        // beside the hand the view turns, and y stays
        const [x, y] = shown();
        const yaw = view.yaw;
        point('pointerdown', [x + 40, y]);
        point('pointermove', [x + 50, y]);
        point('pointerup', [x + 50, y]);
        answer.turned = view.yaw !== yaw && now.answer.y === before;
        // on it the hand follows the pointer
        const from = shown();
        let to = from;
        point('pointerdown', from);
        for (let k = 0; k < 6; k++) {
            to = [to[0] + 2, to[1] - 1];
            point('pointermove', to);
        }
        answer.behind = Math.hypot(...shown().map((x, k) => x - to[k]));
        answer.began = Math.hypot(...from.map((x, k) => x - to[k]));
        point('pointerup', to);
        const held = now.answer.y;
        point('pointermove', from);
        answer.kept = now.answer.y === held && before !== held;
        answer.y = held;
        answer.pose = view.worlds[hand.link];
        answer.tau_u = now.answer.tau_u;
        // by keys
        const low = at()[2];
        const field = element('hand_z');
        field.dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowUp' }));
        answer.lifted = (at()[2] - low) / (view.size / 200);
        answer.field = [Number(field.value), at()[2]];
        answer.labelled = field.labels.length === 1 && field.tabIndex === 0;
        // far beyond reach
        element('hand_x').value = 100;
        element('hand_x').dispatchEvent(new Event('change'));
        answer.words = element('status').textContent;
        answer.seen = seen;
    ";
    let cases = [("r3_lambda_r", ""), ("stewart", "#lines"), ("rh5v2_upper_body", "")];
    for (robot, hash) in cases {
        let Some(answer) = run(robot, script, [1280, 800], hash) else { return };
        println!("{robot}: {answer}");
        let number = |name: &str| answer[name].as_f64().unwrap();
        assert_eq!((&answer["allowed"], &answer["turned"]), (&0.into(), &true.into()));
        assert!(number("behind") < 1e-3 && number("began") > 10.0, "{robot}");
        assert_eq!(answer["kept"], true, "{robot}");
        assert!((number("lifted") - 1.0).abs() < 1e-5, "{robot}");
        let [shown, there] = <[f64; 2]>::try_from(numbers(&answer["field"])).unwrap();
        assert!((shown - there).abs() < 1e-4 && answer["labelled"] == true, "{robot}");
        let words = answer["words"].as_str().unwrap();
        assert!(words.contains("m from its target"), "{robot}: {words}");
        // each pose on the way is an answer inside the limits
        let seen = answer["seen"].as_array().unwrap();
        assert!(seen.len() >= 8, "{robot}: {}", seen.len());
        assert!(seen.iter().all(|of| *of == serde_json::json!(["ok", 0, 0])), "{robot}");
        // and the last one of the pointer that of the plan
        let y = numbers(&answer["y"]);
        let loaded = loaded(robot);
        let model = &loaded.compiled.model;
        let link = model.info().link(answer["link"].as_str().unwrap()).unwrap();
        let want = FieldSet::of(&[Field::FramePose]);
        let query = Query::new(Request::Kinematics, FieldSet::of(&[Field::Y]), want);
        let plan = Plan::new(model, &query.with_frames(&[link])).unwrap();
        let mut expected = [0.0; 7];
        let mut workspace = Workspace::for_plans(model, [&plan]);
        assert_eq!(plan.run(model, &mut workspace, &y, &mut expected).status, Status::Ok);
        assert_eq!(numbers(&answer["pose"]), expected, "{robot}");
        assert_eq!(numbers(&answer["tau_u"]), answers(robot, &y, Field::TauU, None), "{robot}");
    }
}
