//! install.sh: prefixes with any valid name, packages, and refusals.

use std::path::Path;
use std::process::{Command, Output};

use super::{CPP, folder, fresh_folder, libraries, present, soname};

/// install.sh in a folder.
fn install(place: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(folder().join("install.sh"));
    command.args(arguments).current_dir(place).env_remove("DESTDIR").env_remove("LIBDIR");
    command
}

fn words(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Compiles the page's program in C++ in a shell with the flags of pkg-config, and runs it.
fn compiles(place: &Path, prefix: &Path, libdir: &str) {
    let tools = Command::new("pkg-config").arg("--version").output();
    let Some(compiler) = tools.ok().and(present(&CPP).into_iter().next()) else {
        return println!("not run: no pkg-config or compiler");
    };
    std::fs::write(place.join("first.cpp"), &super::page::blocks("cpp")[0]).unwrap();
    // a shell must evaluate pkg-config's escapes once more
    let script = "eval $COMPILER -std=c++20 first.cpp -o first $(pkg-config --cflags --libs sarrus) \
                  && ./first";
    let library = prefix.join(libdir);
    let mut shell = Command::new("sh");
    shell.args(["-euc", script]).current_dir(place).env("COMPILER", compiler);
    shell.env("PKG_CONFIG_PATH", library.join("pkgconfig")).env("LD_LIBRARY_PATH", &library);
    let output = shell.output().unwrap();
    assert!(output.status.success(), "{}", words(&output));
    assert_eq!(String::from_utf8_lossy(&output.stdout), "16.8023\n");
}

#[test]
fn a_prefix_may_have_spaces_and_be_relative() {
    let place = fresh_folder();
    let built = libraries();
    // twice, since the second run replaces a library
    for _ in 0..2 {
        let output = install(&place, &["a place/of mine", built.to_str().unwrap()]).output();
        let output = output.unwrap();
        assert!(output.status.success(), "{}", words(&output));
    }
    let prefix = place.join("a place/of mine");
    let link = std::fs::read_link(prefix.join("lib/libsarrus.so")).unwrap();
    assert_eq!(link, Path::new(&soname()));
    compiles(&place, &prefix, "lib");
    std::fs::remove_dir_all(&place).unwrap();
}

#[test]
fn a_package_is_put_together_elsewhere_and_names_its_prefix_only() {
    let place = fresh_folder();
    let built = libraries();
    let stage = place.join("stage");
    let mut command = install(&place, &["/opt/robots", built.to_str().unwrap()]);
    let libdir = "lib/some-multiarch";
    let output = command.env("DESTDIR", &stage).env("LIBDIR", libdir).output().unwrap();
    assert!(output.status.success(), "{}", words(&output));
    let library = stage.join("opt/robots").join(libdir);
    for name in ["pkgconfig/sarrus.pc", "cmake/sarrus/sarrus-config.cmake"] {
        let text = std::fs::read_to_string(library.join(name)).unwrap();
        assert!(!text.contains("stage") && !text.contains('@'), "{name}: {text}");
    }
    let text = std::fs::read_to_string(library.join("pkgconfig/sarrus.pc")).unwrap();
    assert!(text.starts_with("prefix=/opt/robots\n"), "{text}");
    assert!(text.contains("libdir=${prefix}/lib/some-multiarch\n"), "{text}");
    assert!(library.join("libsarrus.a").exists() && library.join(soname()).exists());
    std::fs::remove_dir_all(&place).unwrap();
}

#[test]
fn what_cannot_be_installed_is_said_before_anything_is_built() {
    let place = fresh_folder();
    let empty = place.join("empty");
    std::fs::create_dir(&empty).unwrap();
    let empty = empty.to_str().unwrap();
    for (arguments, libdir, part, code) in [
        (&[][..], "lib", "usage: ", 2),
        (&["--prefix=/opt"], "lib", "usage: ", 2),
        (&["", empty], "lib", "usage: ", 2),
        (&["--portable", "here", empty], "lib", "--portable is how it is built", 2),
        (&["a\"b"], "lib", "pkg-config cannot name ", 2),
        (&["here"], "../lib", "LIBDIR is a folder below PREFIX", 2),
        // not even root can write there
        (&["/proc/sarrus"], "lib", "cannot be written: choose another PREFIX", 1),
        (&["here", empty], "lib", "has no libsarrus.so and libsarrus.a", 1),
    ] {
        let output = install(&place, arguments).env("LIBDIR", libdir).output().unwrap();
        let words = words(&output);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {words}");
        assert!(words.contains(part), "{arguments:?}: {words}");
    }
    std::fs::remove_dir_all(&place).unwrap();
}
