use super::*;
use std::os::unix::fs::PermissionsExt;

#[test]
fn names_that_could_leave_the_domain_are_refused() {
    for name in ["", "a/b", "a b", "ä", ".", "..", ".a", &"x".repeat(MAX_NAME + 1)] {
        assert!(matches!(ServerName::new(name), Err(DomainError::Name(_))), "{name}");
    }
    assert_eq!(ServerName::new("rh5.v2_upper-body").unwrap().as_str(), "rh5.v2_upper-body");
}

#[test]
fn domains_have_prefixes_of_their_own() {
    let base = std::env::temp_dir().join(format!("sarrus-domain-test-{}", std::process::id()));
    let [a, b] = ["a", "b"].map(|name| Domain::at(&base.join(name)).unwrap());
    assert_ne!(a.prefix(), b.prefix());
    // reading a domain creates nothing
    assert!(!base.exists());
}

#[test]
fn a_root_that_was_there_before_stays_and_one_that_was_made_goes() {
    let base = std::env::temp_dir().join(format!("sarrus-domain-made-{}", std::process::id()));
    let [named, made] = ["named", "made/deeper"].map(|name| base.join(name));
    fs::create_dir_all(&named).unwrap();
    fs::set_permissions(&named, fs::Permissions::from_mode(0o2750)).unwrap();
    for root in [&named, &made] {
        let domain = Domain::at(root).unwrap();
        drop(domain.node().unwrap());
        assert!(root.join(PREFIX).exists());
        // a file of another program keeps the directory
        fs::write(root.join("mine"), "").unwrap();
        assert!(!domain.clear_nodes().contains(root));
        assert!(root.join("mine").exists() && !root.join(PREFIX).exists());
        fs::remove_file(root.join("mine")).unwrap();
        assert_eq!(domain.clear_nodes().contains(root), root == &made);
    }
    assert!(!made.exists());
    assert_eq!(fs::read_dir(&named).unwrap().count(), 0);
    assert_eq!(fs::metadata(&named).unwrap().mode() & 0o7777, 0o2750);
    fs::remove_dir_all(&base).unwrap();
}

#[test]
fn the_counter_of_nodes_has_the_name_that_is_known_and_is_closed_to_others() {
    let root = std::env::temp_dir().join(format!("sarrus-domain-count-{}", std::process::id()));
    let domain = Domain::at(&root).unwrap();
    let node = domain.node().unwrap();
    let random = fs::read_to_string(root.join(PREFIX)).unwrap();
    let prefix = format!("{}{random}_", domain.prefix());
    let path = counter(&prefix).unwrap();
    assert!(path.to_str().unwrap().ends_with(COUNTER), "{path:?}");
    assert_eq!(fs::metadata(&path).unwrap().mode() & 0o777, 0o600);
    assert!(used_files(&prefix).contains(&path));
    drop(node);
    domain.clear_nodes();
    assert!(!path.exists());
}

#[test]
fn a_directory_of_somebody_else_is_refused() {
    for path in ["relative", "/tmp/Müller", "/tmp/a\"quote", "/tmp/two\nlines"] {
        let error = Domain::at(Path::new(path)).unwrap_err();
        assert!(matches!(error, DomainError::Path(_)), "{error}");
    }
    let open = std::env::temp_dir().join(format!("sarrus-open-{}", std::process::id()));
    fs::create_dir(&open).unwrap();
    let group = fs::metadata(&open).unwrap().gid();
    for (mode, is_open) in [(0o700, false), (0o750, false), (0o702, true), (0o720, true)] {
        fs::set_permissions(&open, fs::Permissions::from_mode(mode)).unwrap();
        // a group of the user's own number has no other member
        let is_own = mode == 0o720 && group == rustix::process::geteuid().as_raw();
        let found = matches!(Domain::at(&open), Err(DomainError::Open(_)));
        assert_eq!(found, is_open && !is_own, "{mode:o}");
    }
    if std::os::unix::fs::chown(&open, None, Some(group + 1)).is_ok() {
        fs::set_permissions(&open, fs::Permissions::from_mode(0o720)).unwrap();
        assert!(matches!(Domain::at(&open), Err(DomainError::Open(_))));
    }
    fs::remove_dir(&open).unwrap();
    let link = std::env::temp_dir().join(format!("sarrus-link-{}", std::process::id()));
    std::os::unix::fs::symlink("/tmp", &link).unwrap();
    let error = Domain::at(&link).and_then(|domain| domain.make_root()).unwrap_err();
    fs::remove_file(&link).unwrap();
    assert!(error.to_string().contains("not a directory"), "{error}");
    // the first process's directory is never ours unless we are root
    if !rustix::process::geteuid().is_root() {
        assert!(matches!(Domain::at(Path::new("/proc/1")), Err(DomainError::Foreign { .. })));
    }
}
