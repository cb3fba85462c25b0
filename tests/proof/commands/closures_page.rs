//! The documentation's page of closures matches the output of `sarrus check`.
//!
//! After a change: `SARRUS_UPDATE=1 cargo test --release -p sarrus-tests --test proof
//! closures_page`.

use std::fmt::Write;
use std::path::Path;

use super::run;

const PATH: &str = "../models/src/closures.md";
const HEAD: &str = "\
# Closures

How the loops of each bundled robot are closed. `sarrus check --robot NAME` prints these tables, and
a test compares them.

- `closure`: `analytic` by a closed form, `numerical` by Newton's method on the rows, `serial`
  without loops.
- `rows` is the number of constraint rows, `rank` the number of independent ones; the `redundant`
  ones follow from them and are left out.
- `idle` joints turn a rod between its ball joints and nothing else; they keep their first value.
- `branch` is the sign of det K_d at the zero pose, one for each cluster that can be assembled in
  two ways, 0 where the pose is singular.
- `misfit` is the distance of the geometry from the one that the closed form assumes, relative to
  the mechanism's size.
- `sigma` and `cond` are the least singular value and the condition number of the scaled K_d at the
  zero pose.
- `parts` are the rows in the order in which they are solved: couplings (`linear`), pairs of links
  in a plane (`dyad`), legs (`leg`) and the turns of rods (`rod`) in closed form, and blocks of
  Newton's method (`newton`), of which a rod takes one row, its length. Where there is a table of
  closed poses, forms that are found answer in its cells, and Newton's method on all rows beyond
  them and from a guess.
- `starts without a guess` is the table of closed poses, made at load, from which Newton's method
  starts where no pose is given: its cells in use, and its size.
- Singular poses are those of the type: where the dependents cannot be distinguished from
  the independents.

";

/// The table of one robot and its lines below.
fn printed(robot: &str) -> String {
    let run = run(&["check", "--robot", robot], b"");
    assert_eq!(run.code, Some(0), "{robot} {run:?}");
    let lines = run
        .out
        .lines()
        .skip_while(|line| !line.starts_with("submechanism "))
        .take_while(|line| !line.is_empty());
    lines.fold(String::new(), |text, line| text + line + "\n")
}

/// The first submechanism of each type among the bundled robots.
fn types() -> String {
    let mut text =
        "| type | robot | closure | rows | rank | redundant | idle | branches | singular poses |\n\
         |---|---|---|---|---|---|---|---|---|\n"
            .to_owned();
    let mut known = Vec::new();
    for (robot, _) in sarrus_models::bundled() {
        let report = run(&["check", "--format", "json", "--robot", robot], b"").json().remove(0);
        for of in report["closures"].as_array().unwrap() {
            let word = |key: &str| of[key].as_str().unwrap().to_owned();
            let count = |key: &str| of[key].as_array().unwrap().len();
            let kind = (word("type"), word("kind"), of["rows"].clone());
            if of["rows"] == 0 || known.contains(&kind) {
                continue;
            }
            let branches = ["none", "±"][count("branch").min(1)];
            let singular = word("singular");
            let singular = if singular.is_empty() { "no general rule" } else { &singular };
            let numbers = format!(
                "{} | {} | {} | {}",
                of["rows"],
                of["rank"],
                count("redundant"),
                count("idle")
            );
            writeln!(
                text,
                "| {} | `{robot}` | {} | {numbers} | {branches} | {singular} |",
                kind.0, kind.1
            )
            .unwrap();
            known.push(kind);
        }
    }
    text
}

fn page() -> String {
    let mut page = format!("{HEAD}## Types\n\n{}", types());
    for (robot, about) in sarrus_models::bundled() {
        write!(page, "\n## `{robot}`\n\n{about}\n\n```text\n{}```\n", printed(robot)).unwrap();
    }
    page
}

#[test]
fn closures_page_is_what_check_prints() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(PATH);
    let page = page();
    if std::env::var_os("SARRUS_UPDATE").is_some() {
        std::fs::write(&path, &page).unwrap();
    }
    let written = std::fs::read_to_string(&path).unwrap();
    assert!(
        written == page,
        "the page is stale: SARRUS_UPDATE=1 cargo test --release -p sarrus-tests --test proof \
         closures_page"
    );
}

#[test]
fn parts_name_rows_and_joints_in_the_order_of_solution() {
    let parts = |robot: &str| -> Vec<(String, u64, Vec<String>)> {
        let report = run(&["check", "--format", "json", "--robot", robot], b"").json().remove(0);
        let closures = report["closures"].as_array().unwrap();
        let parts = closures.iter().flat_map(|of| of["parts"].as_array().unwrap());
        let names = |list: &serde_json::Value| {
            list.as_array().unwrap().iter().map(|x| x.as_str().unwrap().to_owned()).collect()
        };
        parts
            .map(|part| {
                let method = part["method"].as_str().unwrap().to_owned();
                (method, part["rows"].as_u64().unwrap(), names(&part["joints"]))
            })
            .collect()
    };
    let of = |method: &str, rows: u64, joints: &[&str]| {
        (method.to_owned(), rows, joints.iter().map(|x| (*x).to_owned()).collect::<Vec<_>>())
    };
    assert_eq!(parts("five_bar"), [of("dyad", 2, &["left_elbow", "right_elbow"])]);
    assert_eq!(
        parts("squeezer"),
        [
            of("dyad", 2, &["Theta", "gamma"]),
            of("dyad", 2, &["delta", "Phi"]),
            of("dyad", 2, &["epsilon", "Omega"])
        ]
    );
    for robot in ["delta", "active_ankle"] {
        let parts = parts(robot);
        let rows: Vec<(&str, u64)> = parts.iter().map(|x| (x.0.as_str(), x.1)).collect();
        let rods = [("rod", 2); 6];
        assert_eq!(rows, [&[("newton", 6)][..], &rods].concat(), "{robot}");
    }
    assert!(parts("rh5v2_full").iter().any(|(method, rows, _)| method == "serial" && *rows == 0));
}
