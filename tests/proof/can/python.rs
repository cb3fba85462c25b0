//! The Python package: that it loads and says what it is made of.

use sarrus_tests::python::environment;

#[test]
fn the_package_loads_and_has_the_protocols_of_the_core() {
    let script = "import sarrus, sarrus._native as n; print(sarrus.__version__); print(*[p['name'] for p in n.protocols()])";
    let output = environment().command(&["-c", script]).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let mut text = env!("CARGO_PKG_VERSION").to_owned() + "\n";
    let names: Vec<&str> = sarrus_can::protocol::PROTOCOLS.iter().map(|protocol| protocol.name).collect();
    text += &(names.join(" ") + "\n");
    assert_eq!(String::from_utf8(output.stdout).unwrap(), text);
}
