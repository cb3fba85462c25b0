//! `NAME.cu` or `NAME.cl`: a kernel over a batch of states. `NAME_launch`: a program that runs it.

use std::path::Path;
use std::process::Command;

use sarrus_dynamics::Model;

use crate::Kernel;
use crate::c::{Source, test};
use crate::compiler::{COMPILE, first_line, usual};
use crate::error::BuildError;
use crate::run::{Cancel, run};

/// The language of a kernel for devices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Device {
    /// CUDA.
    Cuda,
    /// OpenCL C 1.2, with doubles.
    OpenCl,
}

/// A kernel over batches, number by number, and a program that launches it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Launcher {
    /// Its language.
    pub device: Device,
    /// `NAME.cu` or `NAME.cl`: the kernel `NAME_kernel`, which includes `NAME.c`.
    pub kernel: String,
    /// `NAME_launch.cu` or `NAME_launch.c`: a program that ends with 0 where every answer of a
    /// device has the generic kernel's bits, and with 2 where there is no device.
    pub launch: String,
}

impl Launcher {
    pub(super) fn new(kernel: &Kernel, model: &Model<f64>, name: &str, device: Device) -> Launcher {
        let text = match device {
            Device::Cuda => include_str!("launch_cuda.c"),
            Device::OpenCl => include_str!("launch_opencl.c"),
        };
        let launch = include_str!("launch.c").replace("@DEVICE@", text);
        let [kernel, launch] =
            [include_str!("kernel.c"), &launch].map(|text| test::filled(text, kernel, model, name));
        Launcher { device, kernel, launch }
    }

    /// The endings of its files.
    pub(crate) fn endings(&self) -> [&'static str; 2] {
        match self.device {
            Device::Cuda => [".cu", "_launch.cu"],
            Device::OpenCl => [".cl", "_launch.c"],
        }
    }
}

impl Source {
    /// Builds the launcher that [`Compiler::write`](crate::Compiler::write) wrote, with the compiler
    /// `NVCC`, or `nvcc`, for CUDA and with `CC` for OpenCL, and runs it, each for at most 120 s. Its
    /// output, with the registers and spills of the kernel where the compiler prints them, or why it
    /// was not run; `None` without a launcher.
    ///
    /// # Errors
    /// [`BuildError`]: some bit is another, it takes too long, or was cancelled.
    pub fn launched(&self, folder: &Path, cancel: &Cancel) -> Result<Option<String>, BuildError> {
        let Some(launcher) = &self.launcher else { return Ok(None) };
        let folder = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
        let program = folder.join(format!("{}_launch", self.name));
        let (compiler, flags) = match launcher.device {
            Device::Cuda => (usual("NVCC", "nvcc"), &["-fmad=false", "-Xptxas", "-v"][..]),
            Device::OpenCl => (usual("CC", "cc"), &["-std=c11", "-lOpenCL"][..]),
        };
        let [_, ending] = launcher.endings();
        let from = folder.join(format!("{}{ending}", self.name));
        let mut words = compiler.split_whitespace();
        let mut command = Command::new(words.next().unwrap_or_default());
        command.args(words).arg(from).arg("-o").arg(&program).args(flags);
        let mut text = String::new();
        match run(&mut command, &compiler, COMPILE, cancel) {
            Ok(built) if built.is_success => {
                let is_size = |line: &&str| line.contains("registers") || line.contains("spill");
                let lines = built.words.lines().filter(is_size);
                lines.for_each(|line| text += &format!("{}\n", line.trim()));
            }
            Ok(failed) => {
                let why = first_line(&failed.words);
                return Ok(Some(format!("not run: {compiler}: {why}")));
            }
            Err(BuildError::Cancelled) => return Err(BuildError::Cancelled),
            Err(error) => return Ok(Some(format!("not run: {error}"))),
        }
        let name = program.display().to_string();
        let ended = run(Command::new(&program).current_dir(folder), &name, COMPILE, cancel)?;
        match ended.code {
            Some(0) => Ok(Some(text + &ended.words)),
            Some(2) => Ok(Some(text + "not run: " + &ended.words)),
            _ => Err(BuildError::Failed { program: name, words: ended.words }),
        }
    }
}
