//! The page's instructions work: install, find by pkg-config and CMake, run its programs.

use std::path::{Path, PathBuf};
use std::process::Command;

use super::{C, CPP, folder, libraries, present};

/// The page's blocks in one language.
pub(super) fn blocks(language: &str) -> Vec<String> {
    let page = std::fs::read_to_string(folder().join("README.md")).unwrap();
    let blocks = page.split("```").skip(1).step_by(2);
    let of = |block: &str| block.strip_prefix(language)?.strip_prefix('\n').map(str::to_owned);
    blocks.filter_map(of).collect()
}

fn run(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// A folder with an installed library; removed when dropped.
struct Prefix(PathBuf);

impl Prefix {
    fn install() -> Prefix {
        let name = format!("sarrus-c-prefix-{}", std::process::id());
        let prefix = Prefix(std::env::temp_dir().join(name));
        let mut install = Command::new(folder().join("install.sh"));
        run(install.arg(prefix.path()).arg(libraries()));
        prefix
    }

    fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Prefix {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[test]
fn the_programs_of_the_page_run_with_the_installed_library() {
    let prefix = Prefix::install();
    let library = prefix.path().join("lib");
    let is_there = |tool: &str| {
        let found = Command::new(tool).arg("--version").output().is_ok();
        if !found {
            println!("not run: {tool} is missing");
        }
        found
    };
    let programs =
        [(&C, "first.c", blocks("c").remove(0)), (&CPP, "first.cpp", blocks("cpp").remove(0))];
    for (compilers, name, text) in &programs {
        let source = prefix.path().join(name);
        std::fs::write(&source, text).unwrap();
        for compiler in present(&compilers[..]) {
            if is_there("pkg-config") {
                let mut flags = Command::new("pkg-config");
                flags.args(["--cflags", "--libs", "sarrus"]);
                let flags = run(flags.env("PKG_CONFIG_PATH", library.join("pkgconfig")));
                let mut compile = Command::new(compiler);
                let path = prefix.path().join("program");
                if name.ends_with("cpp") {
                    compile.arg("-std=c++20");
                }
                compile.args(["-Wall", "-Wextra", "-Werror"]).arg(&source).arg("-o").arg(&path);
                compile.arg(format!("-Wl,-rpath,{}", library.display()));
                run(compile.args(flags.split_whitespace()));
                assert_eq!(run(&mut Command::new(&path)), "16.8023\n");
            }
        }
    }

    // before C++20 the compiler's error names the missing standard
    let source = prefix.path().join("first.cpp");
    for compiler in present(&CPP[..]) {
        let mut compile = Command::new(compiler);
        compile.args(["-std=c++17", "-fsyntax-only", "-I"]).arg(prefix.path().join("include"));
        let output = compile.arg(&source).output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success() && errors.contains("-std=c++20"), "{errors}");
    }

    // both libraries with CMake
    if is_there("cmake") {
        let text = format!(
            "cmake_minimum_required(VERSION 3.16)\nproject(page C CXX)\n\
             add_executable(controller first.cpp)\n{}\
             find_package(sarrus 0.1 REQUIRED)\nadd_executable(static first.c)\n\
             target_link_libraries(static PRIVATE sarrus::static)\n",
            blocks("cmake").remove(0)
        );
        std::fs::write(prefix.path().join("CMakeLists.txt"), text).unwrap();
        let build = prefix.path().join("build");
        let mut configure = Command::new("cmake");
        configure.arg("-S").arg(prefix.path()).arg("-B").arg(&build);
        let named = format!("-DCMAKE_PREFIX_PATH={}", prefix.path().display());
        run(configure.arg(named));
        run(Command::new("cmake").arg("--build").arg(&build));
        for program in ["controller", "static"] {
            assert_eq!(run(&mut Command::new(build.join(program))), "16.8023\n");
        }
    }
}
