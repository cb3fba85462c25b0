//! Two domains, each with a server of the same name: neither sees or disturbs the other.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::time::Duration;

use sarrus_client::{ConnectError, Status, Transport};

use crate::support::{Asker, ROBOT, Sandbox};

/// A client through each transport.
fn askers(sandbox: &Sandbox) -> [Asker; 2] {
    [Transport::Lane, Transport::Service]
        .map(|transport| Asker::new(sandbox.connect("twin", transport).unwrap()))
}

/// The exit code and the texts of a command in a domain.
fn sarrus(sandbox: &Sandbox, arguments: &[&str]) -> (Option<i32>, String) {
    let (code, results, reasons) = sandbox.sarrus(arguments);
    (code, results + &reasons)
}

#[test]
fn servers_of_one_name_in_two_domains_do_not_meet() {
    let here = Sandbox::new();
    let there = here.another();
    let server = here.serve_robot(ROBOT, "twin", &["--lanes", "2"]);
    let mut honest = askers(&here);
    let mut bits = Vec::new();
    for asker in &mut honest {
        assert_eq!(asker.ask().unwrap().status, Status::Ok);
        bits.push(asker.bits());
    }
    // until its first, smaller lane is given back
    while honest[0].robot.statistics().unwrap().lanes_taken > 1 {
        std::thread::sleep(Duration::from_millis(1));
    }
    let files = here.leftovers();
    assert!(!files.is_empty());

    for round in 0..3 {
        let twin = there.serve_robot("lambda", "twin", &["--lanes", "2"]);
        let mut clients = askers(&there);
        for client in &mut clients {
            // each has the robot of its own domain, and its own process
            assert_ne!(client.robot.model().fingerprint, honest[0].robot.model().fingerprint);
            assert_eq!(client.robot.statistics().unwrap().process, u64::from(twin.id()));
            assert_eq!(client.ask().unwrap().status, Status::Ok);
        }
        assert_eq!(honest[0].robot.statistics().unwrap().process, u64::from(server.id()));
        // stopped, and killed with and without its clients, after which it is tidied away
        match round {
            0 => assert!(twin.stop().success()),
            1 => twin.kill(),
            _ => {
                drop(clients);
                twin.kill();
            }
        }
        assert_eq!(sarrus(&there, &["tidy"]).0, Some(0));
        assert_eq!(here.leftovers(), files);
        for (asker, bits) in honest.iter_mut().zip(&bits) {
            assert_eq!(asker.ask().unwrap().status, Status::Ok);
            assert_eq!(asker.bits(), *bits);
        }
    }
    assert_eq!(there.leftovers(), Vec::<PathBuf>::new());
    drop(honest);
    assert!(server.stop().success());
}

#[test]
fn a_folder_that_the_user_made_stays_as_it_was() {
    let here = Sandbox::new();
    let root = here.domain().root();
    fs::create_dir(root).unwrap();
    fs::set_permissions(root, fs::Permissions::from_mode(0o2770)).unwrap();
    assert!(here.serve("guest", &[]).stop().success());
    assert_eq!(here.leftovers(), [root.to_owned()]);
    here.serve("guest", &[]).kill();
    assert_eq!(sarrus(&here, &["tidy"]).0, Some(0));
    assert_eq!(here.leftovers(), [root.to_owned()]);
    assert_eq!(fs::metadata(root).unwrap().permissions().mode() & 0o7777, 0o2770);
}

#[test]
fn a_client_in_the_wrong_domain_hears_where_it_looked() {
    let here = Sandbox::new();
    let _server = here.serve("lost", &[]);
    let there = here.another();
    let root = there.domain().root().display().to_string();
    let missing = there.connect("lost", Transport::Lane).err().unwrap();
    assert!(matches!(missing, ConnectError::NoServer(..)), "{missing}");
    let said = format!(
        "no server named `lost` runs below {root}; start one with `sarrus serve --name lost`, or \
         name its folder in SARRUS_ROOT"
    );
    assert_eq!(missing.to_string(), said);
    for arguments in [&["top", "lost"][..], &["ask", "kinematics", "--connect", "lost"]] {
        let (code, words) = sarrus(&there, arguments);
        assert_eq!(code, Some(2), "{words}");
        assert!(words.contains(&said), "{words}");
    }
    assert!(!fs::exists(there.domain().root()).unwrap(), "looking makes nothing");
}
